"""The commissioning: which runs are recorded, and which recordings belong together.

    unloaded: identification, validation        payload mounted        loaded: identification, validation
    -> estimate from the identification pair -> checked on the validation pair -> payload.toml, report.html

Every run goes through `run_session`: a slow round for every path and every load, and the operator's consent. The two
halves may run in different processes: each leaves its recordings in the run's directory, where the second finds those
of the first.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from math import inf, sqrt
from pathlib import Path

from armload_controller.analysis.arm_in_use import ArmInUse, Calibration, arm_in_use
from armload_controller.analysis.robot_identification import identify
from armload_controller.analysis.stated_drift import NOTHING_STATED, StatedDrift
from armload_controller.config.robot import Robot
from armload_controller.config.robot_recordings import read_of
from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.following_monitor import CycleSummary
from armload_controller.cycle.lateness import Lateness
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.slow_round_torque import SlowRoundRows
from armload_controller.motion.checked_path import CheckedPath, check_path
from armload_controller.session.mounted_load_check import loaded_doubts, unloaded_doubts
from armload_controller.session.robot_recorder import robot_recorder
from armload_controller.session.run_session import WHOLE, Course, Operator, RunSession, ServosFactory, run_session
from armload_controller.session.session_load import SessionLoad
from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.payload import PayloadResult
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.phase_advance import even_advance
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT

ROLES = ("identification", "validation")
"""Excitations of a commissioning: the payload is identified from the first and validated on the second."""
MOST_TIMES = 5
"""How often the loaded periods are recorded at most; those of the empty run then limit the interval."""


@dataclass(frozen=True)
class CommissioningPlan:
    """Where the recordings of a commissioning are, and what is known before them.

    Attributes:
        directory: Folder of the recordings.
        mass_kg: The payload's mass for the loaded recordings; None if it was not weighed.
        calibration: Calibration of the arm; None for the one that its file names, if any.
        drift: What is stated of the drift of the gains since the calibration.
        until: Relative half width of the repeatable part of the mass's interval until which the loaded periods are
            repeated; None for the excitation's periods.
        slow_only: Record the slow rounds alone.

    Raises:
        ModelError: the mass is not positive.
    """

    directory: Path
    mass_kg: float | None = None
    calibration: Calibration | None = None
    drift: StatedDrift = NOTHING_STATED
    until: float | None = None
    slow_only: bool = False

    def __post_init__(self) -> None:
        _ = self.known

    @property
    def known(self) -> KnownPayload | None:
        """What is known of the payload; a mass that no payload can have is refused here, before anything moves."""
        return None if self.mass_kg is None else KnownPayload(mass_kg=self.mass_kg)


def recording_path(directory: Path, load: SessionLoad, role: str) -> Path:
    """File of a run."""
    return directory / f"{load}_{role}.mcap"


def record_half(
    robot: Robot,
    load: SessionLoad,
    open_servos: ServosFactory,
    operator: Operator,
    plan: CommissioningPlan,
) -> list[CycleSummary]:
    """Run and record the excitations that have not yet been recorded with one load.

    Args:
        load: Present load on its flange.
        open_servos: Opens the arm.
        operator: The person at the arm.
        plan: Where to record, and what is known of arm and payload.

    Raises:
        CommissioningError: the robot has no excitations, or the operator does not agree: nothing is switched on;
            or a run contains no complete period at full speed, and stays partial.
        ConfigurationError: an excitation touches something or requires too much torque; nothing was switched on.
        LimitViolation: an excitation exceeds a limit; nothing was switched on.
        InfeasibleMotion: an excitation cannot be entered within the limits; nothing was switched on.
        MotionError: the motion was stopped, or a stop was requested before anything was switched on.
        DriverError: the arm could not be brought up.
    """
    paths = checked_excitations(robot, missing_roles(plan.directory, load))
    arm = arm_in_use(robot, plan.calibration)
    with run_session(robot, load, open_servos, operator) as session:
        return [_record(session, arm, role, path, plan) for role, path in paths.items()]


def _record(session: RunSession, arm: ArmInUse, role: str, path: CheckedPath, plan: CommissioningPlan) -> CycleSummary:
    """Record one run, including its slow round."""
    robot, directory = session.robot, plan.directory
    weighed = {"mass_kg": plan.mass_kg} if session.load is SessionLoad.LOADED and plan.mass_kg is not None else {}
    run = {
        "load": session.load,
        "role": role,
        "simulated": session.simulated,
        "cycle_hz": 1 / path.cycle_s,
        "slow_round_s": path.slow_round_s,
        "slow_round_speed_m_s": path.slow_speed_m_s,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **weighed,
    }
    name, attached = f"{session.load}: {role}", {EXCITATION_ATTACHMENT: format_excitation(path.excitation)}
    unloaded = recording_path(directory, SessionLoad.UNLOADED, role)
    look: Callable[[SlowRoundRows], list[str]] = partial(unloaded_doubts, robot, arm)
    if session.load is SessionLoad.LOADED:  # which may be recorded first
        look = partial(loaded_doubts, robot, arm, unloaded) if unloaded.is_file() else WHOLE.look
    lateness = Lateness(path.cycle_s, None if robot.bus.in_virtual_time else time.monotonic)
    file = recording_path(directory, session.load, role)
    with robot_recorder(robot, file, run, lateness, **attached) as recorder:
        asking = plan.until is not None and session.load is SessionLoad.LOADED and role == ROLES[0]
        more = partial(_more_periods, session, name, path, plan, recorder) if asking else WHOLE.more
        summary = session.run(path, name, recorder=recorder, course=Course(look, plan.slow_only, more))
        if plan.slow_only:
            return summary
        advance = even_advance(*recorder.measured, path.excitation.trajectory)
        if advance is None:
            raise CommissioningError(
                f"{name}: no complete period was run at full speed without a pause, so {recorder.partial} is not used. "
                "Run the same command again: set the speed to 100 % (key +) before the slow round ends, and do not "
                "pause in every period."
            )
        if advance.interruptions and not asking:
            session.display.step(
                f"{name}: paused or slowed down within the periods: {advance.periods} of {advance.held} remain"
            )
        return summary


def _more_periods(session: RunSession, name: str, path: CheckedPath, plan: CommissioningPlan, run: Recorder) -> str:
    """The question whether to repeat the periods; empty, and said why, if no more are wanted."""
    robot, wanted, periods = session.robot, plan.until or 0.0, path.excitation.periods
    recorded = len(run.measured[0]) * path.cycle_s / path.excitation.trajectory.period_s
    empty = recording_path(plan.directory, SessionLoad.UNLOADED, ROLES[0])
    runs = (read_of(robot, file) for file in (run.partial, empty))
    try:
        found = identify(robot, *runs, calibration=plan.calibration, known=plan.known, drift=plan.drift)
    except IdentificationError as error:
        session.display.step(f"{name}: no more periods are asked for: {error}")
        return ""
    share = repeatable_share(found.payload)
    text = (
        f"{name}, {recorded:.0f} periods: the mass repeats within +-{100.0 * share:.2f} % (95 %, without its scale), "
        f"{100.0 * wanted:.2g} % is wanted"
    )
    if share > wanted and recorded < (MOST_TIMES - 0.5) * periods:
        session.display.step(text)
        return f"{text}. Record {periods} more?"
    session.display.step(f"{text}: {'reached' if share <= wanted else 'NOT reached, and no more are recorded'}")
    return ""


def repeatable_share(payload: PayloadResult) -> float:
    """Relative half width of the mass's 95 % interval without the errors that gains and calibration share."""
    known = payload.mass_center
    if known is None:
        return inf
    return float(student_half_width(known.freedom)) * sqrt(known.measured[0, 0]) / payload.model.mass_kg


