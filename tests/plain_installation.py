"""Checks what an installation without extras does and rejects; a program, run in that installation.

Prints the torque of a payload at some states, with the digits that are equal on all processors, and the installation's
size on disk.
"""

from __future__ import annotations

import platform
import sys
import tempfile
from contextlib import redirect_stderr, suppress
from importlib.metadata import version
from importlib.util import find_spec
from io import StringIO
from pathlib import Path

import numpy as np

EXTRAS = ("scipy", "matplotlib", "jinja2", "mujoco", "pinocchio", "rosbags", "pyarrow", "foxglove", "distributed")
TOOLS = ("pip", "setuptools", "pkg_resources", "_distutils_hack")
LOADS_RUCKIG = ("design", "feedforward", "commission")
"""Skipped without Ruckig: PyPI has no wheel of it for aarch64."""
REFUSED = {
    "identify prbt --loaded {payload} --unloaded {payload}": "identify",
    "validate prbt {payload} --loaded {payload} --unloaded {payload}": "identify",
    "calibrate prbt {payload} --output {folder}/arm.calibration.toml": "identify",
    "report prbt {payload} --output {folder}/report.html": "report",
    "design prbt --output {folder}/excitation.toml": "report",
    "feedforward compare prbt {payload} --picture {folder}/picture.svg --yes": "report",
    "commission prbt --output {folder}/runs --yes": "identify",
    "fleet identify {payload} --output {folder}/fleet": "fleet",
    "fleet watch {payload} --output {folder}/fleet": "fleet",
    "fleet report {folder}": "fleet",
}
"""Commands that need an extra, and the extra named in their message."""


def main() -> None:
    from typer.testing import CliRunner

    from armload_controller.cli.command_tree import app

    runner = CliRunner()
    there = [name for name in EXTRAS if find_spec(name) is not None]
    require(not there, f"no plain installation: it has {there}")
    with tempfile.TemporaryDirectory() as scratch:
        payload = Path(scratch) / "payload.toml"
        write_some_payload(payload)
        print_torque(payload)
        for target in ("c", "urdf", "ros2", "kuka"):
            done = runner.invoke(
                app, ["export", "prbt", str(payload), "--format", target, "--output", f"{scratch}/{target}"]
            )
            require(done.exit_code == 0, f"export to {target}: {done.output}{done.exception}")
        for words, extra in REFUSED.items():
            if words.startswith(LOADS_RUCKIG) and find_spec("ruckig") is None:
                continue
            done = runner.invoke(app, words.format(payload=payload, folder=scratch).split())
            require(f"'armload[{extra}]'" in str(done.exception), f"{words}: {done.output}{done.exception!r}")
        said = printed_by("drift", "prbt", str(payload))
        require("error: this needs SciPy" in said, f"a command that does not ask for its extra: {said}")


def printed_by(*words: str) -> str:
    """Standard error of the program."""
    from armload_controller.cli.entry import main as program

    sys.argv = ["armload", *words]
    with redirect_stderr(StringIO()) as said, suppress(SystemExit):
        program()
    return said.getvalue()


def write_some_payload(path: Path) -> None:
    """Write a payload file as an identification would."""
    from armload_identification.files.payload_file import write_payload
    from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance

    model = InertialParameters.from_center_of_mass(2.7, [0.01, -0.02, 0.08], np.diag([0.012, 0.013, 0.006]).tolist())
    interval = model.values[:, None] + np.array([-1e-4, 1e-4])
    provenance = Provenance(version("armload"), "0", {"loaded.mcap": "0"})
    write_payload(
        path, PayloadResult("flange", model, interval[:, 0] < interval[:, 1], interval, *np.ones((2, 6)), provenance)
    )


def print_torque(payload: Path) -> None:
    """Print the feed-forward's torque at some states."""
    import armload

    feedforward = armload.PayloadFeedforward(armload.load_robot("prbt").chain, armload.read_payload(payload).model)
    for state in np.random.default_rng(1).uniform(-1.0, 1.0, (4, 3, 6)):
        print(" ".join(f"{torque:.9f}" for torque in feedforward.torque_nm(*state)))


def require(condition: bool, problem: str) -> None:
    """Exit with status 1 if the condition is false."""
    if not condition:
        sys.exit(problem)


def size_mb() -> float:
    """Size of armload's site-packages without pip and its dependencies, in MB of 1e6 bytes."""
    import armload

    roots = [root for root in Path(armload.__file__).parents[1].iterdir() if root.name.split("-")[0] not in TOOLS]
    return sum(file.stat().st_size for root in roots for file in (root, *root.rglob("*")) if file.is_file()) / 1e6


if __name__ == "__main__":
    main()
    sys.stderr.write(
        f"armload {version('armload')} without extras on {platform.machine()}, Python {platform.python_version()}: "
        f"{size_mb():.0f} MB; loop and exports work, the rest names its extra\n"
    )
