"""Identify a payload from recordings of a configured arm, and validate it with further recordings.

Robots, recordings and files are given as objects, names or paths.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from importlib.metadata import version
from numbers import Real
from os import PathLike

from armload_controller.analysis.arm_in_use import ArmInUse, Calibration, arm_in_use
from armload_controller.analysis.stated_drift import NOTHING_STATED, StatedDrift
from armload_controller.config.objects_or_paths import (
    FilePath,
    PayloadSource,
    RunSource,
    arm_of,
    payload_from,
    recording_of,
)
from armload_controller.config.robot_recordings import MeasuredArm, RecordingChoice, chosen_joints, read_of
from armload_controller.feedforward.payload_use import another_arms
from armload_identification.argument_types import path_of, require_type, wrong_type
from armload_identification.calibration.session_gains import REFERENCE, SessionGains
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.extras import Extra, require_extra
from armload_identification.identification_errors import (
    EstimationError,
    NoPayloadMass,
    NothingMounted,
    PayloadFileError,
    RecordingError,
)
from armload_identification.model.payload import FLANGE, PayloadResult, Provenance
from armload_identification.pipeline import payload_identification, payload_validation
from armload_identification.pipeline.any_motion import SHORTEST_WINDOW_S, identify_windows
from armload_identification.pipeline.identification_result import Identification, payload_result
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.pipeline.workpiece import Workpiece
from armload_identification.recording import file_reading
from armload_identification.recording.csv_columns import CsvColumns, parse_columns
from armload_identification.recording.formats.frame_reader import DataFrame
from armload_identification.recording.reading_options import Effort, ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.results.findings import Findings
from armload_identification.results.payload_over_time import PayloadOverTime
from armload_identification.verdict.recording_checks.impossible_magnitudes import require_possible_mass, scale_notes
from armload_identification.verdict.tolerance import Tolerance

RunPair = tuple[RunSource, RunSource]
"""A loaded run, and one of the same motion without the payload."""


def read_recording(
    path: FilePath | DataFrame,
    robot: MeasuredArm | FilePath | None = None,
    *,
    columns: CsvColumns | str | None = None,
    effort: Effort | str = Effort.TORQUE,
    between_s: tuple[float, float] | None = None,
    joints: Sequence[int] = (),
    episode: int | None = None,
) -> Recording:
    """Read a recording of any format.

    Args:
        path: MCAP of armload, ROS bag, CSV, Parquet, LeRobot data set or NumPy archive; or a data frame of pandas or
            polars.
        robot: The arm it belongs to; its `[log]` assigns the columns of a table.
        columns: Columns of a table, such as "time[ms]=0 position=1-6 current=7-12"; if not given, `[log]` or the
            header's names apply.
        effort: Meaning of the effort in a ROS message, "torque" or "current".
        between_s: Interval of rows to use, as times since the first row.
        joints: Indices, from 0, of the recorded joints that are the arm's; if not given, matched by name, or all.
        episode: Number of the recording to read from a data set of several.

    Raises:
        RecordingError: the recording cannot be read, or has other joints.
        CommissioningError: the recording is of another arm.

    Examples:
        >>> import armload
        >>> run = armload.read_recording("runs/today/loaded_identification.mcap", "er50")
        >>> run.n, run.time_s.shape == run.position_rad[:, 0].shape
        (6, True)
        >>> part = armload.read_recording("runs/today/loaded_identification.mcap", between_s=(5.0, 10.0), joints=[0, 1])
        >>> part.n, bool(part.time_s[-1] - part.time_s[0] <= 5.0)
        (2, True)
    """
    known = parse_columns(columns) if isinstance(columns, str) else columns
    choice = RecordingChoice(known, Effort(effort), between_s, episode, tuple(joints))
    source = path if isinstance(path, DataFrame) else path_of("path", path, "the path of a recording, or a data frame")
    if isinstance(joints, str):
        raise wrong_type("joints", joints, "indices from 0, such as [0, 1, 2]")
    times = list(between_s) if isinstance(between_s, Sequence) else []
    if between_s is not None and (len(times) != 2 or not all(isinstance(time, Real) for time in times)):
        raise wrong_type("between_s", between_s, "two times in s, such as (10.0, 90.0)")
    if robot is not None:
        return read_of(arm_of(robot), source, choice)
    options = ReadingOptions(known, choice.effort, episode=episode)
    return chosen_joints(file_reading.read_recording_file(source, options, between_s=between_s), choice.joints)


def identify(
    robot: MeasuredArm | FilePath,
    loaded: RunSource,
    unloaded: RunSource | None = None,
    *,
    validation: RunPair | None = None,
    calibration: Calibration | None = None,
    known: KnownPayload | None = None,
    tolerance: Tolerance | None = None,
    minus: PayloadSource | None = None,
    drift: StatedDrift = NOTHING_STATED,
) -> Findings:
    """Identify the payload from a run that carried it and one that did not.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        loaded: Run with the payload.
        unloaded: Run of the same motion without it; may be omitted if the arm is calibrated.
        validation: A loaded and an unloaded run of another motion, to judge the result.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        known: Prior knowledge of the payload.
        tolerance: Permitted error of the payload; 2 % of its mass and 10 mm if not given.
        minus: Payload of the tool, or its file; the result is then what the tool carries, with the uncertainty of
            both. The validation, which is of the whole, cannot be given too.
        drift: With a calibration: the drift that all gains have in common since then. If it is stated without a
            reference, `unloaded` measures it.

    Returns:
        Payload, intervals and verdict, to print, save and report.

    Raises:
        RecordingError: recordings that do not fit the arm or each other, or are implausible.
        EstimationError: neither unloaded run nor calibration, data that no payload explains, or a
            mass that this arm cannot carry.

    Examples:
        >>> import armload
        >>> run = "runs/today/{}_{}.mcap".format
        >>> result = armload.identify(
        ...     "er50",
        ...     loaded=run("loaded", "identification"),
        ...     unloaded=run("unloaded", "identification"),
        ...     validation=(run("loaded", "validation"), run("unloaded", "validation")),
        ... )
        >>> low, high = result.intervals["mass"]
        >>> low < result.payload.model.mass_kg < high
        True
        >>> result.verdict.title
        'Repeatable within the tolerance'
        >>> result.save("payload.toml")
        >>> result.report("report.html")
    """
    require_extra(Extra.IDENTIFY, "identifying a payload")
    require_type("known", known, KnownPayload)
    require_type("drift", drift, StatedDrift)
    require_type("tolerance", tolerance, Tolerance)
    if isinstance(validation, str | PathLike | Recording):
        raise wrong_type("validation", validation, "a loaded and an unloaded run")
    if minus is not None and validation is not None:
        raise EstimationError(
            "a validation judges the whole load, not what is left without the tool: identify the whole with the "
            "validation, and once more with the tool and without the validation"
        )
    arm = arm_of(robot)
    used = arm_in_use(arm, calibration)
    tool = None if minus is None else payload_of(minus, arm, "minus")
    gains = used.transmission
    if tool is not None and used.known is None:  # the same gains, so that their error affects both alike
        gains = gains_to_compare_by(tool.mass_center, gains)
    run = recording_of(arm, loaded, "loaded")
    empty = None if unloaded is None else recording_of(arm, unloaded, "unloaded")
    session = drift.session(arm, used, run, empty)
    empty_arm = used.known
    if session is not None and empty_arm is not None and used.calibration is not None:
        gains = session.corrected(used.calibration).transmission(arm.transmission)
        empty_arm = session.arm(empty_arm)
    unnamed = _taken_in_order(arm, run)
    with _explained(unnamed, session):
        identification = payload_identification.identify_runs(run, empty, used.chain, gains, known=known, arm=empty_arm)
    known_arm = used.calibration_sha256, arm.name, arm.chain.kinematics_sha256
    payload = payload_result(identification, Provenance(version("armload"), arm.sha256, {}, *known_arm))
    if arm.rated_payload_kg is not None:
        require_possible_mass(payload.model.mass_kg, payload.interval_95[0], arm.rated_payload_kg, arm.name)
    notes = [*run.source.remarks, *([] if unnamed is None else [unnamed])]
    if arm.rated_payload_kg is not None and payload.interval_95[0, 0] > arm.rated_payload_kg:
        notes.append(
            f"The arm carries {payload.model.mass_kg:.3g} kg, more than its rated payload of "
            f"{arm.rated_payload_kg:g} kg."
        )
    if tool is not None:
        notes.append(
            f"The workpiece alone: the whole, {payload.model.mass_kg:.4g} kg, minus the tool, {tool.model.mass_kg:.4g} "
            "kg. Its intervals contain the uncertainty of both; its inertia is not determined."
        )
        drifts = 0.0 if session is None else session.deviation
        payload = Workpiece.of(payload, tool, drifts).result(payload)
    if used.calibration is not None:
        (file,) = used.calibration_sha256
        notes.append(
            f"Gains, links, load-dependent friction and delay of the arm are from {file}: {used.calibration.origin}."
        )
    if session is not None:
        notes.append(_drift_note(session, identification))
    else:
        notes.extend(scale_notes(identification.signal.unloaded, arm.chain, arm.magnitudes))
    weighed = known is not None and isinstance(known.mass_kg, int | float)
    verified = weighed or _scale_verified(used)
    if used.calibration is not None and not verified:
        notes.append("The scale is not verified: no payload of the calibration was weighed.")
    identification = replace(identification, notes=(*notes, *identification.notes), scale_verified=verified)
    findings = Findings(arm, payload, identification)
    return findings if validation is None else _validated(findings, arm, used, validation, tolerance)


@contextmanager
def _explained(unnamed: str | None, session: SessionGains | None) -> Iterator[None]:
    """Adds to errors what may have caused them: joints that were taken in order, or a drift that is allowed for."""
    try:
        yield
    except NothingMounted:
        raise
    except RecordingError as error:
        if unnamed is None:
            raise
        raise RecordingError(f"{error} {unnamed}") from error
    except NoPayloadMass as error:
        if session is None or session.log_factor:
            raise
        allowed = f"This allows for a drift of all gains of {100.0 * session.deviation:.2g} % ({session.origin})"
        raise NoPayloadMass(
            f"{error} {allowed}; a run of the same day measures it: {REFERENCE}.", error.mass_kg, error.half_width_kg
        ) from error


def _scale_verified(used: ArmInUse) -> bool:
    """Whether something weighed verifies the scale of the arm's gains."""
    if used.calibration is None:
        return bool(used.transmission.calibrated.all())
    return used.calibration.scale_weighed


