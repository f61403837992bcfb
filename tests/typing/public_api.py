"""Typical use of the public API; `make lint` checks it with mypy's strict mode. Nothing here runs."""

from pathlib import Path
from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import armload
from armload import Findings, PayloadFeedforward, Recording, Robot


def identify_and_report(folder: Path) -> float:
    """Names, recordings and files, as objects and as paths."""
    robot = armload.load_robot("er50")
    assert_type(robot, Robot)
    loaded = armload.read_recording(folder / "loaded.mcap")
    assert_type(loaded, Recording)
    unloaded = armload.read_recording(str(folder / "unloaded.csv"), robot)
    result = armload.identify(robot, loaded, unloaded, validation=(folder / "a.mcap", "b.mcap"))
    assert_type(result, Findings)
    assert_type(result.intervals["mass"], tuple[float, float] | None)
    assert_type(result.verdict.title, str)
    result.save("payload.toml")
    result.report(folder / "report.html")
    document = result.to_dict()
    judged = armload.validate("er50", folder / "payload.toml", loaded, unloaded, calibration="arm.calibration.toml")
    assert_type(judged, Findings)
    return float(document["payload"]["mass_kg"]) + judged.payload.model.mass_kg


def identify_with_ranges(loaded: Path, unloaded: Path) -> Findings:
    """Prior knowledge, as numbers and as ranges."""
    weighed = armload.KnownPayload(mass_kg=2.1, center_of_mass_m=np.zeros(3))
    assert_type(weighed, armload.KnownPayload)
    known = armload.KnownPayload(mass_kg=(1, 3), center_of_mass_m=[0.0, (-0.01, 0.01), (0.05, 0.15)])
    return armload.identify("er50", loaded, unloaded, known=known)


def judge(payload: Path, loaded: Path, unloaded: Path) -> str:
    """A tolerance, and the errors."""
    tolerance = armload.Tolerance(mass_share=0.05, center_m=0.02)
    try:
        return armload.validate("er50", payload, loaded, unloaded, tolerance=tolerance).verdict.title
    except (armload.IdentificationError, armload.ControlError) as error:
        return str(error)


def loop_of_any_arm(urdf: Path, payload: Path) -> PayloadFeedforward:
    """An arm with a URDF and no robot file."""
    arm = armload.read_urdf_arm(urdf, flange="tool0")
    assert_type(arm, armload.UrdfArm)
    return PayloadFeedforward(arm.chain, armload.read_payload(payload).model)


def from_arrays(time_s: NDArray[np.float64], q: NDArray[np.float64], tau: NDArray[np.float64]) -> Findings:
    """The user's arrays."""
    loaded = Recording.from_arrays(time_s, q, torque_nm=tau)
    assert_type(loaded, Recording)
    return armload.identify(Path("my_arm.toml"), loaded, Recording.from_arrays(time_s, q, current_a=tau, name="empty"))


def control(q: NDArray[np.float64], dq: NDArray[np.float64], ddq: NDArray[np.float64]) -> NDArray[np.float64]:
    """The payload's torque in a control loop."""
    payload = armload.read_payload(Path("payload.toml"))
    assert_type(payload.model, armload.InertialParameters)
    feedforward = PayloadFeedforward(armload.load_robot("er50").chain, payload.model)
    feedforward.set_payload(armload.NOTHING, transition_s=0.2, cycle_s=0.001)
    return feedforward.torque_nm(q, dq, ddq)


def design() -> None:
    """An excitation."""
    excitation = armload.design(Path("my_arm.toml"), period_s="auto", search=armload.DesignSearch(restarts=4))
    assert_type(excitation.periods, int)
    excitation.save("excitation.toml")
    excitation.picture(Path("excitation.png"))


def wrong_names() -> None:
    """Are errors: strict mode would report an `ignore` that is not needed."""
    armload.identfy("er50", "loaded.mcap")  # type: ignore[attr-defined]
    from armload import Recordings  # type: ignore[attr-defined] # noqa: F401

    armload.identify("er50", "loaded.mcap", estimator="robust")  # type: ignore[call-arg]


class Near:
    """Stops the motion if a joint is near zero."""

    def __init__(self, n: int, distance_rad: float) -> None:
        self.n, self.distance_rad = n, distance_rad

    def on_cycle(self, step: armload.CycleStep) -> None:
        """Check one cycle."""
        if float(abs(step.feedback.position_rad).min()) < self.distance_rad:
            step.ask_to_stop("near zero")


class NearTable(armload.PluginTable):
    """A plug-in of the cycle from the user's package."""

    distance_rad: float

    def plugin(self, robot: armload.Robot) -> Near:
        """Make the plug-in."""
        if self.distance_rad <= 0.0:
            raise armload.BadValue("distance_rad", self.distance_rad, "expected more than 0")
        return Near(robot.n, self.distance_rad)
