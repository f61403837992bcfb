"""Recordings: the common type for all sources.

Time stamps are used as recorded; no interval is assumed. Invalid rows are dropped and counted by reason in
`RecordingSource.reasons`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.numerals import counted
from armload_identification.recording.garbage_rows import GarbageFilter
from armload_identification.recording.joint_names import JointNames
from armload_identification.recording.reduction.repeated_values import RepeatedValues
from armload_identification.recording.row_block import QUANTITIES, RowBlock, hash_of, joined, require_shapes
from armload_identification.recording.run_format import RUN_ATTACHMENT


@dataclass(frozen=True)
class RecordingSource:
    """Source of a recording, and the rows dropped from it.

    Attributes:
        path: The file, or the name of a recording that was made from arrays.
        sha256: Hash of the file, or of the arrays.
        kind: Name of the format, such as "mcap" or "csv"; "arrays" without a file.
        rows_read: Number of rows found, valid or not.
        reasons: Number of rows dropped, by reason.
        attachments: Text of the attachments by name.
        truncated: Whether the file ends in the middle of a record; everything before was read.
        joint_names: Names of the joints in the order of the columns; empty if the recording does not name them.
        ignored_joints: Names of joints in the file that the arm does not have.
        between_s: Times since the first row between which rows were used; None for the whole recording.
        remarks: What was concluded while it was read, for the user to check.
    """

    path: Path
    sha256: str
    kind: str
    rows_read: int
    reasons: Mapping[str, int]
    attachments: Mapping[str, str] = field(default_factory=dict)
    truncated: bool = False
    joint_names: tuple[str, ...] = ()
    ignored_joints: tuple[str, ...] = ()
    between_s: tuple[float, float] | None = None
    remarks: tuple[str, ...] = ()

    @property
    def rows_dropped(self) -> int:
        """Number of rows dropped."""
        return sum(self.reasons.values())

    def run(self) -> dict[str, Any]:
        """The `run.json` attachment; empty without one.

        Raises:
            RecordingError: it is not a JSON object.
        """
        try:
            run = json.loads(self.attachments.get(RUN_ATTACHMENT, "{}"))
        except (ValueError, RecursionError) as error:
            run = error
        if not isinstance(run, dict):
            raise RecordingError(
                f"{self.path}: the attachment {RUN_ATTACHMENT} is damaged, expected a JSON object. "
                "Copy the file again from where it was recorded."
            )
        return run


@dataclass(frozen=True, eq=False)
class PeriodAverage:
    """Statistics of a long periodic run that was reduced to its average period while it was read.

    Attributes:
        periods: Number of averaged periods, M.
        effort_covariance: (n, n) covariance of ONE raw sample between periods: of motor currents in A2, or of joint
            torques in N2 m2; None if too few samples repeat.
        interruptions: How often the run was paused or slowed down within its periods.
    """

    periods: int
    effort_covariance: FloatArray | None
    interruptions: int = 0


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Recording(RowBlock):
    """One run of an arm with strictly increasing time stamps and current or torque; prints as one line.

    A long run is reduced while it is read: to its average period if it follows an excitation, else to means over 10 ms.
    Information about the raw rows is then in `average` and `repeats`.

    Attributes:
        excitation: The trajectory that was streamed, or None.
        source: The file or arrays.
        average: Statistics of the averaged periods; None unless the rows are the average period.
        repeats: Longest repetitions of a value in the raw rows; None if the rows are the raw rows.

    Examples:
        >>> import armload
        >>> print(armload.read_recording("runs/today/loaded_identification.mcap", between_s=(0.0, 5.0)))
        runs/today/loaded_identification.mcap: 6 joints, 5 s, 251 rows of time_s, position_rad, current_a, phase_s
    """

    excitation: Excitation | None = None
    source: RecordingSource
    average: PeriodAverage | None = None
    repeats: RepeatedValues | None = None

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of the columns; empty if the recording does not name them."""
        return self.source.joint_names

    def __repr__(self) -> str:
        """File, joints, duration, rows, and the quantities recorded."""
        source, average = self.source, self.average
        lasts_s = float(self.time_s[-1] - self.time_s[0]) if self.size else 0.0
        notes = [f"{source.rows_dropped} of {source.rows_read} left out"] if source.rows_dropped else []
        if average is not None:
            notes.append(f"average of {average.periods} periods")
        elif self.repeats is not None:
            notes.append("means over short times")
        noted = f" ({', '.join(notes)})" if notes else ""
        recorded = ", ".join(name for name in QUANTITIES if getattr(self, name) is not None)
        return f"{source.path}: {counted(self.n, 'joint')}, {lasts_s:.4g} s, {self.size} rows{noted} of {recorded}"

    def joints(self, chosen: Sequence[int]) -> Recording:
        """The same run with some of its joints, in a given order.

        Args:
            chosen: Columns, starting at 0.
        """
        columns = np.array(chosen, dtype=np.intp)
        kept = self.each(lambda values: values[:, columns] if values.ndim > 1 else values)
        average, repeats, excitation = self.average, self.repeats, self.excitation
        if average is not None and average.effort_covariance is not None:
            average = replace(average, effort_covariance=average.effort_covariance[np.ix_(columns, columns)])
        if repeats is not None:
            repeats = repeats.joints(columns)
        if excitation is not None:
            series = excitation.trajectory
            part = {name: getattr(series, name)[columns] for name in ("offset_rad", "sin_rad", "cos_rad")}
            excitation = replace(excitation, trajectory=replace(series, **part))
        source = self.source
        if source.joint_names:
            source = replace(source, joint_names=tuple(source.joint_names[column] for column in columns))
        return replace(kept, average=average, repeats=repeats, excitation=excitation, source=source)

    def named_joints(self, names: Sequence[str]) -> Recording:
        """The same run with only the joints of these names, in this order.

        Args:
            names: Names of the wanted joints, base first; the recording may have them with another prefix or separator.

        Raises:
            RecordingError: the recording does not name its joints, or lacks one of these.
        """
        if not self.joint_names:
            raise RecordingError(
                f"{self.source.path}: the recording does not name its joints, so they cannot be matched by name. "
                "Put them in the order of the arm, or give a recording with joint names."
            )
        places = JointNames(names).places(self.joint_names)
        absent = [name for joint, name in enumerate(names) if joint not in places]
        if absent:
            raise RecordingError(
                f"{self.source.path}: no joint named {', '.join(absent)}; the recording has "
                f"{', '.join(self.joint_names)}. Use a recording and a description of the same arm."
            )
        ignored = tuple(name for place, name in enumerate(self.joint_names) if place not in places.values())
        run = self.joints([places[joint] for joint in range(len(names))])
        source = replace(run.source, joint_names=tuple(names), ignored_joints=self.source.ignored_joints + ignored)
        return replace(run, source=source)

    @classmethod
    def from_arrays(
        cls,
        time_s: ArrayLike,
        position_rad: ArrayLike,
        *,
        torque_nm: ArrayLike | None = None,
        current_a: ArrayLike | None = None,
        velocity_rad_s: ArrayLike | None = None,
        phase_s: ArrayLike | None = None,
        excitation: Excitation | None = None,
        joint_names: Sequence[str] = (),
        name: str = "arrays",
    ) -> Recording:
        """A recording from arrays, cleaned as a file would be.

        Args:
            time_s: (N,) time stamps in s.
            position_rad: (N, n) joint positions in rad.
            torque_nm: (N, n) JOINT torques in N m; these or currents are required.
            current_a: (N, n) MOTOR currents in A.
            velocity_rad_s: (N, n) joint velocities in rad/s, used only to check the units of the positions.
            phase_s: (N,) phase along `excitation`, NaN outside its whole periods.
            excitation: The trajectory that was streamed.
            joint_names: Names of the n joints in the order of the columns, if known.
            name: Name of the recording in messages and provenance.

        Returns:
            The recording; its hash is that of the arrays.

        Raises:
            RecordingError: arrays of inconsistent shapes, neither torque nor current, wrong units, or too few usable
                rows.

        Examples:
            >>> import armload, numpy as np
            >>> time_s = np.arange(0.0, 10.0, 0.01)
            >>> position_rad = np.sin(np.outer(time_s, [1.0, 2.0]))
            >>> run = armload.Recording.from_arrays(time_s, position_rad, torque_nm=5.0 * np.cos(position_rad))
            >>> run.n, run.source.rows_dropped
            (2, 0)
        """
        values = time_s, position_rad, velocity_rad_s, current_a, torque_nm, phase_s
        given = zip(QUANTITIES, values, strict=True)
        arrays = {key: np.array(value, dtype=np.float64) for key, value in given if value is not None}
        require_shapes(name, arrays)
        if (phase_s is None) != (excitation is None):
            raise RecordingError(f"{name}: phase_s and excitation belong together; give both or neither")
        n, names = arrays["position_rad"].shape[1], tuple(joint_names)
        if names and len(set(names)) != n:
            raise RecordingError(f"{name}: joint_names has {', '.join(names)}; expected {n} different names")
        rows = RowBlock(**arrays)
        garbage = GarbageFilter(Path(name))
        kept = joined(list(garbage.valid([rows])))
        garbage.require_enough(kept.size, rows.size, {})
        reasons = dict(garbage.reasons)
        source = RecordingSource(Path(name), hash_of(arrays), "arrays", rows.size, reasons, joint_names=names)
        return cls(**vars(kept), excitation=excitation, source=source)


def check_joints(recording: Recording, n: int) -> None:
    """Raise if a recording has another number of joints than the arm.

    Raises:
        RecordingError: naming file, found and expected number of joints.
    """
    if recording.n != n:
        raise RecordingError(
            f"{recording.source.path}: the recording has {recording.n} joints, the robot {n}. Use a recording and a "
            "configuration of the same arm."
        )


def hashes_by_name(sources: Sequence[RecordingSource]) -> dict[str, str]:
    """Hash by file name, with the folder or the hash in front if several have the same name."""
    names = [source.path.name for source in sources]
    folders = [f"{source.path.parent.name}/{source.path.name}" for source in sources]
    named = [f"{source.sha256[:8]} {source.path.name}" for source in sources]
    unique = next((each for each in (names, folders) if len(set(each)) == len(each)), named)
    return {name: source.sha256 for name, source in zip(unique, sources, strict=True)}
