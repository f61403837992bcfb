"""C99: the payload's torque for a control loop, as straight-line code for one arm.

    tau = J(q)^T w(q, dq, ddq, theta)

Three functions, made by `straight_line` from the chain and the payload: torque, torque at rest, and the regressor of
any payload at the flange. They hold no loop, no branch and no state, allocate nothing, and need sin and cos of math.h.

- q, dq, ddq in rad, rad/s, rad/s2 and torques in N m, all at the JOINTS, in the configuration's order and directions.
- A torque is positive along the joint's positive direction: what the joint has to give for the payload.
- theta in kg, kg m, kg m2, inertia as tensor elements (Ixy = -int xy dm) about the ORIGIN of the flange.

What is not determined: the torque needs all ten parameters, so the model's complete set is written, as the feed-forward
takes it, and marked.

References:
    Chen 2016, eq. (2).
    ISO/IEC 9899:1999.
"""

from __future__ import annotations

from string import Template

import numpy as np

from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.straight_line.c_function import c_statements
from armload_controller.export.straight_line.expressions import Expression, Graph
from armload_controller.export.straight_line.planar_groups import planar_groups
from armload_controller.export.straight_line.specialised_dynamics import (
    SpecialisedArm,
    payload_regressor,
    payload_torque,
)
from armload_controller.export.subject import ExportSubject
from armload_controller.export.wording import comment, exact, provenance
from armload_core.arrays import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PARAMETER_NAMES, InertialParameters

_NEGLIGIBLE = 4e-15
"""Share of the greatest first moment, or inertia, that is rounding."""

_HEADER = Template("""\
/*
$about
 */
#ifndef ${guard}_H
#define ${guard}_H

#ifdef __cplusplus
extern "C" {
#endif

#define ${guard}_JOINTS $n

/*
$contract
 *
 * $torque_operations.
 */
void ${name}_torque(
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS]);

/*
 * The same at rest: the torque of the payload's weight.
 *
 * $gravity_operations.
 */
void ${name}_gravity(
    const double q_rad[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS]);

/*
$regressor_contract
 *
 * $regressor_operations.
 */
void ${name}_regressor(
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double regressor[${guard}_JOINTS * 10]);

#ifdef __cplusplus
}
#endif

#endif
""")

_SOURCE = Template("""\
/*
$about
 */
#include "${name}.h"

#include <math.h>

void ${name}_torque(
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS])
{
$torque
}

void ${name}_gravity(
    const double q_rad[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS])
{
$gravity
}

void ${name}_regressor(
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double regressor[${guard}_JOINTS * 10])
{
$regressor
}
""")


def export_c(subject: ExportSubject) -> dict[str, str]:
    """Header and source of the functions `<robot>_payload_torque`, `_gravity` and `_regressor`.

    Args:
        subject: The payload and the arm.

    Returns:
        Texts by file name.
    """
    chain, payload = subject.chain, subject.payload
    name = f"{subject.identifier}_payload"
    fields = {"name": name, "guard": name.upper(), "n": str(chain.n)}
    functions = {
        "torque": _torque(chain, payload.model, moving=True),
        "gravity": _torque(chain, payload.model, moving=False),
        "regressor": _regressor(chain),
    }
    for key, (graph, outputs) in functions.items():
        array = "regressor" if key == "regressor" else "torque_nm"
        done = graph.operations(outputs)
        inputs = ("q_rad",) if key == "gravity" else ("q_rad", "dq_rad_s", "ddq_rad_s2")
        fields[key] = c_statements(graph, inputs, {array: outputs})
        fields[f"{key}_operations"] = (
            f"Operations: {done.multiplications} multiplications, {done.additions} additions, "
            f"{done.trigonometric} sines and cosines"
        )
    about = [provenance(subject), _payload_text(subject), complete_inertia(payload, TENSOR).statement]
    return {
        f"{name}.h": _HEADER.substitute(
            fields,
            about=_block(about),
            contract=_block(_contract(subject)),
            regressor_contract=_block(_regressor_contract()),
        ),
        f"{name}.c": _SOURCE.substitute(
            fields, about=_block([about[0], "C99; needs math.h. Written by a generator; see the header."])
        ),
    }


