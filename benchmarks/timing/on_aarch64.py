"""A whole commissioning on aarch64, under qemu-user: prbt with its own excitations, beside x86-64.

Four runs over CANopen in virtual time, an identification from either pair. Positions are compared bit for bit.
Needs `make wheels DIST=FOLDER/dist`, Debian's packages for arm64 and PyPI; `.ci/aarch64` says for what.

    python -m benchmarks.timing.on_aarch64 FOLDER
"""

from __future__ import annotations

import subprocess
import sys
import venv
from pathlib import Path

ROBOT = "prbt"
CHECKOUT = Path(__file__).resolve().parents[2]


def run(folder: Path) -> None:
    """Print what both processors print.

    Args:
        folder: With the wheels in `dist`; the rest is made if it is not there.
    """
    emulated, plain = folder / "aarch64" / "python", folder / "plain"
    if not emulated.is_file():
        venv.create(plain, with_pip=True)
        pip = [str(plain / "bin" / "python"), "-m", "pip", "--quiet", "--disable-pip-version-check"]
        (wheel,) = (folder / "dist").glob("*_x86_64.whl")
        subprocess.run([*pip, "install", wheel], check=True)
        frozen = subprocess.run([*pip, "freeze"], check=True, capture_output=True, text=True).stdout
        (folder / "versions.txt").write_text(frozen)
        script = [CHECKOUT / ".ci" / "aarch64", emulated.parent]
        for given in ([folder / "dist", folder / "versions.txt"], []):
            subprocess.run([*script, *given], check=True, stdout=subprocess.DEVNULL)
    texts = []
    for python in (sys.executable, emulated):
        words = [str(python), "tests/moving_arm.py", ROBOT]
        done = subprocess.run(words, cwd=CHECKOUT, check=True, capture_output=True, text=True)
        print(done.stdout + done.stderr.splitlines()[-1], flush=True)
        texts.append(done.stdout)
    print("the same on both" if texts[0] == texts[1] else "DIFFERENT on aarch64")


if __name__ == "__main__":
    run(Path(sys.argv[1]).resolve())
