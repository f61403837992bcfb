"""controller/LICENCES.md names every installed dependency whose metadata state a licence that is not permissive."""

import re
from importlib.metadata import distributions
from pathlib import Path

PAGE = Path(__file__).parents[3] / "controller" / "LICENCES.md"
NOT_PERMISSIVE = re.compile(r"GPL|MPL|EPL|CDDL|EUPL|Mozilla|GNU", re.IGNORECASE)


def stated(metadata):
    """Everything that a package's metadata say about its licence, without the text of the licence."""
    classifiers = [line for line in metadata.get_all("Classifier", []) if line.startswith("License")]
    return " ".join([metadata.get("License-Expression") or "", (metadata.get("License") or "")[:80], *classifiers])


def test_the_page_names_what_is_not_permissive():
    installed = {dist.metadata["Name"].lower(): stated(dist.metadata) for dist in distributions()}
    found = {name for name, licence in installed.items() if NOT_PERMISSIVE.search(licence)}
    named = set(re.findall(r"^\| `([\w-]+)` \|", PAGE.read_text("utf-8"), flags=re.MULTILINE))
    assert "python-can" in found
    assert found <= named
    assert named & set(installed) <= found
