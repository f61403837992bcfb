"""C99: the payload's torque for a control loop, as straight-line code for one arm.

    tau = J(q)^T w(q, dq, ddq, theta)

Made by `straight_line` from the chain and the payload: torque, torque at rest, and the regressor of any payload at the
flange. They hold no loop, no branch and no state, allocate nothing, and need sin and cos of math.h. Beside them a
payload that changes while the loop runs: set, blended without a step, refused where no body can have it.

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

import operator
from functools import reduce
from string import Template

import numpy as np

from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.straight_line.c_function import c_statements
from armload_controller.export.straight_line.expressions import Expression, Graph
from armload_controller.export.straight_line.planar_groups import PlanarGroups, planar_groups
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

_STATE = ("q_rad", "dq_rad_s", "ddq_rad_s2")
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

/*
 * A payload that changes while a loop runs. The members are the functions' own.
 */
typedef struct {
    double theta[10];
    double from[10];
    double to[10];
    double done;
    double step;
} ${name}_state;

/*
 * Begin with the payload of this file.
 */
void ${name}_init(${name}_state *state);

/*
$set_contract
 */
int ${name}_set(
    ${name}_state *state,
    const double theta[10],
    double transition_s,
    double cycle_s);

/*
 * Torque of the payload as it is now, once a cycle; a change goes on by one cycle. Arguments as above.
 *
 * $compute_operations, and 35 for the change.
 */
void ${name}_compute(
    ${name}_state *state,
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS]);

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

/* The payload of this file, about the origin and in the axes that the torque is computed in. */
static const double OWN[10] = {
$own
};

/* From the flange into that frame. */
static void into_own(const double theta[10], double own[10])
{
$into_own
}

/* Whether a body can have these parameters: no negative pivot in its pseudo-inertia [S, m c; m c, m]. */
static int possible(const double theta[10])
{
    const double half = 0.5 * (theta[4] + theta[5] + theta[6]);
    double p[4][4] = {
        {half - theta[4], -theta[7], -theta[8], theta[1]},
        {-theta[7], half - theta[5], -theta[9], theta[2]},
        {-theta[8], -theta[9], half - theta[6], theta[3]},
        {theta[1], theta[2], theta[3], theta[0]}};
    double scale = 0.0;
    int i, j, k;

    for (i = 0; i < 10; i++) {
        if (!(fabs(theta[i]) <= 1e9)) {
            return 0;
        }
        scale = fabs(theta[i]) > scale ? fabs(theta[i]) : scale;
    }
    /* the mass first: where it is zero, so is all the rest */
    for (k = 3; k >= 0; k--) {
        if (p[k][k] < -1e-9 * scale) {
            return 0;
        }
        for (i = 0; i < k; i++) {
            if (p[k][k] <= 1e-12 * scale) {
                if (fabs(p[i][k]) > 1e-6 * scale) {
                    return 0;
                }
                continue;
            }
            for (j = 0; j < k; j++) {
                p[i][j] -= p[i][k] * p[k][j] / p[k][k];
            }
        }
    }
    return 1;
}

void ${name}_init(${name}_state *state)
{
    int i;

    for (i = 0; i < 10; i++) {
        state->theta[i] = OWN[i];
        state->from[i] = OWN[i];
        state->to[i] = OWN[i];
    }
    state->done = 1.0;
    state->step = 1.0;
}

int ${name}_set(${name}_state *state, const double theta[10], double transition_s, double cycle_s)
{
    double calls;
    int i;

    if (!(transition_s >= 0.0) || !(cycle_s > 0.0) || !possible(theta)) {
        return -1;
    }
    calls = floor(transition_s / cycle_s + 0.5);
    for (i = 0; i < 10; i++) {
        state->from[i] = state->theta[i];
    }
    into_own(theta, state->to);
    state->done = 0.0;
    state->step = calls > 1.0 ? 1.0 / calls : 1.0;
    return 0;
}

void ${name}_compute(
    ${name}_state *state,
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS])
{
    const double next = state->done + state->step;
    const double done = next < 1.0 - 1e-9 ? next : 1.0;
    const double share = (3.0 - 2.0 * done) * done * done;
    double *const theta = state->theta;
    int i;

    state->done = done;
    for (i = 0; i < 10; i++) {
        theta[i] = state->from[i] + share * (state->to[i] - state->from[i]);
    }
    {
$compute
    }
}
""")


