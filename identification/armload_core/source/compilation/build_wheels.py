"""Build the published distributions: the source distribution and, from it, one wheel per platform.

The kernels are compiled with PyPI's `ziglang` against the glibc of manylinux2014, so that the wheels run on every
manylinux2014 system, independently of the build machine; auditwheel verifies this from the symbols. Requires the
packages of `wheels.lock`.

    python identification/armload_core/source/compilation/build_wheels.py FOLDER
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[4]
PROCESSORS = ("x86_64", "aarch64")
GLIBC = (2, 17)
"""manylinux2014: the oldest glibc that numpy's wheels, and zig for aarch64, support."""


def main(folder: Path) -> None:
    """Write the source distribution and the wheels to a folder, after removing other distributions of armload there.

    Raises:
        SystemExit: a build fails, or a wheel requires more than its platform provides.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in (*folder.glob("armload-*.whl"), *folder.glob("armload-*.tar.gz")):
        old.unlink()
    _run("-m", "build", "--sdist", "--no-isolation", "--outdir", str(folder), str(ROOT))
    (sources,) = folder.glob("armload-*.tar.gz")
    with tempfile.TemporaryDirectory() as scratch:
        # the extension is compiled into the source tree, so not in the checkout, whose own extension is in use
        shutil.unpack_archive(sources, scratch)
        (tree,) = Path(scratch).glob("armload-*")
        headers = _headers_for_every_processor(Path(scratch) / "headers")
        for processor in PROCESSORS:
            _build_wheel(processor, tree, headers, folder)


def _build_wheel(processor: str, tree: Path, headers: Path, folder: Path) -> None:
    """Compile for a processor, build the wheel and audit it."""
    glibc = ".".join(map(str, GLIBC))
    platform = f"manylinux_{GLIBC[0]}_{GLIBC[1]}_{processor}"
    compiler = f"{sys.executable} -m ziglang cc -target {processor}-linux-gnu.{glibc} -mcpu=baseline -I{headers}"
    environment = {**os.environ, "CC": compiler, "CFLAGS": "-s -Werror", "_PYTHON_HOST_PLATFORM": platform}
    _run("-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(tree), environment=environment)
    (wheel,) = folder.glob(f"armload-*-{platform}.whl")
    audit = json.loads(_run("-m", "auditwheel", "show", "--json", str(wheel)))
    required = re.fullmatch(rf"manylinux_(\d+)_(\d+)_{processor}", audit["overall_tag"])
    if required is None or tuple(map(int, required.groups())) > GLIBC or audit["unsupported_isa"]:
        raise SystemExit(f"{wheel} does not run on every {platform}: auditwheel reports {json.dumps(audit, indent=2)}")
    sys.stdout.write(f"{wheel}: {wheel.stat().st_size / 1e6:.1f} MB, requires no more than {audit['overall_tag']}\n")


def _headers_for_every_processor(folder: Path) -> Path:
    """pyconfig.h for every processor: Debian has only this machine's, but on 64-bit glibc Linux all are the same."""
    multiarch = sysconfig.get_config_var("MULTIARCH") or ""
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    ours = Path("/usr/include") / multiarch / version / "pyconfig.h"
    for processor in PROCESSORS:
        there = folder / f"{processor}-linux-gnu" / version
        there.mkdir(parents=True)
        if ours.is_file():
            shutil.copy(ours, there)
    return folder


def _run(*words: str, environment: dict[str, str] | None = None) -> str:
    """Run a module with this Python and return its output."""
    done = subprocess.run([sys.executable, *words], env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(words)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    main(Path(sys.argv[1]))
