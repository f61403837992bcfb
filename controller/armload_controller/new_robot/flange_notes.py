"""What a chosen flange means for the load data of robot controllers, which have z along the last joint's axis."""

from __future__ import annotations

import numpy as np

from armload_controller.config.chain_from_urdf import STANDARD_FLANGES, UrdfArm, read_urdf_arm
from armload_controller.control_errors import ConfigurationError
from armload_controller.export.load_data.makers_flange import angles_text, has_makers_axes
from armload_identification.model.chain import rpy_rad


def flange_notes(arm: UrdfArm) -> list[str]:
    """Notes on a flange whose z is not the last joint's axis; with the rotation to a standard flange that has it."""
    if has_makers_axes(arm.chain):
        return []
    note = (
        f"the axes of {arm.flange} are not those of robot controllers, which have z along the last joint's axis, out "
        "of the arm: `armload export` of load data will require --flange-rpy-rad"
    )
    for name in STANDARD_FLANGES:
        try:
            other = read_urdf_arm(arm.file, arm.base, name)
        except ConfigurationError:
            continue
        if other.joint_names == arm.joint_names and has_makers_axes(other.chain):
            rotation = (np.linalg.inv(arm.chain.flange) @ other.chain.flange)[:3, :3]
            return [f"{note} {angles_text(rpy_rad(rotation))}, the axes of {name}; or choose --flange {name}"]
    return [note]
