"""Compile the kernels: a hatchling build hook, and a program for checks with other compiler flags.

The extension uses the limited API, so that one file works with every CPython from 3.11 on. It is placed in the package
directory, in an editable installation as in the wheel.

    python identification/armload_core/source/compilation/build_extension.py FOLDER [FLAG ...]
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

sys.path.insert(0, str(Path(__file__).resolve().parents[3]))  # armload_core is not installed yet

from armload_core.c_compiler import INSTALL_ONE, c_compiler

SOURCE = Path(__file__).resolve().parents[1]
EXTENSION = "kernels.abi3.so"
INCLUDE = Path(sysconfig.get_path("include"))
# -O3 for vectorisation; ISO C needs -ffp-contract=fast for fused multiply-add; no flag relaxes IEEE arithmetic further
FLAGS = ("-std=c99", "-O3", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=fast", "-fno-math-errno")
WARNINGS = ("-Wall", "-Wextra", "-Wconversion")


class CustomBuildHook(BuildHookInterface[Any]):
    """Compiles the extension and tags the wheel for this platform and CPython 3.11 or later."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before hatchling collects the files."""
        package = SOURCE.parent
        compile_extension(package)
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["artifacts"].append(str((package / EXTENSION).relative_to(self.root)))
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{platform}"


def compile_extension(folder: Path, flags: tuple[str, ...] = (), include: Path = INCLUDE) -> None:
    """Compile into a folder; a process that has loaded the old file keeps using it.

    Args:
        folder: Destination of the extension.
        flags: Additional compiler flags.
        include: Folder of Python's headers.

    Raises:
        SystemExit: no compiler, no Python.h, or the compiler fails.
    """
    if not (include / "Python.h").is_file():
        raise SystemExit(
            f"armload's kernels are compiled for this Python, but its headers are missing: no Python.h in {include}. "
            "Install them (Debian, Ubuntu: apt install python3-dev)."
        )
    compiler = c_compiler()
    if compiler is None:
        raise SystemExit(f"armload's kernels are written in C, but no C compiler was found. {INSTALL_ONE}.")
    fresh = folder / f".{EXTENSION}.{os.getpid()}"
    sources = sorted(str(file) for file in SOURCE.glob("*/*.c"))
    more = (*shlex.split(os.environ.get("CFLAGS", "")), *flags)
    command = [*compiler, *FLAGS, *WARNINGS, f"-I{SOURCE}", f"-I{include}", *more, *sources, "-lm", "-o", str(fresh)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    sys.stderr.write(done.stderr)
    if done.returncode != 0:
        raise SystemExit(f"armload's kernels were not compiled: {shlex.join(command[:1])} ended with {done.returncode}")
    fresh.replace(folder / EXTENSION)


if __name__ == "__main__":
    compile_extension(Path(sys.argv[1]), tuple(sys.argv[2:]))
