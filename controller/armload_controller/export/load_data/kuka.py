"""KUKA: LOAD_DATA, the payload of a tool on a KR C controller.

    LOAD_DATA[n]={M mass,CM {X,Y,Z,A,B,C},J {X,Y,Z}}

- M: mass in kg.
- CM X, Y, Z: centre of mass in mm in the FLANGE frame.
- CM A, B, C: orientation of the principal axes of inertia in the FLANGE frame in degrees: A about z, then B about the
  new y, then C about the new x, so R = Rz(A) Ry(B) Rx(C).
- J X, Y, Z: moments of inertia in kg m2 about those principal axes through the centre of mass, never negative; there
  are no products.

What is not determined: no public page was found that defines a zero J as a point mass, so the complete model is written
and marked.

References:
    KUKA, MA KR IONTEC V4, 11.05.2021, section 4 "Technical data", fig. 4-5 "Load center of gravity and mass moment of
        inertia": units, frame, order of A, B, C, principal axes.
    Beckhoff, TF5120 TwinCAT 3 Robotics mxAutomation, "Writing load data" (KRC_WriteLoadData): the fields of a tool's
        payload and that centre of mass and principal axes are relative to the flange.
"""

from __future__ import annotations

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia, principal_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import load_data
from armload_identification.model.chain import rpy_rad


def export_kuka(subject: ExportSubject) -> dict[str, str]:
    """LOAD_DATA for $config.dat."""
    payload = in_makers_flange(subject)
    inertia = complete_inertia(payload, TENSOR)
    principal_kg_m2, rotation = principal_inertia(inertia.tensor_kg_m2)
    numbers = {"mass": payload.model.mass_kg} | dict(zip("xyz", payload.model.center_of_mass_m * 1e3, strict=True))
    numbers |= zip("abc", np.degrees(rpy_rad(rotation)[::-1]), strict=True)
    numbers |= zip(("jx", "jy", "jz"), principal_kg_m2, strict=True)
    text = written("load_data/kuka", ";", load_data(subject, inertia, **numbers))
    return {f"{subject.identifier}_kuka_load_data.txt": text}
