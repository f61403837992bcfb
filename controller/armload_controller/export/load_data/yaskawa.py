"""Yaskawa: a tool preset of the Smart Pendant (.yps), from which the operator fills in a tool.

- weight: mass in kg. On these controllers a tool includes its load.
- com: [x, y, z], centre of mass in mm in the flange frame (from the tool mounting plate).
- moi: [Ixx, Iyy, Izz] in kg m2 about axes through the centre of mass and parallel to the flange's. There are no
  fields for products of inertia: they are omitted.
- offset, orient: the tool centre point in mm and degrees; omitted, for which the pendant uses zero.
- id: together with the version identifies an installed preset; an older export must be deleted on the pendant first.

What is not determined: moi is zero if none of the three moments is determined (the instructions require them only for a
tool that is large compared with the distance of its centre of mass from the flange); the model's moments, marked, if a
part is.

References:
    Yaskawa, Smart Pendant SDK, "Yaskawa Preset Files", sections "General format" and "Tool Presets", and "How to create
        tool presets" (developer.motoman.com): file format, fields, units.
    Yaskawa, Motoman NX100 instructions, section 9.11 "ARM Control", tool load information, p. 9-59: frame of the centre
        of mass, point and axes of the moments, when they are needed.
"""

from __future__ import annotations

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import MOMENTS, complete_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import bracketed, load_data


def export_yaskawa(subject: ExportSubject) -> dict[str, str]:
    """A preset file with one tool."""
    payload = in_makers_flange(subject)
    inertia = complete_inertia(payload, MOMENTS, or_point_mass=True)
    fields = load_data(subject, inertia, mass=payload.model.mass_kg) | {
        "com": bracketed(payload.model.center_of_mass_m * 1e3),
        "moi": bracketed(np.diag(inertia.tensor_kg_m2)),
    }
    return {f"{subject.identifier}_payload.yps": written("load_data/yaskawa", "//", fields)}
