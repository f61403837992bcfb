"""Sources become a shared library, or an error names what is missing."""

import ctypes

import pytest

from armload_controller.control_errors import ExportError
from armload_controller.export import compiled_library as module
from armload_controller.export.compiled_library import compiled_library

VISIBLE = '__attribute__((visibility("default"))) '
SOURCES = {
    "number.h": "int number(void);\n",
    "number.c": '#include "number.h"\nint number(void) { return ANSWER; }\n',
    "public.c": f'#include "number.h"\n{VISIBLE}int answer(void) {{ return number(); }}\n',
}


def test_a_library_contains_all_sources_and_only_what_is_public(tmp_path, monkeypatch):
    monkeypatch.setenv("CFLAGS", "-DANSWER=42")
    file = tmp_path / "a.so"
    file.write_bytes(compiled_library(SOURCES, "a.fmu"))
    library = ctypes.CDLL(str(file))
    assert library.answer() == 42
    assert not hasattr(library, "number")


@pytest.mark.parametrize(
    ("compiler", "text"),
    [
        (None, "holds a compiled library, but no C compiler was found. Install one"),
        (["/no/cc"], "the C compiler /no/cc cannot be run: No such file or directory"),
        (
            ["sh", "-c", "echo broken >&2; exit 3"],
            "the C compiler sh -c 'echo broken >&2; exit 3' ended with 3: broken",
        ),
    ],
)
def test_without_a_working_compiler_the_file_is_refused(monkeypatch, compiler, text):
    monkeypatch.setattr(module, "c_compiler", lambda: compiler)
    with pytest.raises(ExportError) as caught:
        compiled_library(SOURCES, "a.fmu")
    assert str(caught.value).startswith("a.fmu")
    assert text in str(caught.value)