def identify_over_time(
    robot: MeasuredArm | FilePath,
    loaded: RunSource,
    every_s: float,
    *,
    calibration: Calibration | None = None,
    drift: StatedDrift = NOTHING_STATED,
) -> PayloadOverTime:
    """Identify the payload of a calibrated arm in successive windows of one run of any motion.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        loaded: The run.
        every_s: Length of a window; 10 to 20 s of fast motion are recommended.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        drift: The drift that all gains have in common since the calibration.

    Returns:
        Mass and centre of mass with intervals, to print, save as JSON and draw.

    Raises:
        EstimationError: the arm is not calibrated, or the windows are too short.
        RecordingError: the recording does not fit the arm or is implausible.

    Examples:
        >>> import armload
        >>> runs = [f"runs/today/{load}_identification.mcap" for load in ("unloaded", "loaded")]
        >>> shift = armload.identify_over_time("er50", runs[1], 15.0, calibration=armload.calibrate("er50", runs))
        >>> 9 < shift.windows[0].found.parameters.mass_kg < 11
        True
    """
    require_extra(Extra.IDENTIFY, "identifying a payload")
    arm = arm_of(robot)
    used = arm_in_use(arm, calibration)
    found = used.calibrated("identification in windows requires the arm's calibration")
    if not every_s >= SHORTEST_WINDOW_S:
        raise EstimationError(
            f"windows of {every_s:g} s: expected {SHORTEST_WINDOW_S:g} s or more; 10 to 20 s of fast motion are "
            "recommended."
        )
    run = recording_of(arm, loaded, "loaded")
    session = drift.session(arm, used, run) or SessionGains.assumed(found)
    gains = session.corrected(found).transmission(arm.transmission)
    windows = identify_windows(run, used.chain, gains, session.arm(found.known_arm), every_s)
    known = [window.found for window in windows if window.found]
    notes = tuple(_drift_note(session, one) for one in known[:1])
    return PayloadOverTime(arm.name, windows, run.source, notes)


