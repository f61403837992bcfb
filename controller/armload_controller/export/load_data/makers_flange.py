"""The flange frame in which a maker's controller takes load data: z is the last joint's axis and points out of the arm.

    p_maker = R^T p,   I_maker = R^T I R,   R = Rz(yaw) Ry(pitch) Rx(roll) of `ExportSubject.flange_rpy_rad`

This holds for every maker here: UR's tool flange, KUKA's FLANGE, ABB's tool0, FANUC's faceplate, Yaskawa's tool
mounting plate, Franka's flange. A configuration's flange may have other axes: x of `ee_link` and `flange` of many URDFs
points out of the flange. Load data in such axes would turn the arm the wrong way; they are refused. The axis, its
direction, and whether the origin is on it follow from the kinematics. The directions of x and y do not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from armload_controller.control_errors import ExportError
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import QUARTER_TURNS
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain, pose_from_xyz_rpy, rpy_rad
from armload_identification.model.payload import PayloadResult, symmetric_tensor, tensor_elements

AXIS_TOLERANCE_RAD = 1e-3
"""Angle between z and the joint's axis that rounded numbers of a file may cause; it moves a centre of mass by 1e-3."""
PLACE_TOLERANCE_M = 1e-3
"""Distances below this decide nothing: of the flange from the axis, and from the wrist along the axis."""
_ROUNDED = 1e-4
"""Rotations this close to quarter turns are quarter turns whose angles were typed with four digits or more."""
_FLANGE_AXIS = np.array([0.0, 0.0, 1.0])


def in_makers_flange(subject: ExportSubject) -> PayloadResult:
    """The payload in the maker's flange frame.

    A rotated element counts as determined if everything that enters it is.

    Raises:
        ExportError: that frame's z is not the last joint's axis out of the arm, or its origin is not on that axis.
    """
    rotation = _rotation(subject.flange_rpy_rad)
    _require_makers(subject, rotation)
    payload, pose = subject.payload, np.eye(4)
    pose[:3, :3] = rotation.T
    enters = np.abs(_turn_of_values(rotation.T)) > 1e-9
    determined = np.array([bool(np.all(payload.determined[row])) for row in enters])
    nothing = np.full((10, 2), np.nan)
    return replace(
        payload, model=payload.model.transformed(pose), determined=determined, interval_95=nothing, mass_center=None
    )


def outward_axis(chain: Chain) -> tuple[FloatArray, bool]:
    """The last joint's axis in the flange frame, and whether its direction out of the arm is known.

    Out is from the wrist, the point of the last axis nearest to the one before, to the flange.

    Returns:
        (3,) unit vector, out of the arm if that is known; and whether it is.
    """
    own, along_m = chain.flange[:3, :3].T @ chain.axis[-1], 0.0
    if chain.n > 1:
        start, turn = chain.placement[-1, :3, 3], chain.placement[-1, :3, :3]
        before, axis = chain.axis[-2], turn @ chain.axis[-1]
        normal = np.cross(before, axis)
        if float(normal @ normal) > 1e-6:
            wrist = start + axis * float(np.cross(start, before) @ normal) / float(normal @ normal)
            along_m = float((start + turn @ chain.flange[:3, 3] - wrist) @ axis)
    known = abs(along_m) > PLACE_TOLERANCE_M
    return (-own if known and along_m < 0.0 else own), known


def has_makers_axes(chain: Chain) -> bool:
    """Whether the flange's z is the last joint's axis out of the arm, as far as the kinematics tell."""
    return _is_out(*outward_axis(chain))


def _is_out(axis: FloatArray, known: bool) -> bool:
    """Whether an axis is z; if its direction is not known, whether it is z or -z."""
    shown = axis if known else axis * np.sign(axis[2] or 1.0)
    return bool(np.sqrt(np.sum((shown - _FLANGE_AXIS) ** 2)) <= AXIS_TOLERANCE_RAD)


def _require_makers(subject: ExportSubject, rotation: FloatArray) -> None:
    """Refuse a frame that is not the maker's."""
    chain = subject.chain
    own, known = outward_axis(chain)
    place = chain.flange[:3, 3]
    beside_m = float(np.sqrt(np.sum((place - chain.axis[-1] * (place @ chain.axis[-1])) ** 2)))
    if beside_m > PLACE_TOLERANCE_M:
        raise ExportError(
            subject.payload_file,
            f"the flange of {subject.robot}'s configuration lies {beside_m * 1e3:.1f} mm beside the last joint's axis, "
            "so it is a tool's frame, not the robot's flange. Identify the payload with the flange's own link "
            "(`armload init --flange`, or [kinematics] flange)",
        )
    if _is_out(rotation.T @ own, known):
        return
    turned = (
        "" if subject.flange_rpy_rad is None else f", turned by `flange_rpy_rad=` {angles_text(subject.flange_rpy_rad)}"
    )
    choices = [turn for turn in QUARTER_TURNS if _is_out(turn.T @ own, known)]
    listed = "; ".join(f"{angles_text(rpy_rad(turn))} (x along {_axis_name(turn[:, 0])})" for turn in choices)
    remedy = (
        f"its choices here: {listed}. Which one is the controller's x: see the fixed joint from this frame to tool0 in "
        "the URDF, or the controller's manual"
        if choices
        else "roll, pitch and yaw of the controller's flange in this frame"
    )
    raise ExportError(
        subject.payload_file,
        f"the last joint's axis, out of the arm, is {_vector(own)}{'' if known else f' or {_vector(-own)}'} in the "
        f"flange frame of {subject.robot}'s configuration{turned}"
        f"{'' if known else ', whose kinematics do not tell which'}; the controller's flange has it along z, "
        "(0, 0, 1), so the centre of mass would be written along wrong axes. Give `flange_rpy_rad=`, roll, pitch and "
        f"yaw; {remedy}",
    )


def _rotation(rpy: tuple[float, float, float] | None) -> FloatArray:
    """(3, 3) the maker's flange in the configuration's; quarter turns exact."""
    rotation = pose_from_xyz_rpy((0.0, 0.0, 0.0), rpy or (0.0, 0.0, 0.0))[:3, :3]
    whole = np.round(rotation)
    return whole if np.abs(rotation - whole).max() < _ROUNDED else rotation


def _turn_of_values(turn: FloatArray) -> FloatArray:
    """(10, 10) how mass, centre of mass and tensor elements in turned axes depend on those before."""
    matrix = np.zeros((10, 10))
    matrix[0, 0] = 1.0
    matrix[1:4, 1:4] = turn
    for k, element in enumerate(np.eye(6)):
        matrix[4:, 4 + k] = tensor_elements(turn @ symmetric_tensor(element) @ turn.T)
    return matrix


def angles_text(rpy: tuple[float, float, float] | FloatArray) -> str:
    """Roll, pitch and yaw as on a command line."""
    return " ".join(f"{angle + 0.0:.6g}" for angle in np.round(rpy, 6))


def _vector(values: FloatArray) -> str:
    """(0, 0, 1)."""
    return f"({', '.join(f'{value:.4g}' for value in np.round(values, 9) + 0.0)})"


def _axis_name(direction: FloatArray) -> str:
    """x, -x, y, ... of a direction along an axis."""
    at = int(np.argmax(np.abs(direction)))
    return f"{'-' if direction[at] < 0.0 else ''}{'xyz'[at]}"
