"""The predicted course of an axis, from its setpoints or from the ramp of a stop, and whether it has left it.

An axis whose encoder, commutation or loop has failed moves otherwise than it is commanded, and a stop by its own loop
makes it worse: only removal of its torque and its brake end the motion. It has left its course if

    its speed lies outside        [lo - m, hi + m]       m = MARGIN_SHARE of its greatest speed
    it stops dead                 while its setpoints go on
    it stands                     while its setpoints move away, or while the drive applies its greatest torque
    it goes the wrong way         while its setpoints go one way

where lo and hi are the least and greatest speed of the setpoints of late,

    hi <- max(w, w + (hi - w) exp(-T / RECALL_S))        w: present speed of the setpoints      T: time since the last

which covers any loop that follows its setpoints as a first-order lag of up to `RECALL_S`. During a stop by the drive's
own ramp lo and hi remain for `RECALL_S`, and then fall to zero at `RAMP_SHARE` of the axis's acceleration limit.

Positions are counts of the drive; a sign of the polarity cancels.
"""

from __future__ import annotations

import math

from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.driver_errors import CommandError, LoopLost

RECALL_S = 0.1
"""Twice the lag of usual position loops (gain 20 to 25 1/s). Twice as much: a fault below full speed is noticed later;
half as much: loops with a gain below 15 1/s would be stopped."""
MARGIN_SHARE = 0.2
"""Share of the greatest speed. Healthy axes of the simulated arms, normative and harsh, use at most 0.1 (stick-slip of
prbt's joint 6), others 0.02."""
RAMP_SHARE = 0.25
"""A quick stop may be this much slower than the acceleration that paths may use: gravity and the torque limit take
their part. Twice as much: an arm at its torque limit could lose its torque in motion."""
SUDDEN_FACTOR = 4.0
"""An axis has stopped dead if it loses its speed between two samples, and had lost less than this part of it between
the two before. Healthy: below 2 at speeds that count."""
GOES_ON_SHARE = 0.25
"""Its setpoints must go on, at this share of its speed."""
STANDS_COUNTS = 8
"""A speed of fewer counts a sample may look like a standstill."""
STANDS_SAMPLES = 2
"""Samples without a change after which an axis stands."""
PUSHES_SAMPLES = 3
PUSHES_SHARE, RISES_SHARE = 0.9, 0.2
"""An axis is pushed with its greatest torque if its effort is above the first share of the limit for so many samples,
and has risen by the second since it stands: holding a load at a torque limit is no fault."""
PUSHES_FROM_REST_S = 0.06
"""If it came to rest, and did not stop dead: for so long, because static friction can require the greatest torque.
Healthy: 28 ms (harsh er50 with a tenth of torque to spare)."""
STUCK_SHARE = 0.4
"""An axis is stuck if its setpoints move on by this share of the following error window. Healthy: 0.14 (prbt's joint 6,
held by friction at a reversal)."""
AGAINST_SHARE, AGAINST_RAD = 0.5, 0.01
"""An axis goes the wrong way if it moves against its setpoints by this share of their way, if that is so long."""
APART_SHARE = 0.2
"""It must then also be this share of the following error window away from its target."""
SUSPECT_RAD = 1e-3
"""An axis whose torque is unexpected stands if its setpoints have moved by this distance without it."""
WINDOW_S = 0.4
"""An axis with a wide following error window: its greatest speed for this time is the window."""
ROUNDED = 1.0 + 1e-6
"""A step at greatest speed may be this much greater by rounding."""
LATE = 1.5
"""After so many cycles without a setpoint or feedback, setpoints have stood still in between."""