def _drift_note(session: SessionGains, found: Identification) -> str:
    """What is assumed of the drift, the last of the errors with which the arm is held."""
    return session.note(found.parameters.mass_kg, float(found.plain.considered[-1, 0]))


def validate(
    robot: MeasuredArm | FilePath,
    payload: PayloadSource,
    loaded: RunSource,
    unloaded: RunSource,
    *,
    calibration: Calibration | None = None,
    tolerance: Tolerance | None = None,
) -> Findings:
    """Validate a payload with a pair of runs that it was not identified from.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        payload: The payload, or its file.
        loaded: Run with the payload.
        unloaded: Run of the same motion without it.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        tolerance: Permitted error of the payload; 2 % of its mass and 10 mm if not given.

    Returns:
        The payload with the verdict, to print and report.

    Raises:
        PayloadFileError: the payload's file cannot be read, or it is not given in the flange frame.
        RecordingError: recordings that do not fit the arm or each other.

    Examples:
        >>> import armload
        >>> run = "runs/today/{}_validation.mcap".format
        >>> result = armload.validate("er50", "runs/today/payload.toml", run("loaded"), run("unloaded"))
        >>> result.verdict.title
        'Repeatable within the tolerance'
    """
    runs = loaded, unloaded
    return findings_from_files(robot, payload, validation=runs, calibration=calibration, tolerance=tolerance)


