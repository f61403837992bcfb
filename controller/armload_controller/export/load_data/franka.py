"""Franka: the arguments of libfranka's `setLoad`, and the end effector's configuration that Desk imports.

    setLoad(load_mass, F_x_Cload, load_inertia)

- load_mass: mass in kg.
- F_x_Cload: centre of mass in m from the flange, in the flange's axes.
- load_inertia: 3 x 3 tensor in kg m2 about the centre of mass in the flange's axes, column by column; it is
  symmetric. Products are tensor elements, Ixy = -int xy dm.
- `endeffector-config.json`: id, name, color, mass, centerOfMass, transformation (16 numbers, column by column, from the
  flange; here the identity) and inertia (9 numbers, column by column). Settings take it inside an archive, with an id
  that is a URI reference and does not begin with "ee-".

`setLoad` is for what an end effector grasps, Desk's end effector for what is mounted. What was mounted between the
empty and the loaded run is one of them, never both.

What is not determined: no public page defines a zero inertia as a point mass, so the complete model is written and
marked; in the JSON, which has no comments, by the header file beside it.

References:
    Franka Robotics, libfranka, `Robot::setLoad` and `RobotState::I_load`, `F_x_Cload`: arguments, frames, units.
    Franka Robotics, RIDE documentation, "End effector commissioning": fields of `endeffector-config.json`.
"""

from __future__ import annotations

import json

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import exact, load_data


def export_franka(subject: ExportSubject) -> dict[str, str]:
    """A C++ header with the arguments of `setLoad`, and the JSON for Desk."""
    payload = in_makers_flange(subject)
    body, inertia = payload.model, complete_inertia(payload, TENSOR)
    center = [float(c) for c in body.center_of_mass_m]
    columns = [float(element) for element in inertia.tensor_kg_m2.T.ravel()]
    name = f"armload_{subject.identifier}"
    fields = load_data(subject, inertia) | {
        "exact_mass": exact(body.mass_kg),
        "center": ", ".join(map(exact, center)),
        "columns": ", ".join(map(exact, columns)),
    }
    identity = [float(i % 5 == 0) for i in range(16)]
    desk = {
        "id": name.replace("_", "-"),
        "name": f"armload {subject.identifier}",
        "color": "#808080",
        "mass": body.mass_kg,
        "centerOfMass": center,
        "transformation": identity,
        "inertia": columns,
    }
    return {
        f"{subject.identifier}_franka_load.hpp": written("load_data/franka", "//", fields),
        "endeffector-config.json": json.dumps(desk, indent=2) + "\n",
    }
