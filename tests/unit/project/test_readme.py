"""The README and the pages it links to: examples run, options exist, links work, quoted messages exist.

Commissioning, feed-forward, identification by a URDF and export are tested in `controller`.
"""

import contextlib
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.files.payload_file import write_payload
from armload_identification.model.payload import PayloadResult, Provenance

ROOT = Path(__file__).resolve().parents[3]
README, GUIDE, HELP = ROOT / "README.md", ROOT / "controller" / "GUIDE.md", ROOT / "controller" / "HELP.md"
FLEET, WATCH = ROOT / "controller" / "FLEET.md", ROOT / "controller" / "WATCH.md"
ROOMS = ROOT / "controller" / "README.md"
MOST_WORDS = 700
MOST_PICTURE_BYTES = 100_000


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text("utf-8"), flags=re.MULTILINE | re.DOTALL)


def commands(page):
    """Words of every `armload` command."""
    text = "\n".join(blocks(page, "console")).replace("\\\n", " ")
    lines = [line.removeprefix("$ ").split("  #")[0] for line in text.splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith(("armload ", "$ armload "))]


@pytest.mark.parametrize("words", commands(README) + commands(GUIDE) + commands(FLEET) + commands(WATCH), ids=" ".join)
def test_every_command_takes_the_options_it_is_shown_with(words, require_accepted):
    require_accepted(words)


def test_the_four_uses_are_shown():
    assert {words[0] for words in commands(README)} >= {
        "commission",
        "identify",
        "validate",
        "init",
        "drives",
        "export",
    }
    assert len(README.read_text("utf-8").split()) <= MOST_WORDS


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A folder with er50's payload."""
    folder = tmp_path_factory.mktemp("desk")
    body = load_robot("er50").simulation.payload("paper")
    values = np.stack([body.values, body.values], axis=1)
    known, noise = np.ones(10, dtype=bool), np.ones(6)
    write_payload(
        folder / "payload.toml", PayloadResult("flange", body, known, values, noise, noise, Provenance("0", "0", {}))
    )
    return folder


def test_a_loop_of_ones_own_as_shown(desk):
    (example,) = blocks(README, "python")
    names = {}
    with contextlib.chdir(desk):
        exec(compile(example, "README.md", "exec"), names)
    assert names["torque_nm"].shape == (6,)
    assert not names["feedforward"].torque_nm(np.zeros(6), np.zeros(6), np.zeros(6)).any()


def anchors(page):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", page.read_text("utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize(
    "page", [README, GUIDE, HELP, FLEET, ROOMS, WATCH], ids=lambda page: str(page.relative_to(ROOT))
)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)]+)\)", page.read_text("utf-8")):
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@pytest.mark.parametrize(("name", "page"), [("result.svg", README), ("watch.svg", WATCH)])
def test_pictures_are_small_and_draw_nothing_from_elsewhere(name, page):
    pictures = {picture.name: picture for picture in (ROOT / "controller" / "pictures").iterdir()}
    assert set(pictures) == {"result.svg", "watch.svg"}
    text = pictures[name].read_text("utf-8")
    assert pictures[name].stat().st_size < MOST_PICTURE_BYTES
    assert name in page.read_text("utf-8")
    assert "href=" not in text.replace('href="#', "")


def test_messages_that_help_is_given_for_are_said():
    table = HELP.read_text("utf-8").partition("## Messages")[2].partition("## Glossary")[0]
    quoted = [
        text for row in re.findall(r"^\| (`.*?) \|", table, flags=re.MULTILINE) for text in re.findall("`(.*?)`", row)
    ]
    assert len(quoted) >= 10
    said = ""
    for package in ("controller", "identification", "drivers"):
        for file in (ROOT / package).rglob("*.py"):
            said += re.sub(r'"\s*\n\s*f?"', "", file.read_text("utf-8"))
    for text in quoted:
        for part in (part.strip(" :'") for part in text.split("...")):
            assert not part or part.removeprefix("is '") in said, part