def findings_from_files(
    robot: MeasuredArm | FilePath,
    payload: PayloadSource,
    *,
    fitted: RunPair | None = None,
    validation: RunPair | None = None,
    calibration: Calibration | None = None,
    tolerance: Tolerance | None = None,
) -> Findings:
    """Findings on a payload from existing files, without identifying it again.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        fitted: The runs that it was identified from.
        validation: Runs that it was not identified from.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        tolerance: Permitted error of the payload; 2 % of its mass and 10 mm if not given.

    Raises:
        PayloadFileError: the payload's file cannot be read, or it is not given in the flange frame.
        RecordingError: recordings that do not fit the arm or each other.
    """
    require_extra(Extra.IDENTIFY, "validating a payload from recordings")
    arm = arm_of(robot)
    used = arm_in_use(arm, calibration)
    result = payload_of(payload, arm)
    shown = None
    if fitted is not None:
        pair = recording_of(arm, fitted[0], "fitted"), recording_of(arm, fitted[1], "fitted")
        shown = payload_validation.validate_runs(pair, used.chain, used.transmission, result, arm=used.known)
    findings = Findings(arm, result, shown)
    return findings if validation is None else _validated(findings, arm, used, validation, tolerance)


def _validated(
    findings: Findings, arm: MeasuredArm, used: ArmInUse, pair: RunPair, tolerance: Tolerance | None
) -> Findings:
    """The findings with the verdict of a pair of runs."""
    require_type("tolerance", tolerance, Tolerance)
    loaded, _ = runs = recording_of(arm, pair[0], "validation"), recording_of(arm, pair[1], "validation")
    judged = payload_validation.validate_runs(
        runs, used.chain, used.transmission, findings.payload, tolerance, arm=used.known
    )
    # a part of a recording that the payload was identified from may be one that was not used
    used_files = findings.payload.provenance.recordings_sha256.values()
    own_run = loaded.source.between_s is None and loaded.source.sha256 in used_files
    fitted = findings.identification
    verified = _scale_verified(used) if fitted is None else fitted.scale_verified
    judged = replace(judged, verdict=replace(judged.verdict, own_run=own_run, scale_verified=verified))
    return replace(findings, validation=judged)


def _taken_in_order(arm: MeasuredArm, run: Recording) -> str | None:
    """What to check if none of the recorded joint names is the arm's; None if the names match or are missing."""
    recorded = run.source.joint_names
    if not recorded or set(recorded) & set(arm.joint_names):
        return None
    return (
        f"None of the recorded joints ({', '.join(recorded)}) is a joint name of {arm.name} "
        f"({', '.join(arm.joint_names)}), so they were used in the recorded order. Check this order, or specify it "
        "with `joints=`."
    )


def payload_of(payload: PayloadSource, arm: MeasuredArm, argument: str = "payload") -> PayloadResult:
    """A payload of an arm, in the flange frame; `argument` is its name in messages if it is not a file."""
    result = payload_from(payload, argument)
    source = str(payload) if isinstance(payload, str | PathLike) else argument
    problem = another_arms(result, arm.chain, arm.name)
    if problem is not None:
        raise PayloadFileError(source, "provenance.robot", result.provenance.robot, problem)
    if result.frame != FLANGE:
        expected = f"expected {FLANGE!r}, the last frame of the robot's kinematics"
        raise PayloadFileError(source, "payload.frame", result.frame, expected)
    return result
