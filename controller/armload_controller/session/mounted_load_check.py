"""What the arm carries in a slow round, before it runs at full speed: nothing unloaded, more than before loaded.

If a mistake in the robot's file explains the torques of the unloaded slow round better than a load, it is named.

Unloaded, the arm's own torque is that of its calibration, or of `[body]`; without either nothing is compared. Loaded,
the same path's slow round in the unloaded run is the reference.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import orjson
from mcap.reader import make_reader

from armload_controller.analysis.arm_in_use import ArmInUse
from armload_controller.config.robot import Robot
from armload_controller.cycle.slow_round_torque import SURE, SlowRoundRows
from armload_controller.motion.phase import Segment
from armload_identification.float_array import FloatArray
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.recording.run_format import TOPIC

BODY_DEVIATION = 0.1
"""Relative standard deviation of the torque of a `[body]`, which is a maker's or a draft. Twice as much: a third of the
rated payload goes unnoticed on prbt; half as much: a wrong body is reported as a load."""


def unloaded_doubts(robot: Robot, arm: ArmInUse, rows: SlowRoundRows) -> list[str]:
    """Warnings for the operator if the flange is not empty, or the file is wrong."""
    found = rows.fitted(robot.joint_names, arm.chain, arm.transmission)
    if found is None or (arm.calibration is None and robot.tables.body is None):
        return []
    body = robot.strength.arm_body if arm.calibration is None else arm.calibration.body

    def gravity(position: FloatArray, gravity_m_s2: FloatArray) -> FloatArray:
        still = np.zeros_like(position)
        chain = replace(arm.chain, gravity_m_s2=gravity_m_s2)
        return ArmDynamics(chain, body).link_torque(position, still, still)

    of_gains = np.sqrt(np.diag(arm.transmission.covariance))
    deviation = np.hypot(of_gains, BODY_DEVIATION if arm.calibration is None else 0.0)
    explanations = [each.text for each in found.of_empty_arm(gravity, deviation).explanations()]
    if explanations and explanations[0]:
        or_load = ["something is on the flange"] if "" in explanations else []
        return [f"the weight of the arm is not as expected. {'; or '.join([*filter(None, explanations), *or_load])}"]
    mass = found.carried(gravity(found.position_rad, arm.chain.gravity_m_s2), deviation)
    if mass.kg < SURE * mass.error_kg:
        return []
    return [
        f"the arm carries {mass.kg:.1f} +- {2.0 * mass.error_kg:.1f} kg in this unloaded run. What is on the flange "
        "now will not be part of the payload"
    ]


def loaded_doubts(robot: Robot, arm: ArmInUse, unloaded: Path, rows: SlowRoundRows) -> list[str]:
    """Warnings for the operator if the flange carries no more than in the unloaded run.

    Args:
        arm: Its model.
        unloaded: Recording of the same path without the payload.
    """
    both = recorded_slow_round(unloaded, rows.cycle_s), rows
    before, now = (each.fitted(robot.joint_names, arm.chain, arm.transmission) for each in both)
    if before is None or now is None:
        return []
    added, expected = now.added_since(before), robot.tables.expected_payload
    if added.kg > SURE * added.error_kg or (expected is not None and expected.mass_kg < added.greatest_kg):
        return []
    return [
        f"the arm carries the same as before, or at most {added.greatest_kg:.1f} kg more than in the unloaded run. Is "
        "the payload mounted?"
    ]


def recorded_slow_round(path: Path, cycle_s: float) -> SlowRoundRows:
    """The slow round in the recording of a run with cycles of `cycle_s`."""
    rows = SlowRoundRows(cycle_s)
    with path.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=[TOPIC]):
            row = orjson.loads(message.data)
            if row["segment"] == Segment.SLOW:
                torque, current = (np.array(row[key]) if key in row else None for key in ("torque_nm", "current_a"))
                rows.add(np.array(row["position_rad"]), torque, current)
    return rows
