"""FANUC: the numbers for the screen MOTION / PAYLOAD SET, to be entered by hand.

- PAYLOAD: mass in kg.
- PAYLOAD CENTER X, Y, Z: centre of mass in cm from the centre of the faceplate; with the wrist at zero x is up, y to
  the right seen from behind the faceplate, z out of it.
- PAYLOAD INERTIA X, Y, Z: moments of inertia in kgf cm s2 about axes through the centre of mass and parallel to the
  faceplate's; 1 kgf cm s2 = 0.0980665 kg m2. The screen has no fields for products of inertia: they are omitted.

Reliability: the first two are from the vendor's manual as published by an integrator. Unit and reference point of the
inertia are from users who compared the screen with the vendor's payload checker, not from the manual itself; so the
text asks the user to compare the units with those on the screen.

What is not determined: zero, the screen's factory setting, if none of the three moments is determined; the model's
moments, marked, if a part is.

References:
    Lincoln Electric, online help on the robot payload, table 2 "MOTION/PAYLOAD SET Screen Items": names of the fields,
        units and axes of mass and centre.
    robot-forum.com, thread 37725, "Inertia units: Payload Checker vs Robot (kg*m*s^2 vs kg*cm*s^2)": unit and
        reference point of the inertia.
    industrialmonitordirect.com, "FANUC R-30iA Automatic Payload Calculation Setup Guide": no inertia as delivered.
"""

from __future__ import annotations

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import MOMENTS, complete_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import load_data

KG_M2_PER_KGF_CM_S2 = 0.0980665
"""Standard gravity, 9.80665 m/s2, times 0.01 m."""


def export_fanuc(subject: ExportSubject) -> dict[str, str]:
    """The lines of the payload screen."""
    payload = in_makers_flange(subject)
    inertia = complete_inertia(payload, MOMENTS, or_point_mass=True)
    numbers = {"mass": payload.model.mass_kg} | dict(zip("xyz", payload.model.center_of_mass_m * 1e2, strict=True))
    numbers |= zip(("ix", "iy", "iz"), np.diag(inertia.tensor_kg_m2) / KG_M2_PER_KGF_CM_S2, strict=True)
    text = written("load_data/fanuc", "#", load_data(subject, inertia, **numbers))
    return {f"{subject.identifier}_fanuc_payload.txt": text}