def _torque(chain: Chain, payload: InertialParameters, *, moving: bool) -> tuple[Graph, list[Expression]]:
    """The payload's torque, in motion or at rest."""
    first_moment = payload.transformed(planar_groups(chain).flange).theta[1:3]
    # the last frame is turned about its axis until the first moment lies in its x z plane: a zero more
    groups = planar_groups(chain, float(np.arctan2(first_moment[1], first_moment[0])))
    theta = _without_rounding(payload.transformed(groups.flange).theta)
    graph = Graph()
    q, dq, ddq = (graph.inputs(name, chain.n) for name in ("q_rad", "dq_rad_s", "ddq_rad_s2"))
    arm = SpecialisedArm(graph, groups, q, dq if moving else None, ddq if moving else None)
    return graph, payload_torque(arm, [graph.constant(float(value)) for value in theta])


def _regressor(chain: Chain) -> tuple[Graph, list[Expression]]:
    """The regressor, row by row."""
    graph = Graph()
    q, dq, ddq = (graph.inputs(name, chain.n) for name in ("q_rad", "dq_rad_s", "ddq_rad_s2"))
    arm = SpecialisedArm(graph, planar_groups(chain), q, dq, ddq)
    return graph, [element for row in payload_regressor(arm) for element in row]


def _without_rounding(theta: FloatArray) -> FloatArray:
    """Ten parameters, those that are nothing but rounding beside their like set to zero."""
    scale = np.repeat([abs(theta[0]), np.abs(theta[1:4]).max(), np.abs(theta[4:]).max()], [1, 3, 6])
    return np.where(np.abs(theta) < _NEGLIGIBLE * scale, 0.0, theta)


def _payload_text(subject: ExportSubject) -> str:
    """The payload in words, as its file gives it, and what the torque is computed from."""
    values = (f"{name} {exact(v)}" for name, v in zip(PARAMETER_NAMES, subject.payload.values, strict=True))
    theta = ", ".join(exact(value) for value in subject.payload.model.theta)
    return (
        "In the flange frame, mass in kg, centre of mass in m, inertia about the centre of mass in kg m2 as tensor "
        f"elements (ixy = -int xy dm): {', '.join(values)}. As theta, about the flange's origin: {theta}."
    )


def _contract(subject: ExportSubject) -> list[str]:
    """What a caller needs to know."""
    joints = ", ".join(f"[{i}] {name}" for i, name in enumerate(subject.joint_names))
    return [
        "Torque that the payload asks of the joints, gravity included: what the joints have to give for it on top of "
        "what the empty arm needs.",
        f"Joints, from the base to the flange: {joints}.",
        "q_rad, dq_rad_s, ddq_rad_s2: joint positions in rad, velocities in rad/s, accelerations in rad/s2, with the "
        "zeros and directions of the robot's configuration.",
        "torque_nm: N m at the joints, positive along the joint's positive direction. Gear ratios and coupled motors "
        "are not in it: the motors' torques are the transposed coupling times these, over the gear ratios.",
        f"Gravity in the base frame: {', '.join(exact(g) for g in subject.chain.gravity_m_s2)} m/s2.",
        "No allocation, no state, no lock: callable from any thread. torque_nm may be one of the inputs.",
    ]


def _regressor_contract() -> list[str]:
    """What a caller of the regressor needs to know."""
    return [
        "Regressor of any rigid payload at the flange: torque[i] = sum over k of regressor[10 i + k] theta[k], with "
        "theta = m, m c_x, m c_y, m c_z, Ixx, Iyy, Izz, Ixy, Ixz, Iyz in kg, kg m, kg m2: tensor elements about the "
        "flange's origin, in the flange's axes. It does not depend on the payload of this file."
    ]


def _block(paragraphs: list[str]) -> str:
    """The inside of a C comment; a name cannot end it."""
    return "\n".join(comment([p.replace("*/", "* /") for p in paragraphs], " *"))
