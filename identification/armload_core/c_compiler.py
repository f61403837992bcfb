"""The search for a C compiler: for the kernels when the package is built, and for exports with a compiled library."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys

INSTALL_ONE = "Install one (Debian, Ubuntu: apt install gcc) or PyPI's (pip install ziglang)"


def c_compiler() -> list[str] | None:
    """The command of the first found of `CC`, `cc`, `gcc`, `clang` and PyPI's `ziglang`; None without any."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang"):
        # by default zig compiles for the present processor
        return [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    return None
