"""Formats by name, and what another package's function may write."""

import pytest

from armload_controller.control_errors import ExportError
from armload_controller.export import format_registry
from armload_controller.export.format_registry import ExportFormat, exporter, format_names


@pytest.mark.parametrize("name", list(ExportFormat))
def test_every_format_has_a_function_of_its_name(name):
    assert exporter(name).__name__ == f"export_{name}"


@pytest.fixture
def sheet(monkeypatch, make_subject):
    """What a package's format `sheet` writes, with any contents or function."""
    monkeypatch.setattr(format_registry, "extension_names", lambda group, own: ("sheet",))

    def sheet(provided):
        made = provided if callable(provided) or provided is None else lambda subject: provided
        found = (made, "sheets 1.2") if provided is not None else None
        monkeypatch.setattr(format_registry, "extension", lambda group, name, own: found)
        return exporter("sheet")(make_subject())

    return sheet


def test_a_package_writes_texts_and_bytes(sheet):
    assert format_names()[-2:] == ("thresholds", "sheet")
    assert sheet({"a.txt": "mass", "b.bin": b"\xff"}) == {"a.txt": "mass", "b.bin": b"\xff"}
    assert sheet(lambda subject: [(subject.robot, "")]) == {"er50": ""}


def failing(_):
    raise ZeroDivisionError("no mass")


@pytest.mark.parametrize(
    ("provided", "text"),
    [
        (failing, "sheet of sheets 1.2 failed: ZeroDivisionError: no mass"),
        ({}, "sheet of sheets 1.2 gave no file"),
        ({5: "text"}, "gave 5, expected names of files without folders, and texts"),
        ({"a/b.txt": "text"}, "gave 'a/b.txt', expected names of files without folders, and texts"),
        ({"a.txt": 5}, "gave 'a.txt', expected names of files without folders, and texts"),
        ({"a.txt": "10 µm"}, "gave a.txt with characters that are not ASCII"),
    ],
)
def test_anything_else_is_refused_by_name(sheet, provided, text):
    with pytest.raises(ExportError) as caught:
        sheet(provided)
    assert text in str(caught.value)
    assert str(caught.value).startswith("payload.toml")


@pytest.mark.parametrize("provided", [None, 5])
def test_a_format_that_nobody_writes_is_named_with_all_others(monkeypatch, provided):
    found = None if provided is None else (provided, "sheets 1.2")
    monkeypatch.setattr(format_registry, "extension", lambda group, name, own: found)
    monkeypatch.setattr(format_registry, "extension_names", lambda group, own: ("sheet", "other"))
    with pytest.raises(ExportError, match=r"'sheet': no such format: one of c, fmu, .*, thresholds, other$"):
        exporter("sheet")