def export_c(subject: ExportSubject) -> dict[str, str]:
    """Header and source of `<robot>_payload_torque`, `_gravity`, `_regressor`, and of a payload that changes.

    Args:
        subject: The payload and the arm.

    Returns:
        Texts by file name.
    """
    chain, payload = subject.chain, subject.payload
    name = f"{subject.identifier}_payload"
    fields = {"name": name, "guard": name.upper(), "n": str(chain.n)}
    groups = planar_groups(chain)
    fields["own"] = "    " + _rows(payload.model.transformed(groups.flange).theta)
    functions = {
        "torque": (*_torque(chain, payload.model, moving=True), "torque_nm", _STATE),
        "gravity": (*_torque(chain, payload.model, moving=False), "torque_nm", _STATE[:1]),
        "regressor": (*_regressor(chain, groups), "regressor", _STATE),
        "compute": (*_torque_of_any_payload(chain, groups), "torque_nm", _STATE),
        "into_own": (*_into_own(groups), "own", ()),
    }
    for key, (graph, outputs, array, inputs) in functions.items():
        done = graph.operations(outputs)
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
            set_contract=_block(_set_contract()),
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
    q, dq, ddq = (graph.inputs(name, chain.n) for name in _STATE)
    arm = SpecialisedArm(graph, groups, q, dq if moving else None, ddq if moving else None)
    return graph, payload_torque(arm, [graph.constant(float(value)) for value in theta])


def _torque_of_any_payload(chain: Chain, groups: PlanarGroups) -> tuple[Graph, list[Expression]]:
    """The torque of a payload that is given with every call."""
    graph = Graph()
    arm = SpecialisedArm(graph, groups, *(graph.inputs(name, chain.n) for name in _STATE))
    return graph, payload_torque(arm, graph.inputs("theta", 10))


def _regressor(chain: Chain, groups: PlanarGroups) -> tuple[Graph, list[Expression]]:
    """The regressor, row by row."""
    graph = Graph()
    arm = SpecialisedArm(graph, groups, *(graph.inputs(name, chain.n) for name in _STATE))
    return graph, [element for row in payload_regressor(arm) for element in row]


def _into_own(groups: PlanarGroups) -> tuple[Graph, list[Expression]]:
    """Ten parameters from the flange into the frame after the last group: a linear map."""
    columns = [_without_rounding(InertialParameters(unit).transformed(groups.flange).theta) for unit in np.eye(10)]
    graph = Graph()
    theta = graph.inputs("theta", 10)
    own = []
    for row in np.column_stack(columns):
        terms = [float(factor) * value for factor, value in zip(row, theta, strict=True)]
        own.append(reduce(operator.add, terms))
    return graph, own


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
        "Torque that the payload requires of the joints, gravity included: what the joints must give for it on top of "
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


def _set_contract() -> list[str]:
    """What a caller of the change needs to know."""
    return [
        "Change the payload in the cycles to come, without a step in torque: after a grasp, after a release. The "
        "parameters go from what they are to theta (as for the regressor; ten zeros for an empty flange) within "
        "transition_s, with rest at both ends; everything in between is a body that can exist. cycle_s: time between "
        "two calls of compute. A change that is under way is taken up where it is.",
        "Returns 0, or -1 where a time is negative, a number is not finite or no body can have these parameters: "
        "then nothing has changed. Not to be called while compute runs in another thread.",
    ]


def _rows(values: FloatArray) -> str:
    """Numbers, three to a line."""
    return ",\n    ".join(", ".join(exact(v) for v in values[i : i + 3]) for i in range(0, len(values), 3))


def _block(paragraphs: list[str]) -> str:
    """The inside of a C comment; a name cannot end it."""
    return "\n".join(comment([p.replace("*/", "* /") for p in paragraphs], " *"))