class AxisCourse:
    """The course of one axis while its drive carries torque.

    Args:
        counts_per_rad: Position units per radian.
        speed_rad_s: Greatest speed.
        acceleration_rad_s2: Greatest acceleration of paths.
        window_rad: Following error window.
        effort_limit: Greatest effort, in units of the reported effort; inf if unknown.
        cycle_s: Time between setpoints.

    Attributes:
        lost: Why the axis has left its course, as text; empty while it has not.
        step: Greatest distance between two setpoints, in counts.
    """

    def __init__(
        self,
        counts_per_rad: float,
        speed_rad_s: float,
        acceleration_rad_s2: float,
        *,
        window_rad: float,
        effort_limit: float,
        cycle_s: float,
    ) -> None:
        self._per_rad = abs(counts_per_rad)
        self._cycle_s = cycle_s
        self._decay = math.exp(-cycle_s / RECALL_S)
        self._margin = MARGIN_SHARE * speed_rad_s * self._per_rad
        self.step = ROUNDED * speed_rad_s * cycle_s * self._per_rad + 1.0
        self._acceleration = acceleration_rad_s2 * self._per_rad
        self._window = min(window_rad, speed_rad_s * WINDOW_S) * self._per_rad
        self._effort_limit = effort_limit
        self.begin(0)

    def too_far(self, joint: str, way: int) -> CommandError:
        """The error for a setpoint further than `step` from the last one."""
        return CommandError(
            f"{joint}: the setpoint is {abs(way) / self._per_rad:.4f} rad from the last one, in one cycle at most "
            f"{self.step / self._per_rad:.4f} rad are possible (velocity_max_rad_s); nothing was sent"
        )

    def begin(self, counts: int) -> None:
        """Begin at standstill.

        Args:
            counts: Its position, and its target.
        """
        self.lost = ""
        self._counts = self._target = counts
        self._speed = self._before = self._hi = self._lo = self._dies_down_s = 0.0
        self._dead_speed = self._due = self._stood_with = 0.0
        self._stands = self._pushed = self._way = self._direction = 0
        self._patience = PUSHES_SAMPLES
        self._sudden = self._ramping = False
        self._from_target = self._from_counts = counts

    def slow_down(self) -> None:
        """From now on the drive slows down on its own ramp. Idempotent."""
        if not self._ramping:
            self._ramping, self._sudden = True, self._sudden and self._way > self._due
            self._hi, self._lo, self._dies_down_s = max(self._hi, 0.0), min(self._lo, 0.0), RECALL_S

    def suspect(self) -> None:
        """The torque or following error of the axis is unexpected: it has left its course if its position stands."""
        if self._stands >= STANDS_SAMPLES and self._way > SUSPECT_RAD * self._per_rad:
            self.leave(
                "the position does not change by a single count while its setpoints move and its torque or following "
                "error is not as expected"
            )

    def leave(self, why: str) -> None:
        """Note why the axis has left its course; the first reason counts."""
        self.lost = self.lost or why

    def follow(self, target: int, counts: int, effort: int, elapsed_s: float, longest_s: float = 0.0) -> None:
        """Judge one feedback.

        Args:
            target: Target position of the last setpoint.
            counts: Actual position.
            effort: Actual effort, in its units.
            elapsed_s: Time since the last feedback.
            longest_s: The longest that it may have been; 0 if it is known.
        """
        if elapsed_s < self._cycle_s:  # noqa: PLR1730 - faster than max
            elapsed_s = self._cycle_s
        hi, lo, wanted = self._hi, self._lo, 0
        if self._ramping:
            hi, lo = self._ramp(elapsed_s)
        else:
            wanted = target - self._target
            self._target = target
            commanded = wanted / elapsed_s
            if elapsed_s > LATE * self._cycle_s:
                hi, lo = max(hi, 0.0), min(lo, 0.0)
            decay = self._decay
            hi = commanded if commanded >= hi else commanded + (hi - commanded) * decay
            lo = commanded if commanded <= lo else commanded + (lo - commanded) * decay
            direction = self._direction
            if wanted * direction <= 0:
                self._direction, self._from_target, self._from_counts = (wanted > 0) - (wanted < 0), target, counts
            elif (counts - self._from_counts) * direction < 0:
                self._judge_direction(target, counts)
        self._hi, self._lo = hi, lo
        speed = (counts - self._counts) / (longest_s or elapsed_s)
        if not lo - self._margin <= speed <= hi + self._margin:
            self.leave(
                f"the position moves at {speed / self._per_rad:.2f} rad/s, between {lo / self._per_rad:.2f} and "
                f"{hi / self._per_rad:.2f} rad/s are commanded"
            )
        if counts == self._counts:
            self._way += abs(wanted)
            self._judge_standing(effort, elapsed_s)
        elif self._stands:
            self._stands = self._pushed = self._way = 0
        self._counts, self._before, self._speed = counts, self._speed, speed

    def _judge_direction(self, target: int, counts: int) -> None:
        """Judge an axis that is now behind where its setpoints began to go one way."""
        way, moved = abs(target - self._from_target), abs(counts - self._from_counts)
        apart = abs(target - counts) > APART_SHARE * self._window
        if way > AGAINST_RAD * self._per_rad and moved > AGAINST_SHARE * way and apart:
            self.leave(
                f"the position moved by {moved / self._per_rad:.3f} rad against its setpoints, which moved by "
                f"{way / self._per_rad:.3f} rad"
            )

    def _ramp(self, elapsed_s: float) -> tuple[float, float]:
        """Let hi and lo fall to zero."""
        if self._dies_down_s > 0.0:
            self._dies_down_s -= elapsed_s
            return self._hi, self._lo
        slower = RAMP_SHARE * self._acceleration * elapsed_s
        return max(self._hi - slower, 0.0), min(self._lo + slower, 0.0)

    def _judge_standing(self, effort: int, elapsed_s: float) -> None:
        """Judge a position that has not changed."""
        self._stands += 1
        if self._stands == 1:
            last, slowing = abs(self._speed), abs(self._speed - self._before)
            came_to_rest = last <= SUDDEN_FACTOR * slowing or last * self._cycle_s < STANDS_COUNTS
            # An axis may lose its acceleration limit times a cycle between two samples, however it moved before.
            fast = max(self._acceleration * self._cycle_s, STANDS_COUNTS / self._cycle_s)
            self._sudden = not self._ramping and last > fast and not came_to_rest
            self._dead_speed, self._due = GOES_ON_SHARE * last, 0.0
            self._stood_with = abs(effort)
            self._patience = math.ceil(PUSHES_FROM_REST_S / self._cycle_s) if came_to_rest else PUSHES_SAMPLES
        self._due += self._dead_speed * elapsed_s
        limit, rise = self._effort_limit, abs(effort) - self._stood_with
        pushes = abs(effort) >= PUSHES_SHARE * limit and rise >= RISES_SHARE * limit
        self._pushed = self._pushed + 1 if pushes else 0
        if self._sudden and self._stands >= STANDS_SAMPLES and (self._ramping or self._way > self._due):
            self.leave("the position has stopped dead, and does not change by a single count")
        elif self._pushed >= self._patience and (self._way or self._ramping):
            self.leave("the position does not change by a single count while the drive applies its greatest torque")
        elif self._way > STUCK_SHARE * self._window:
            self.leave(
                "the position has not changed by a single count while its setpoints moved by "
                f"{self._way / self._per_rad:.3f} rad"
            )


def axis_courses(arm: ArmSettings, units: ArmUnits) -> list[AxisCourse]:
    """The courses of an arm's axes.

    Args:
        arm: The arm; every drive with its scale.
    """
    courses = []
    for axis, (drive, scale) in enumerate(zip(arm.drives, units.axes, strict=True)):
        speed, acceleration = units.rates(axis)
        limit = drive.max_torque_permille * scale.torque_nm_per_permille * scale.effort_units_per_nm
        courses.append(
            AxisCourse(
                scale.counts_per_rad,
                speed,
                acceleration,
                window_rad=drive.following_error_rad,
                effort_limit=math.inf if math.isnan(limit) else abs(limit),
                cycle_s=arm.cycle_s,
            )
        )
    return courses


def loop_lost(drive: DriveSettings, step: str, why: str) -> LoopLost:
    """Error for an axis that has left its course.

    Args:
        step: The step in progress.
        why: `AxisCourse.lost`.
    """
    brake = "its brake engages" if drive.has_brake else "it has no brake (has_brake) and falls"
    return LoopLost(
        drive.node_id,
        drive.joint,
        step,
        f"{why}: the axis has left its predicted course. Its torque is removed at once, {brake}",
        "Check its encoder, encoder cable, direction (607E) and brake",
    )
