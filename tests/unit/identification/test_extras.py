"""What is said if a library is missing that a plain installation does not include."""

import pytest

from armload_identification import extras
from armload_identification.extras import Extra, missing_extra, require_extra
from armload_identification.identification_errors import ExtraMissing

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(
    ("absent", "names"),
    [({"matplotlib", "jinja2"}, "Matplotlib and Jinja"), ({"jinja2"}, "Jinja"), (set(), None), ({"scipy"}, None)],
)
def test_all_missing_libraries_of_an_extra_are_named_and_no_others(monkeypatch, absent, names):
    monkeypatch.setattr(extras, "find_spec", lambda module: None if module in absent else object())
    if names is None:
        require_extra(Extra.REPORT, "a report")
        return
    with pytest.raises(ExtraMissing) as caught:
        require_extra(Extra.REPORT, "a report")
    assert str(caught.value) == (
        f"a report needs {names}, which a plain installation does not include. "
        "Install it: pip install 'armload[report]'."
    )


@pytest.mark.parametrize(
    ("module", "library", "extra"),
    [
        ("scipy", "SciPy", "identify"),
        ("matplotlib.figure", "Matplotlib", "report"),
        ("pyarrow.parquet", "PyArrow", "fleet"),
        ("tomllib", None, None),
        (None, None, None),
    ],
)
def test_a_failed_import_leads_to_the_extra_that_prevents_it(module, library, extra):
    found = missing_extra(ModuleNotFoundError("No module", name=module))
    if library is None:
        assert found is None
    else:
        assert str(found).startswith(f"this needs {library}, ")
        assert str(found).endswith(f"'armload[{extra}]'.")
