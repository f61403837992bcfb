"""Compiles C sources into a shared library, for formats that contain a binary."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from armload_controller.control_errors import ExportError

_FLAGS = ("-std=gnu99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-s")
_LIBRARY = "library.so"


def compiled_library(sources: Mapping[str, str], file: str) -> bytes:
    """A shared library for this computer's processor; the same sources and compiler give the same bytes.

    The compiler is `CC`, cc, gcc or clang, whichever comes first, or else PyPI's ziglang; `CFLAGS` are added.

    Args:
        sources: Texts by file name; those that end in .c are compiled.
        file: The file that will contain the library, for messages.

    Raises:
        ExportError: there is no C compiler, or it failed.
    """
    compiler = _compiler(file)
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


def _compiler(file: str) -> list[str]:
    """The command of a C compiler.

    Raises:
        ExportError: there is none.
    """
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        # by default zig compiles for this very processor
        return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    raise ExportError(
        file,
        "holds a compiled library, but no C compiler was found. Install one (Debian, Ubuntu: apt install gcc) or "
        "PyPI's (pip install ziglang)",
    )
