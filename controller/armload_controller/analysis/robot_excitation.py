"""Design an excitation for a configured arm: within its limits, clear of obstacles, at a period its bus can stream."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from math import ceil, floor, inf
from multiprocessing import get_context
from operator import itemgetter
from os import PathLike
from pathlib import Path
from typing import Any, Final, Literal

from armload_controller.config.objects_or_paths import robot_of
from armload_controller.config.robot import Robot, shipped_robots
from armload_controller.control_errors import ControlError
from armload_controller.motion.paths import bound_phase
from armload_controller.motion.setpoints import CYCLE_ROUNDING
from armload_controller.motion.slow_round_pace import PLANNED_SPEED_M_S, SLOW_RATE, reduced_pace
from armload_identification.argument_types import require_type, wrong_type
from armload_identification.excitation.design import DesignResult, optimal_excitation
from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.design_search import PeriodRange, Search, SearchSettings, SlowRound
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.information import named_criterion
from armload_identification.extras import Extra, require_extra
from armload_identification.results.json_document import json_document

POSITION_MARGIN_RAD: Final = 0.1
"""Margin to the position limits, for the ramps and the servo."""
RATE_SHARE: Final = 0.7
"""Share of speed, acceleration and jerk limits that the excitation uses; the phase ramps need the rest."""
TORQUE_SHARE: Final = 0.8
"""Share of the torque limits that arm and heaviest payload use; the rest is for ramps and model errors."""
_SHORTEST_PERIOD_S: Final = 2.0
_LONGEST_PERIOD_S: Final = 20.0
"""Range in which an automatic period is chosen."""
_PERIOD_STEP_S: Final = 0.1
"""Step of automatically chosen periods, rounded up to whole bus cycles."""
_MEASURED_S: Final = 30.0
"""Measured time of a run if no number of periods is given."""
_LEAST_PERIODS: Final = 3
"""Fewer do not show the scatter between periods."""
_LEAST_CYCLES: Final = 10
"""Minimum number of setpoints per period of the highest harmonic."""
_PICTURE_DPI: Final = 150


class UnstreamablePeriod(ControlError):
    """A period that is not a positive duration, or that setpoints at the bus's rate cannot follow."""


