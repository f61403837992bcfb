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
from armload_controller.export.text_format import exact, heading


def export_franka(subject: ExportSubject) -> dict[str, str]:
    """A C++ header with the arguments of `setLoad`, and the JSON for Desk."""
    payload = in_makers_flange(subject)
    body, inertia = payload.model, complete_inertia(payload, TENSOR)
    center = [float(c) for c in body.center_of_mass_m]
    columns = [float(element) for element in inertia.tensor_kg_m2.T.ravel()]
    name = f"armload_{subject.identifier}"
    lines = heading(
        subject,
        "load_mass: kg. F_x_Cload: centre of mass in m from the flange. load_inertia: kg m2 about the centre of mass "
        "in the flange's axes, column by column, products as tensor elements (Ixy = -int xy dm).",
        inertia.statement,
        "//",
        "No limits of the numbers are stated in: Franka Robotics, libfranka, Robot::setLoad; RIDE documentation, End "
        "effector commissioning (endeffector-config.json).",
        "Use setLoad for what is grasped, or endeffector-config.json for what is mounted (pack it into an archive and "
        "upload that in the settings, end effector); never both for the same body.",
    )
    lines += [
        "#pragma once",
        "",
        "#include <array>",
        "",
        f"namespace {name} {{",
        f"constexpr double load_mass = {exact(body.mass_kg)};",
        f"constexpr std::array<double, 3> F_x_Cload{{{{{', '.join(exact(c) for c in center)}}}}};",
        f"constexpr std::array<double, 9> load_inertia{{{{{', '.join(exact(element) for element in columns)}}}}};",
        f"}}  // namespace {name}: robot.setLoad({name}::load_mass, {name}::F_x_Cload, {name}::load_inertia);",
    ]
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
        f"{subject.identifier}_franka_load.hpp": "\n".join(lines) + "\n",
        "endeffector-config.json": json.dumps(desk, indent=2) + "\n",
    }