def checked_excitations(robot: Robot, roles: Iterable[str]) -> dict[str, CheckedPath]:
    """Some of the robot's excitations, checked against its present file.

    Raises:
        CommissioningError: the configuration names no such excitation.
        ConfigurationError: an excitation touches something or requires too much torque.
        LimitViolation: an excitation exceeds a limit.
        InfeasibleMotion: an excitation cannot be run at this cycle rate.
    """
    excitations = {role: require_excitation(robot, role) for role in roles}
    constraints, cycle_s = robot.motion_constraints, 1 / robot.bus.cycle_hz
    return {
        role: check_path(excitation, constraints, cycle_s, file=robot.file, key=f"excitation.{role}")
        for role, excitation in excitations.items()
    }


def missing_roles(directory: Path, load: SessionLoad) -> tuple[str, ...]:
    """Excitations not yet recorded completely with a load."""
    return tuple(role for role in ROLES if not recording_path(directory, load, role).is_file())


def require_excitation(robot: Robot, role: str) -> Excitation:
    """One of the robot's excitations.

    Raises:
        CommissioningError: the configuration names no such excitation.
    """
    if role not in robot.excitations:
        raise CommissioningError(
            f"{robot.file}: no [excitation] {role}: design one with `armload design` and name it there"
        )
    return robot.excitations[role]


def read_pair(robot: Robot, directory: Path, role: str) -> tuple[Recording, Recording]:
    """The loaded and the empty recording of one excitation.

    Raises:
        CommissioningError: the two followed different excitations.
        RecordingError: a recording is missing or contains nothing usable.
    """
    unloaded, loaded = (read_of(robot, recording_path(directory, load, role)) for load in SessionLoad)
    if len({run.source.attachments.get(EXCITATION_ATTACHMENT) for run in (unloaded, loaded)}) != 1:
        raise CommissioningError(
            f"{directory}: the {role} runs without and with the payload followed different excitations; "
            "record both with the same configuration"
        )
    return loaded, unloaded


def require_recordings(directory: Path, load: SessionLoad) -> None:
    """Refuse to continue without the recordings of one half.

    Raises:
        CommissioningError: naming the missing recording, and how to make it.
    """
    missing = missing_roles(directory, load)
    if missing:
        path = recording_path(directory, load, missing[0])
        raise CommissioningError(
            f"{path} is missing: create it with `armload commission ... --runs {load} --output {directory}`"
        )
