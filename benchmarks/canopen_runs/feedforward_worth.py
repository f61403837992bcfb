"""What a payload costs a control loop, and how much of that its torque gives back: er50 with 10 kg, prbt with 5 kg.

Arms are simulated without a bus: setpoints and torque offsets once per cycle, one period of each of the robot's
excitations. The error that a payload causes is the joints' true position with it minus that without, on the joints that
carry its weight (a fifth of the greatest gravity torque), and the flange's distance.

- "possible": the true payload's torque along the lagged setpoints, every millisecond, at the best of seven lags. No
  torque that is computed from commanded motion can remove what is left of the error: when a joint breaks away from
  static friction depends on the inertia that the servo moves.
- "fed": as `FeedforwardPlugin` does it, once per cycle at one lag.
- "with friction": and mu (|tau_link + tau_payload| - |tau_link|) by the sign of the commanded speed (`LoadFriction`),
  with the friction of a normative arm.
- "-5 %", "+5 %": all torque constants of the motors are wrong by this.
- "after a change": nothing is fed until half of the period, then it is faded in within 0.2 s; the error of the second
  from then on, compared with nothing fed.

    python -m benchmarks.canopen_runs.feedforward_worth
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armload_controller.config.robot import Robot, load_robot
from armload_controller.session.feedforward_comparison import LOADED_SHARE
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import PlantSpec
from armload_drivers.simulation.servo_loops import INTEGRAL_TIME_S, POSITION_GAIN_1_S
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.regressor import payload_torque
from armload_identification.model.smooth_sign import smooth_sign
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.trials import workers

ARMS = (("er50", "paper"), ("prbt", "block"))
LAG_S = 1.0 / POSITION_GAIN_1_S
LAGS_S = LAG_S + np.array([-0.015, -0.01, -0.005, 0.0, 0.005, 0.01, 0.015])
KEPT = 5
REVERSAL_RAD_S = 0.02
"""Speed at which the commanded direction counts by three quarters, for friction."""
STEP_S, BEGINS_S, SETTLES_S, FADE_S, AFTER_S = 1e-3, 1.0, 0.5, 0.2, 1.0
LOOPS = ((INTEGRAL_TIME_S, "with integral"), (math.inf, "without integral"))


@dataclass(frozen=True)
class Moved:
    """One period: (N, n) positions in rad, and torques of the motors and of the links in N m, every `KEPT` steps."""

    position_rad: FloatArray
    torque_nm: FloatArray
    link_torque_nm: FloatArray


class Trial:
    """One arm, excitation and servo loop."""

    def __init__(self, name: str, payload: str, role: str, twin: Twin, integral_time_s: float) -> None:
        self.robot: Robot = load_robot(name)
        self.cycle_s = 1.0 / self.robot.bus.cycle_hz
        self.path = self.robot.excitations[role].trajectory
        self.every = round(self.cycle_s / STEP_S)
        self.count = round((SETTLES_S + BEGINS_S + self.path.period_s) / STEP_S)
        self.truth = self.robot.simulation.payload(payload)
        body = self.robot.simulation.plant_spec(payload).payload
        start = self._state(np.zeros(1))[0][0]
        self.specs: dict[bool, PlantSpec] = {
            loaded: replace(
                twin_spec(self.robot, twin, body if loaded else None),
                start_position_rad=start,
                integral_time_s=integral_time_s,
                seed=1,
            )
            for loaded in (False, True)
        }
        q = self._lagged(LAG_S)[0]
        still = np.zeros_like(q)
        weight = np.abs(payload_torque(self.robot.chain, self.truth.theta, q, still, still)).max(axis=0)
        self.bearing = weight >= LOADED_SHARE * weight.max()

    def _phase(self, time_s: NDArray[np.floating[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Phase, its rate and its change; the rate rises to 1 within `BEGINS_S`."""
        begun = np.clip((time_s - SETTLES_S) / BEGINS_S, 0.0, None)
        rising = begun < 1.0
        phase = BEGINS_S * np.where(rising, 0.5 * begun**2, begun - 0.5)
        return phase, np.where(rising, begun, 1.0), np.where(rising & (begun > 0.0), 1.0 / BEGINS_S, 0.0)

    def _state(self, time_s: NDArray[np.floating[Any]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(N, n) commanded positions, velocities and accelerations at times."""
        phase, rate, change = self._phase(time_s)
        state = self.path.evaluate(phase)
        speed = state.velocity_rad_s
        return (
            np.asarray(state.position_rad),
            speed * rate[:, None],
            state.acceleration_rad_s2 * rate[:, None] ** 2 + speed * change[:, None],
        )

    def _lagged(self, lag_s: float, every: int = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The commanded motion of a lag ago, at every step or in the middle of every cycle."""
        step = np.arange(self.count) // every * every
        return self._state(np.maximum(step * STEP_S + (0.5 * every * STEP_S - lag_s), 0.0))

    def torque(self, lag_s: float, every: int) -> FloatArray:
        """(N, n) the payload's torque in N m along the lagged setpoints."""
        return payload_torque(self.robot.chain, self.truth.theta, *self._lagged(lag_s, every))

    def load_friction(self, empty: Moved) -> FloatArray:
        """(N, n) the friction that the payload's torque adds, as `LoadFriction` computes it, with the true arm."""
        dq = self._lagged(LAG_S, self.every)[1]
        mu = np.array([joint.load_friction for joint in self.specs[False].joints])
        links = np.repeat(empty.link_torque_nm, KEPT, axis=0)
        links = np.concatenate([np.tile(links[:1], (self.count - len(links), 1)), links])
        more = np.abs(links + self.torque(LAG_S, self.every)) - np.abs(links)
        return np.asarray(mu * smooth_sign(dq, np.full(self.robot.n, REVERSAL_RAD_S)) * more)

    def run(self, fed_nm: FloatArray | None, *, loaded: bool = True, gain_error: float = 0.0) -> Moved:
        """One period with torque offsets (N, n), or without."""
        spec = self.specs[loaded]
        plant = ArmPlant(replace(spec, torque_gain_error=np.full(len(spec.joints), gain_error)))
        n, first = self.robot.n, round((SETTLES_S + BEGINS_S) / STEP_S)
        to_axis = np.linalg.inv(spec.coupling)
        commanded = self._state(np.arange(self.count + self.every) * STEP_S + self.cycle_s)[0] @ to_axis.T
        fed = np.zeros((self.count, n)) if fed_nm is None else fed_nm @ spec.coupling
        for axis in range(n):
            plant.set_powered(axis, True)
        kept: tuple[list[FloatArray], ...] = ([], [], [])
        for step in range(self.count):
            if step % self.every == 0:
                for axis in range(n):
                    plant.set_target(axis, commanded[step, axis], self.cycle_s)
            for axis in range(n):
                plant.set_torque_offset(axis, fed[step, axis])
            plant.advance((step + 1) * STEP_S)
            if step >= first and step % KEPT == 0:
                sample = plant.sample(self.cycle_s)
                kept[0].append(sample.joint_position_rad)
                kept[1].append(sample.joint_torque_nm)
                kept[2].append(sample.link_torque_nm)
        return Moved(*(np.array(rows) for rows in kept))


def _tool_mm(chain: Chain, moved: Moved, empty: Moved) -> float:
    """RMS distance of the flange."""
    pairs = zip(moved.position_rad[::20], empty.position_rad[::20], strict=True)
    away = [chain.forward(one)[-1][:3, 3] - chain.forward(other)[-1][:3, 3] for one, other in pairs]
    return float(1e3 * np.sqrt(np.mean(np.sum(np.square(away), axis=1))))


def measure(name: str, payload: str, role: str, twin: Twin, loop: tuple[float, str]) -> str:
    """One block of the table."""
    trial = Trial(name, payload, role, twin, loop[0])
    chain, bearing = trial.robot.chain, trial.bearing
    empty, loaded = trial.run(None, loaded=False), trial.run(None)
    possible = [trial.run(trial.torque(lag_s, 1)) for lag_s in LAGS_S]
    torque = trial.torque(LAG_S, trial.every)
    late = torque * np.clip((np.arange(trial.count) - 0.5 * trial.count) * STEP_S / FADE_S, 0.0, 1.0)[:, None]
    change = slice(
        *(
            round((0.5 * trial.count * STEP_S + after - SETTLES_S - BEGINS_S) / STEP_S / KEPT)
            for after in (0.0, AFTER_S)
        )
    )

    def error(moved: Moved, rows: slice = slice(None), against: Moved = empty) -> float:
        away = (moved.position_rad - against.position_rad)[rows][:, bearing]
        return float(1e3 * np.sqrt(np.mean(away**2)))

    def less(moved: Moved, rows: slice = slice(None)) -> str:
        return f"{100.0 * (1.0 - error(moved, rows) / error(loaded, rows)):4.0f} %"

    best = min(possible, key=error)
    fed = trial.run(torque)
    shares = {
        "possible": less(best),
        "fed": less(fed),
        "fed/possible": f"{100.0 * (error(loaded) - error(fed)) / (error(loaded) - error(best)):4.0f} %",
        "with friction": less(trial.run(torque + trial.load_friction(empty))),
        "-5 %": f"{100.0 * (1.0 - error(trial.run(torque, gain_error=-0.05)) / error(loaded)):4.0f} %",
        "+5 %": f"{100.0 * (1.0 - error(trial.run(torque, gain_error=0.05)) / error(loaded)):4.0f} %",
        "after a change": less(trial.run(late), change),
    }
    more_nm = np.sqrt(np.mean(loaded.torque_nm**2, axis=0)) - np.sqrt(np.mean(empty.torque_nm**2, axis=0))
    most = int(np.argmax(more_nm))
    current = ""
    if trial.robot.drives.settings.drives[most].feedback is EffortFeedback.CURRENT:
        current = f" {more_nm[most] / trial.robot.drives.transmission.gain_nm_a[most]:+.2f} A"
    tool = [_tool_mm(chain, moved, empty) for moved in (loaded, fed)]
    costs = (
        f"error {error(loaded):6.3f} mrad, tool {tool[0]:5.2f} mm, fed {tool[1]:5.2f}, "
        f"joint {most + 1} {more_nm[most]:+6.1f} N m{current}"
    )
    given = "  ".join(f"{key} {value}" for key, value in shares.items())
    return f"{name} {role:14s} {twin.value:9s} {loop[1]:16s} | {costs} | {given}"


def run() -> None:
    """Print the table."""
    print("RMS over a period and the joints that carry the weight; shares of the error that the payload causes")
    jobs = [
        (name, payload, role, twin, loop)
        for name, payload in ARMS
        for role in ("identification", "validation")
        for twin in (Twin.NORMATIVE, Twin.HARSH)
        for loop in LOOPS
    ]
    with workers() as pool:
        for text in pool.map(_block, jobs):
            print("  " + text, flush=True)


def _block(job: tuple[str, str, str, Twin, tuple[float, str]]) -> str:
    """The block of one job."""
    return measure(*job)


if __name__ == "__main__":
    run()
