"""A simulated twin of a new arm: drives on the virtual bus, and a `[simulation]` of its links with assumed friction.

All numbers except the links' are assumed: it shows what a commissioning looks like, not how the arm behaves.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from armload_controller.new_robot.arm_draft import ArmDraft
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import TENSOR_ELEMENTS, InertialParameters, tensor_elements
from armload_identification.storage.toml_text import value

COUNTS_PER_TURN: Final = 2**20
PEAK_OF_RATED: Final = 3
"""Ratio of greatest to rated torque."""
ROTOR_SHARE: Final = 0.05
"""Share of a joint's greatest torque that its rotor requires at the greatest acceleration."""
LOAD_FRICTION: Final = 0.05
LAG_S: Final = 0.05
FOLLOWING_ERROR_RAD: Final = 0.2
"""Least window of the following error; a fast joint's lag needs more."""


def twin_bus(name: str) -> list[str]:
    """Lines of `[bus]` for a bus inside the process."""
    return ["[bus]", 'interface = "virtual"  # no real bus', f"channel = {value(f'armload-{name}')}"]


def twin_drive(arm: ArmDraft, joint: int) -> list[str]:
    """Lines of `[joints.drive]`.

    Args:
        joint: Index of the joint, from 0.
    """
    window_rad = max(FOLLOWING_ERROR_RAD, 1.2 * LAG_S * arm.velocity_max_rad_s[joint])
    return [
        "[joints.drive]  # simulated",
        f"node_id = {joint + 1}",
        'mode = "csp"',
        'feedback = "torque"',
        f"counts_per_axis_turn = {COUNTS_PER_TURN}",
        f"rated_torque_nm = {value(arm.torque_max_nm[joint] / PEAK_OF_RATED)}",
        f"max_torque_permille = {1000 * PEAK_OF_RATED}",
        f"following_error_rad = {value(round(window_rad, 4))}",
        f"following_lag_s = {LAG_S}",
        "has_brake = true",
    ]


def twin_simulation(
    arm: ArmDraft,
    links: Sequence[InertialParameters],
    payload: InertialParameters,
    start_rad: FloatArray,
    friction_nm: Sequence[float],
    acceleration_rad_s2: FloatArray,
) -> list[str]:
    """Lines of `[simulation]`.

    Args:
        links: The body moved by each joint.
        payload: The payload on the flange.
        start_rad: (n,) initial pose.
        friction_nm: Coulomb friction of each joint.
        acceleration_rad_s2: (n,) greatest acceleration.
    """
    lines = [
        "# The simulated arm: the true parameters, which the identification must find and never reads. The links are",
        "# the URDF's, everything else is assumed.",
        "[simulation]",
        "seed = 1",
        'payload = "cube"',
        f"start_position_rad = {value(np.round(start_rad, 4) + 0.0)}",
        "",
        "[simulation.payloads.cube]",
        *body_lines(payload),
        "",
    ]
    for joint, link in enumerate(links):
        rotor = ROTOR_SHARE * arm.torque_max_nm[joint] / acceleration_rad_s2[joint]
        viscous = max(float(np.nan_to_num(arm.viscous_nm_s_rad[joint], nan=0.0)), 0.0)
        lines += [
            "[[simulation.joints]]",
            f"link = {{ {', '.join(body_lines(link))} }}",
            f"reflected_rotor_inertia_kg_m2 = {value(round(rotor, 6))}",
            f"coulomb_nm = {value(friction_nm[joint])}",
            f"viscous_nm_s_rad = {value(viscous)}",
            f"stribeck_nm = {value(round(0.2 * friction_nm[joint], 6))}",
            "stribeck_velocity_rad_s = 0.02",
            f"load_friction = {LOAD_FRICTION}",
            "torque_ripple_nm = 0.0",
            "ripple_per_motor_turn = 2",
            "",
        ]
    return lines


def body_lines(body: InertialParameters) -> list[str]:
    """Keys of a rigid body: mass, centre of mass, inertia about it."""
    inertia = np.round(tensor_elements(body.inertia_about_com), 9) + 0.0
    return [
        f"mass_kg = {value(round(body.mass_kg, 6))}",
        f"center_of_mass_m = {value(np.round(body.center_of_mass_m, 6) + 0.0)}",
        f"inertia_kg_m2 = {value(dict(zip(TENSOR_ELEMENTS, inertia.tolist(), strict=True)))}",
    ]