class DesignedMotion(ABC):
    """A designed motion of an arm, to save and draw.

    Attributes:
        arm: The arm it was designed for.
        envelope: The limits it was designed within.
    """

    arm: Robot
    envelope: Envelope

    def save(self, path: str | PathLike[str]) -> None:
        """Write the excitation file, which a robot's `[excitation]` may name; an existing file is replaced."""
        write_excitation(Path(path), self._excitation(Path(path).name))

    def picture(self, path: str | PathLike[str]) -> None:
        """Draw the motion, its limits and its design on one page, .png, .svg or .pdf.

        Raises:
            ReportError: the file cannot be written.
        """
        require_extra(Extra.REPORT, "the picture of an excitation")
        from armload_identification.report.figures.figure_file import write_figure
        from armload_identification.report.figures.path_figure import path_figure

        excitation = self._excitation(Path(path).name)
        write_figure(Path(path), path_figure(excitation, self.envelope, self.arm.joint_names), _PICTURE_DPI)

    @property
    def robot_argument(self) -> str:
        """The arm as an argument of `armload`: a shipped robot's name, or the path of its file."""
        name = self.arm.file.removesuffix(".toml")
        return name if name in shipped_robots() else self.arm.file

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The figures as numbers, texts, lists and dictionaries."""

    @abstractmethod
    def _excitation(self, output: str) -> Excitation:
        """The motion with its design, for a file of that name."""


@dataclass(frozen=True, eq=False)
class DesignedExcitation(DesignedMotion):
    """A designed excitation and its figures; prints as three lines.

    Attributes:
        arm: The arm it was designed for.
        result: Trajectory, criterion and margin to every limit.
        envelope: The limits it was designed within.
        periods: Number of periods that a run records.
        options: Options of `armload design` that reproduce it, without the output.
    """

    arm: Robot
    result: DesignResult
    envelope: Envelope
    periods: int
    options: str

    def nearest(self) -> dict[str, tuple[str, float]]:
        """The smallest margin to every kind of limit: joint or pair of bodies, and the margin in the key's unit."""
        room, names = self.result.margins, self.arm.joint_names
        of_joints = ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "torque_nm")
        named = {key: dict(zip(names, getattr(room, key).tolist(), strict=True)) for key in of_joints}
        named |= {"clearance_m": dict(room.clearance_m), "speed_m_s": dict(room.speed_m_s)}
        return {key: min(values.items(), key=itemgetter(1)) for key, values in named.items() if values}

    @cached_property
    def speed_m_s(self) -> float:
        """Greatest speed of any point of the arm at full rate."""
        return float(self.arm.limits.points.greatest_on(self.result.trajectory).max())

    @cached_property
    def slow_round_s(self) -> float:
        """Duration of the preceding slow round, at reduced speed."""
        path = self.result.trajectory
        bounds = bound_phase(path, self.arm.limits.motion)
        return reduced_pace(path, bounds, self.arm.motion_constraints.reduced_speed)[0].pace.lasts_s

    def to_dict(self) -> dict[str, Any]:
        """The figures as numbers, texts, lists and dictionaries: the schema `armload/design/1`."""
        result, path = self.result, self.result.trajectory
        found = {"robot": self.arm.name, "criterion": result.criterion, "rank": int(result.rank), "seed": result.seed}
        found |= {key: float(getattr(result, key)) for key in ("cost", "condition_number")}
        motion = {"period_s": float(path.period_s), "periods": self.periods, "harmonics": int(path.harmonics)}
        run = {"speed_m_s": self.speed_m_s, "slow_round_s": self.slow_round_s}
        nearest = {key: {"name": name, "room": room} for key, (name, room) in self.nearest().items()}
        return json_document("design", found | motion | run | {"nearest": nearest})

    def __str__(self) -> str:
        """Figures, and the smallest margin to every kind of limit."""
        words = {
            "position_rad": ("range ", "rad"),
            "velocity_rad_s": ("speed ", "rad/s"),
            "acceleration_rad_s2": ("acceleration ", "rad/s2"),
            "torque_nm": ("torque ", "N m"),
            "clearance_m": ("", "m"),
            "speed_m_s": ("", "m/s"),
        }
        nearest = [f"{name} {words[key][0]}{room:.3g} {words[key][1]}" for key, (name, room) in self.nearest().items()]
        result = self.result
        text = (
            f"{result.criterion} cost {result.cost:.4g}, cond(Phi) {result.condition_number:.3g}, {result.rank} of 10 "
            f"parameters can be determined, {self.periods} periods of {result.trajectory.period_s:g} s\n"
            f"always within every limit; nearest: {', '.join(nearest)}\n"
            f"no point of the arm is faster than {self.speed_m_s:.2f} m/s; the slow round takes "
            f"{self.slow_round_s:.0f} s at {PLANNED_SPEED_M_S:.3f} m/s at most, with what the arm carries"
        )
        return "\n".join((text, *self.arm.payloads.assumed_envelopes))

    def _excitation(self, output: str) -> Excitation:
        command = f"armload design {self.robot_argument} --output {output} {self.options}"
        return self.result.excitation(self.periods, command, version("armload"))


@dataclass(frozen=True)
class DesignSearch:
    """How the best excitation is searched.

    Attributes:
        seed: Seed of the random starts; the same seed gives the same excitation.
        restarts: Number of random starts; the best result is used.
        criterion: What is optimal, one of `information.CRITERIA`.

    Examples:
        >>> import armload
        >>> few_starts = armload.DesignSearch(restarts=3, criterion="condition-number")
        >>> armload.design("prbt", harmonics=2, period_s=5.0, search=few_starts).result.criterion
        'condition-number'
    """

    seed: int = 1
    restarts: int = 8
    criterion: str = "a-optimal"


_DEFAULT_SEARCH: Final = DesignSearch()


