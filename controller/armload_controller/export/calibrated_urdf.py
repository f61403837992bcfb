"""A calibrated arm as URDF: physically possible links with the torque of the identified base parameters.

- Frames: one link per joint, in the joint's frame; the base is tilted as the calibration found it, so that gravity is
  along -z of `world`; a massless link for the flange.
- inertia: tensor elements about the centre of mass in kg m2, ixy = -int xy dm.
- dynamics: viscous and Coulomb friction; values below zero due to noise are written as 0. URDF has no elements for
  rotors or for friction that depends on load or the root of speed: these are listed in a comment.

References:
    ROS wiki, urdf/XML: elements "link", "joint", "dynamics", "limit"; fields, units, frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.export.exported_payload import identifier_of
from armload_controller.export.text_format import ascii_line, exact, exact_numbers, xml_comment
from armload_controller.export.urdf import inertial_lines
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.possible_links import PossibleLinks
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import rpy_rad
from armload_identification.model.payload import InertialParameters


def arm_urdf(robot: Robot, calibration: ArmCalibration, possible: PossibleLinks, made_from: str) -> Mapping[str, str]:
    """The arm without payload.

    Args:
        robot: The arm as configured: kinematics, names and limits.
        possible: Physically possible links for that calibration.
        made_from: The program's version, the calibration's file and its hash, for the comment.

    Returns:
        Text by file name.
    """
    identifier = identifier_of(robot.name)
    names = [quoteattr(ascii_line(name)) for name in robot.joint_names]
    links = [quoteattr(f"{ascii_line(name)}_link") for name in robot.joint_names]
    chain, limits = robot.chain, robot.limits.motion
    rotors = {"Rotors, kg m2 at the joint (armature), row by row:": calibration.body.rotor_mass_kg_m2}
    absent = rotors | further_friction(calibration)
    lines = [
        '<?xml version="1.0"?>',
        *arm_comment(robot, possible, made_from, "URDF", absent),
        f'<robot name="{identifier}">',
    ]
    lines += ['  <link name="world"/>', '  <link name="base"/>']
    lines += _joint('"base_joint"', "fixed", '"world"', '"base"', upright_base(calibration.level(chain).gravity_m_s2))
    for i, (name, parent, child) in enumerate(zip(names, ['"base"', *links[:-1]], links, strict=True)):
        link = inertial_lines(InertialParameters(possible.links[i]))
        lines += [f"  <link name={child}>", *(f"    {line}" for line in link), "  </link>"]
        about = (
            f'<axis xyz="{exact_numbers(chain.axis[i])}"/>',
            f'<limit lower="{exact(limits.position_min_rad[i])}" upper="{exact(limits.position_max_rad[i])}" '
            f'velocity="{exact(limits.velocity_max_rad_s[i])}" effort="{exact(robot.limits.torque_max_nm[i])}"/>',
            f'<dynamics damping="{exact(max(calibration.body.viscous_nm_s_rad[i], 0.0))}" '
            f'friction="{exact(max(calibration.body.coulomb_nm[i], 0.0))}"/>',
        )
        lines += _joint(name, "revolute", parent, child, chain.placement[i], about)
    lines += ['  <link name="flange"/>', *_joint('"flange_joint"', "fixed", links[-1], '"flange"', chain.flange)]
    lines.append("</robot>")
    return {f"{identifier}_calibrated.urdf": "\n".join(lines) + "\n"}


def further_friction(calibration: ArmCalibration) -> dict[str, FloatArray]:
    """The parts of the friction that are neither viscous nor constant, which no description of arms has."""
    body = calibration.body
    return {
        "Friction per torque of the links:": body.load_friction,
        "Friction per root of the speed, N m / sqrt(rad/s):": body.root_nm,
        "Torque reported at no load, N m:": body.offset_nm,
    }


def arm_comment(
    robot: Robot, possible: PossibleLinks, made_from: str, language: str, absent: Mapping[str, FloatArray]
) -> list[str]:
    """The comment: origin of the file, and the values for which the language of the file has no element."""
    if possible.exact:
        fit = "The links resemble rods, and give the torque of the identified base parameters."
    else:
        fit = (
            "No physically possible links have the identified base parameters: these are the nearest, off by "
            f"{possible.off:.2f} standard deviations (RMS), at random states by N m (RMS, joint by joint): "
            f"{exact_numbers(np.round(possible.left_nm, 6))}."
        )
    paragraphs = (
        f"{robot.name} as calibrated, without payload, written by {made_from}.",
        f"{fit} A single link's mass or inertia is not measured; the arm's torque is.",
        f"{language} has no elements for these:",
        *(f"{what} {exact_numbers(np.asarray(values).ravel())}" for what, values in absent.items()),
    )
    return xml_comment(paragraphs)


def upright_base(gravity_m_s2: FloatArray) -> FloatArray:
    """(4, 4) pose of the base in a world with gravity along -z, by the smallest rotation."""
    down = gravity_m_s2 / np.sqrt(np.sum(gravity_m_s2**2))
    pose = np.eye(4)
    if down[2] > 1.0 - 1e-12:
        pose[:3, :3] = np.diag([1.0, -1.0, -1.0])
        return pose
    axis = np.cross(down, [0.0, 0.0, -1.0])
    skew = np.cross(np.eye(3), axis)
    pose[:3, :3] += skew + skew @ skew / (1.0 - down[2])
    return pose


def _joint(name: str, kind: str, parent: str, child: str, pose: FloatArray, about: Iterable[str] = ()) -> list[str]:
    """A joint; names with their quotes."""
    inside = (
        f"<parent link={parent}/>",
        f"<child link={child}/>",
        f'<origin xyz="{exact_numbers(pose[:3, 3])}" rpy="{exact_numbers(rpy_rad(pose[:3, :3]))}"/>',
        *about,
    )
    return [f'  <joint name={name} type="{kind}">', *(f"    {line}" for line in inside), "  </joint>"]
