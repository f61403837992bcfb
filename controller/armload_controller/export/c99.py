"""C99 and C++17: the payload's torque for a control loop, as straight-line code for one arm.

    tau = J(q)^T w(q, dq, ddq, theta)

`straight_line` generates from chain and payload: torque, torque at rest, and the regressor of any payload at the
flange. These functions have no loop, branch or state, allocate nothing, and need only sin and cos from math.h. Around
them: a payload that can be changed while the loop runs (blended without a step and within a rate, refused if physically
impossible), a self-test, a C++ class and a CMake package. The texts are the templates of `c_code`.

- q, dq, ddq in rad, rad/s, rad/s2 and torques in N m, all at the JOINTS, in the configuration's order and directions.
- A torque is positive along the joint's positive direction: the torque that the joint must provide for the payload.
- theta in kg, kg m, kg m2, inertia as tensor elements (Ixy = -int xy dm) about the ORIGIN of the flange.

What is not determined: the torque needs all ten parameters, so the complete model is written, as used by the
feed-forward, and marked.

References:
    Chen 2016, eq. (2).
    ISO/IEC 9899:1999.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from armload_controller.cycle.torque_gate import FULL_SWING_S
from armload_controller.export.c_code.change_rate import change_rate
from armload_controller.export.c_code.estimator_source import estimator_texts
from armload_controller.export.c_code.rounding import SinglePrecisionError, single_precision_error
from armload_controller.export.c_code.self_test import VECTORS, self_test
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.straight_line.arm_functions import (
    AT_REST,
    Function,
    any_torque,
    into_own,
    link_torque_of,
    regressor_of,
    torque_of,
)
from armload_controller.export.straight_line.c_function import c_statements
from armload_controller.export.straight_line.planar_groups import planar_groups
from armload_controller.export.straight_line.precision import Precision
from armload_controller.export.template import filled, written
from armload_controller.export.text_format import c_heading, comment, exact, provenance, spdx
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.recording.reading_options import Effort

_SELF_TEST_SHARE = 1e-12
"""Difference that the self-test allows in double precision, as a share of the greatest torque in its vectors."""
_PIVOTS = {
    Precision.DOUBLE: {"negative": 1e-9, "vanishing": 1e-12, "beside": 1e-6},
    Precision.SINGLE: {"negative": 1e-4, "vanishing": 1e-5, "beside": 1e-2},
}
"""Shares of the greatest parameter: below minus the first a pivot is negative, below the second it is zero, and entries
beside a zero pivot must be below the third."""
_EFFORT = {Effort.CURRENT: "A of motor current", Effort.TORQUE: "N m of reported torque"}
"""What the drives of a calibrated arm report, with its unit."""


def export_c(subject: ExportSubject, precision: Precision = Precision.DOUBLE) -> dict[str, str]:
    """The package `armload_<robot>`: C header and source, C++ header, and a CMake file.

    Args:
        subject: The payload and the arm; for a calibrated arm, the payload's friction and the recursive estimator,
            always in double precision, are written too.
        precision: Precision of all numbers.

    Returns:
        Texts by file name.
    """
    name = f"armload_{subject.identifier}"
    error = single_precision_error(subject) if precision is Precision.SINGLE else None
    fields = {
        "name": name,
        "GUARD": name.upper(),
        "n": str(subject.chain.n),
        "real": str(precision),
        "f": precision.suffix,
        "robot_sha256": subject.robot_sha256,
        "payload_sha256": subject.payload_sha256,
        "swing": exact(FULL_SWING_S),
        "vectors": str(VECTORS),
        "version": ".".join(re.findall(r"\d+", subject.armload_version)[:3]),
    }
    fields |= {key: precision.literal(value) for key, value in _PIVOTS[precision].items()}
    fields |= _numbers(subject, precision, error) | _functions(subject, precision)
    fields |= _friction(subject, precision, fields)
    about = [
        provenance(subject),
        f"The robot's file: sha256 {subject.robot_sha256}.",
        _payload_text(subject),
        complete_inertia(subject.payload, TENSOR).statement,
    ]
    about += [
        f"Calibration of the arm: {file}, sha256 {sha256}." for file, sha256 in subject.calibration_sha256.items()
    ]
    about += [] if error is None else [error.statement]
    texts = {}
    fields |= {"sources": f"{name}.c", "headers": f"{name}.h {name}.hpp"}
    if subject.calibration is not None and subject.estimator is not None:
        effort = _EFFORT[subject.calibration.effort]
        body = subject.calibration.body
        texts = estimator_texts(name, c_heading(subject, about), subject.chain, body, subject.estimator, effort)
        fields |= {"sources": f"{name}.c {name}_estimator.c", "headers": f"{name}.h {name}.hpp {name}_estimator.h"}
    source = [*about[:2], f"C99; needs math.h. Written by a generator; see {name}.h."]
    return texts | {
        f"{name}.h": filled(
            "c_code/payload.h", fields | {"about": c_heading(subject, about), "contract": _contract(subject)}
        ),
        f"{name}.c": filled("c_code/payload.c", fields | {"about": c_heading(subject, source)}),
        f"{name}.hpp": filled("c_code/payload.hpp", fields | {"about": c_heading(subject, [about[0], "C++17."])}),
        "CMakeLists.txt": filled(
            "c_code/CMakeLists.txt", fields | {"about": "\n".join([spdx(subject, "#"), *comment([about[0]], "#")])}
        ),
    }


def _functions(subject: ExportSubject, precision: Precision) -> dict[str, str]:
    """Bodies of the functions, and their operation counts."""
    chain, payload = subject.chain, subject.payload.model
    functions = {
        "torque": torque_of(chain, payload),
        "gravity": torque_of(chain, payload, AT_REST),
        "regressor": regressor_of(chain),
        "compute": any_torque(chain),
        "compute_gravity": any_torque(chain, AT_REST),
        "into_own": into_own(chain),
    }
    fields: dict[str, str] = {}
    for key, function in functions.items():
        fields |= _function(key, function, precision)
    return fields


def _function(key: str, function: Function, precision: Precision) -> dict[str, str]:
    """Body of a function, and its operation count."""
    done = function.operations
    counted = (
        f"Operations: {done.multiplications} multiplications, {done.additions} additions, "
        f"{done.trigonometric} sines and cosines"
    )
    return {key: c_statements(function, precision), f"{key}_operations": counted}


def _friction(subject: ExportSubject, precision: Precision, fields: Mapping[str, str]) -> dict[str, str]:
    """The payload's friction in a calibrated arm's gears; empty if the arm is not calibrated."""
    if subject.calibration is None:
        return {"friction_declaration": "", "friction_definition": "", "kinds": "2", "expected_text": ""}
    body = subject.calibration.body
    own = _function("links", link_torque_of(subject.chain, body.links), precision)
    own["load_friction"] = precision.listed(body.load_friction)
    own["reversal"] = precision.listed(body.reversal_speed_rad_s)
    return {
        "friction_declaration": filled("c_code/friction.h", {**fields, **own}),
        "friction_definition": filled("c_code/friction.c", {**fields, **own}),
        "kinds": "3",
        "expected_text": ", and its friction",
    }


def _numbers(subject: ExportSubject, precision: Precision, error: SinglePrecisionError | None) -> dict[str, str]:
    """The payload, the rate of its changes, and the self-test."""
    payload, (given, expected_nm) = subject.payload.model, self_test(subject, precision)
    s_per_kg, s_per_kg_m = change_rate(subject.chain, subject.torque_rate_nm_s)
    tolerance_nm = _SELF_TEST_SHARE * max(1.0, float(np.abs(expected_nm).max()))
    if error is not None:
        tolerance_nm = 2.0 * error.bound_nm  # the regressor's product, and friction, add several torques
    return {
        "payload": precision.rows(payload.theta.reshape(2, 5)),
        "own": precision.rows(payload.transformed(planar_groups(subject.chain).flange).theta.reshape(2, 5)),
        "s_per_kg": precision.literal(s_per_kg),
        "s_per_kg_m": precision.literal(s_per_kg_m),
        "s_per_kg_text": f"{s_per_kg:.3g}",
        "s_per_kg_m_text": f"{s_per_kg_m:.3g}",
        "given": _table(given, precision),
        "expected": _table(expected_nm, precision),
        "tolerance": precision.literal(tolerance_nm),
        "tolerance_text": f"{tolerance_nm:.1e}",
    }


def _payload_text(subject: ExportSubject) -> str:
    """The payload as in its file, and the parameters that the torque is computed from, as text."""
    values = (f"{name} {exact(v)}" for name, v in zip(PARAMETER_NAMES, subject.payload.values, strict=True))
    theta = ", ".join(exact(value) for value in subject.payload.model.theta)
    return (
        "In the flange frame, mass in kg, centre of mass in m, inertia about the centre of mass in kg m2 as tensor "
        f"elements (ixy = -int xy dm): {', '.join(values)}. As theta, about the flange's origin: {theta}."
    )


def _contract(subject: ExportSubject) -> str:
    """What the functions take and give."""
    joints = ", ".join(f"[{i}] {name}" for i, name in enumerate(subject.joint_names))
    gravity = ", ".join(exact(g) for g in subject.chain.gravity_m_s2)
    fields = {"joints": joints.replace("*/", "* /"), "gravity": gravity}
    return written("c_code/contract", " *", fields).rstrip("\n")


def _table(values: FloatArray, precision: Precision) -> str:
    """(rows, arrays, n) numbers as the inside of an initialiser."""
    rows = (",\n     ".join(f"{{{precision.listed(array)}}}" for array in row) for row in values)
    return ",\n".join(f"    {{{row}}}" for row in rows)