def design(
    robot: Robot | str | PathLike[str],
    *,
    harmonics: int = 5,
    period_s: float | Literal["auto"] = 5.0,
    periods: int | None = None,
    search: DesignSearch = _DEFAULT_SEARCH,
    progress: Callable[[int], None] | None = None,
) -> DesignedExcitation:
    """Design an excitation for a robot's expected payload, within all limits and clear of all obstacles at any time.

    It gives the most information in the time of a run with its slow round (condition number: in that of a period).

    Several starts run in separate processes, so a calling program needs the usual guard `if __name__ == "__main__":`.

    Args:
        robot: The arm: a robot, the name of a shipped one, or the path of its TOML.
        harmonics: Harmonics of the Fourier series.
        period_s: Duration of one period; "auto" chooses the fastest that torque, following error and rates allow.
        periods: Periods that a run records; by default 30 s and at least three.
        search: Seed and number of random starts, and the criterion.
        progress: Called with the number of starts completed.

    Returns:
        The excitation, to print, save and draw.

    Raises:
        ConfigurationError: the robot's file lacks data that a design needs. UnstreamablePeriod: the bus cannot stream
            such a period.
        ExcitationError: no start found an excitation within the limits.

    Examples:
        >>> import armload
        >>> excitation = armload.design("prbt", harmonics=2, period_s=5.0, search=armload.DesignSearch(restarts=1))
        >>> excitation.result.rank
        10
        >>> excitation.save("excitation.toml")
    """
    require_extra(Extra.IDENTIFY, "designing an excitation")
    require_type("search", search, DesignSearch)
    arm = robot_of(robot)
    allowed = _allowed_periods(arm, period_s, harmonics)
    envelope = design_envelope(arm)
    objective = named_criterion(
        search.criterion, arm.chain, arm.limits.torque_noise_nm, arm.payloads.expected, arm.payloads.design_set
    )
    # A condition number, unlike a variance, does not fall with the measuring time.
    in_time = search.criterion != "condition-number"
    measured_s = _MEASURED_S if periods is None or isinstance(period_s, str) else periods * period_s
    slow = SlowRound(arm.motion_constraints.reduced_speed, SLOW_RATE, measured_s) if in_time else None
    with _workers(search.restarts) as executor:
        result = optimal_excitation(
            objective,
            envelope,
            SearchSettings(harmonics, allowed, search.seed, search.restarts, slow),
            executor=executor,
            progress=progress or (lambda _finished: None),
            objection=arm.obstacles.objection,
        )
    driven = periods or max(_LEAST_PERIODS, ceil(_MEASURED_S / result.trajectory.period_s - 1e-9))
    period = period_s if isinstance(period_s, str) else f"{period_s:g}"
    options = (
        f"--seed {search.seed} --restarts {search.restarts} --harmonics {harmonics} --period-s {period} "
        f"--periods {driven} --criterion {search.criterion}"
    )
    return DesignedExcitation(arm, result, envelope, driven, options)


def design_envelope(robot: Robot) -> Envelope:
    """The limits for designing an excitation: the robot's, less the margins for ramps, servos and model errors.

    Raises:
        ConfigurationError: the robot's file lacks data that a design needs.
        ExcitationError: nothing is left of a range.
    """
    return robot.envelope(POSITION_MARGIN_RAD, RATE_SHARE, TORQUE_SHARE)


@contextmanager
def _workers(restarts: int) -> Iterator[Executor | None]:
    """One process per core; none for a single start."""
    cores = min(restarts, len(os.sched_getaffinity(0)))
    if cores == 1:
        yield None
        return
    # Processes that are forked from one that has loaded what they need: loading it in each took a sixth of an `init`.
    context = get_context("forkserver")
    context.set_forkserver_preload([Search.__module__, "scipy.optimize"])
    with ProcessPoolExecutor(cores, mp_context=context) as executor:
        yield executor


def _allowed_periods(arm: Robot, period_s: float | Literal["auto"], harmonics: int) -> PeriodRange:
    """The periods to choose from, such that the arm's bus can stream them."""
    if period_s == "auto":
        cycle_s = 1 / arm.bus.cycle_hz
        step_s = ceil(_PERIOD_STEP_S / cycle_s - 1e-9) * cycle_s
        shortest_s = max(_SHORTEST_PERIOD_S, ceil(harmonics * _LEAST_CYCLES * cycle_s / step_s - 1e-9) * step_s)
        return PeriodRange(shortest_s, _LONGEST_PERIOD_S, step_s)
    if isinstance(period_s, str):
        raise wrong_type("period_s", period_s, 'a duration in s, or "auto"')
    if not 0.0 < period_s < inf:
        raise UnstreamablePeriod(f"a period of {period_s:g} s: expected a duration above 0")
    if arm.has_bus:
        _require_streamable(period_s, harmonics, arm.bus.cycle_hz)
    return PeriodRange(period_s, period_s, period_s)


def _require_streamable(period_s: float, harmonics: int, cycle_hz: float) -> None:
    """Refuse a period that setpoints at the bus's rate cannot follow."""
    cycles = period_s * cycle_hz
    if abs(cycles - round(cycles)) > CYCLE_ROUNDING:
        near = [whole / cycle_hz for whole in (floor(cycles), ceil(cycles)) if whole > 0]
        raise UnstreamablePeriod(
            f"a period of {period_s:g} s is {cycles:.3f} cycles at {cycle_hz:g} Hz, expected a whole number: "
            f"give {' or '.join(f'{s:g}' for s in near)}"
        )
    if cycles < _LEAST_CYCLES * harmonics:
        raise UnstreamablePeriod(
            f"harmonic {harmonics} of {period_s:g} s has {cycles / harmonics:.1f} setpoints per period at {cycle_hz:g} "
            f"Hz, at least {_LEAST_CYCLES} are required: give `period_s=` {_LEAST_CYCLES * harmonics / cycle_hz:g} or "
            "more, or fewer `harmonics=`"
        )
