"""Compiles C sources into a shared library, for formats that contain a binary."""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from armload_controller.control_errors import ExportError
from armload_core.c_compiler import INSTALL_ONE, c_compiler

_FLAGS = ("-std=gnu99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
_LIBRARY = "library.so"


def compiled_library(sources: Mapping[str, str], file: str) -> bytes:
    """A shared library for this computer's processor; the same sources and compiler give the same bytes.

    The compiler is that of `c_compiler`; `CFLAGS` are added.

    Args:
        sources: Texts by file name; those that end in .c are compiled.
        file: The file that will contain the library, for messages.

    Raises:
        ExportError: there is no C compiler, or it failed.
    """
    compiler = c_compiler()
    if compiler is None:
        raise ExportError(file, f"holds a compiled library, but no C compiler was found. {INSTALL_ONE}")
    with TemporaryDirectory() as folder:
        for name, text in sources.items():
            (Path(folder) / name).write_text(text, encoding="ascii")
        units = [name for name in sources if name.endswith(".c")]
        command = [*compiler, *_FLAGS, *shlex.split(os.environ.get("CFLAGS", "")), *units, "-lm", "-o", _LIBRARY]
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        except OSError as problem:
            raise ExportError(file, f"the C compiler {compiler[0]} cannot be run: {problem.strerror}") from problem
        if done.returncode != 0:
            raise ExportError(
                file, f"the C compiler {shlex.join(compiler)} ended with {done.returncode}: {done.stderr.strip()}"
            )
        return (Path(folder) / _LIBRARY).read_bytes()
