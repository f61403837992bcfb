"""A calibrated arm as MJCF for MuJoCo: physically possible links, rotors, viscous damping and dry friction.

    M(q) + armature, damping * dq and the links' torque are armload's to rounding (`mj_inverse`)

- One body per joint, in the joint's frame; the base is tilted as the calibration found it, with gravity along -z.
- armature: rotors, at the joint in kg m2. A motor that turns several joints is a fixed tendon with an armature; its
  length is the motor's angle, a row of the inverse coupling.
- damping: viscous friction in N m s/rad. frictionloss: Coulomb friction in N m, for MuJoCo a soft constraint: near
  standstill it creeps. Values below zero due to noise are written as 0.
- Friction that depends on load or on the root of the speed, and torque at no load, have no element: a comment lists
  them.

References:
    MuJoCo documentation, XML reference: body/joint (armature, damping, frictionloss, actuatorfrcrange), tendon/fixed
        (armature), body/inertial. google-deepmind/mujoco issue 1131: the friction of a real joint in these terms.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.export.calibrated_urdf import arm_comment, further_friction, upright_base
from armload_controller.export.exported_payload import identifier_of
from armload_controller.export.mjcf import mjcf_inertial
from armload_controller.export.text_format import ascii_line, exact, exact_numbers
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.possible_links import PossibleLinks
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters


def arm_mjcf(robot: Robot, calibration: ArmCalibration, possible: PossibleLinks, made_from: str) -> Mapping[str, str]:
    """The arm without payload.

    Args:
        robot: The arm as configured: kinematics, names and limits.
        possible: Physically possible links for that calibration.
        made_from: The program's version, the calibration's file and its hash, for the comment.

    Returns:
        Text by file name.
    """
    identifier = identifier_of(robot.name)
    chain, limits, body = robot.chain, robot.limits.motion, calibration.body
    gravity_m_s2 = calibration.level(chain).gravity_m_s2
    names = [ascii_line(name) for name in robot.joint_names]
    armature, tendons = _rotors(body.rotor_inertia_kg_m2, body.coupling, names)
    lines = [
        *arm_comment(robot, possible, made_from, "MJCF", further_friction(calibration)),
        f'<mujoco model="{identifier}">',
        '  <compiler angle="radian" autolimits="true"/>',
        f'  <option gravity="0 0 {exact(-float(np.sqrt(np.sum(gravity_m_s2**2))))}"/>',
        "  <worldbody>",
        f'    <body name="base" {_pose_attributes(upright_base(gravity_m_s2))}>',
    ]
    for i, name in enumerate(names):
        indent = "  " * (i + 3)
        torque_nm = exact(robot.limits.torque_max_nm[i])
        lines += [
            f"{indent}<body name={quoteattr(f'{name}_link')} {_pose_attributes(chain.placement[i])}>",
            f"{indent}  {mjcf_inertial(InertialParameters(possible.links[i]))}",
            f'{indent}  <joint name={quoteattr(name)} axis="{exact_numbers(chain.axis[i])}" '
            f'range="{exact(limits.position_min_rad[i])} {exact(limits.position_max_rad[i])}" '
            f'actuatorfrcrange="-{torque_nm} {torque_nm}" armature="{exact(armature[i])}" '
            f'damping="{exact(max(body.viscous_nm_s_rad[i], 0.0))}" '
            f'frictionloss="{exact(max(body.coulomb_nm[i], 0.0))}"/>',
        ]
    lines.append(f'{"  " * (len(names) + 3)}<site name="flange" {_pose_attributes(chain.flange)}/>')
    lines += [f"{'  ' * (i + 3)}</body>" for i in reversed(range(len(names)))]
    lines += ["    </body>", "  </worldbody>", *tendons, "</mujoco>"]
    return {f"{identifier}_calibrated.xml": "\n".join(lines) + "\n"}


def _rotors(inertia_kg_m2: FloatArray, coupling: FloatArray, names: list[str]) -> tuple[FloatArray, list[str]]:
    """(n,) armature of the joints, and the lines of tendons for motors that turn several joints."""
    armature, tendons = np.zeros(len(names)), []
    for motor, row in enumerate(np.linalg.inv(coupling)):
        turned = np.flatnonzero(np.abs(row) > 1e-12)
        if len(turned) == 1:
            armature[turned[0]] += max(inertia_kg_m2[motor], 0.0) * row[turned[0]] ** 2
            continue
        tendons.append(f'    <fixed name="motor_{motor + 1}" armature="{exact(max(inertia_kg_m2[motor], 0.0))}">')
        tendons += [f'      <joint joint={quoteattr(names[j])} coef="{exact(row[j])}"/>' for j in turned]
        tendons.append("    </fixed>")
    return armature, ["  <tendon>", *tendons, "  </tendon>"] if tendons else []


def _pose_attributes(pose: FloatArray) -> str:
    """Position and axes of a body in its parent."""
    return f'pos="{exact_numbers(pose[:3, 3])}" xyaxes="{exact_numbers(pose[:3, :2].T.ravel())}"'
