"""C99: the payload's torque for a control loop, as a header and a source of constants.

    tau = J(q)^T w(q, dq, ddq, theta)

One function, the same recursion as `regressor.payload_torque_into`: accelerations outwards in each frame's own
coordinates, the wrench inwards. Joint frames are turned so that each axis is z, as in `Chain.packed`, which the
constants are taken from. The code allocates nothing, keeps no state, and needs sin and cos of math.h. Its helpers are
`inline`, without which gcc -O2 calls them and takes twice as long.

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

from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.subject import ExportSubject
from armload_controller.export.wording import comment, exact, provenance
from armload_core.arrays import FloatArray
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.model.regressor import feedforward_model

FRAME = 12
"""Numbers of one frame: rotation row by row, position."""

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
 */
void ${name}_torque(
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

enum { JOINTS = ${guard}_JOINTS };

/* Upward acceleration that stands for gravity, in the base frame, m/s2. */
static const double BASE_ACCELERATION[3] = {$gravity};

/* Joint frames at q = 0 in the frame before, every axis turned onto z, then the flange in the last:
   rotation row by row, position in m. */
static const double FRAMES[JOINTS + 1][12] = {
$frames
};

/* m in kg; m c in kg m; Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the flange's origin in kg m2. */
static const double BODY[10] = {
$body
};

/* v = R^T v: into the coordinates of the frame f. */
static inline void turn_out(const double f[12], double v[3])
{
    const double x = v[0], y = v[1], z = v[2];

    v[0] = f[0] * x + f[3] * y + f[6] * z;
    v[1] = f[1] * x + f[4] * y + f[7] * z;
    v[2] = f[2] * x + f[5] * y + f[8] * z;
}

/* v = R v: out of the coordinates of the frame f. */
static inline void turn_in(const double f[12], double v[3])
{
    const double x = v[0], y = v[1], z = v[2];

    v[0] = f[0] * x + f[1] * y + f[2] * z;
    v[1] = f[3] * x + f[4] * y + f[5] * z;
    v[2] = f[6] * x + f[7] * y + f[8] * z;
}

/* v turned about z by the angle with this cosine and sine. */
static inline void turn_z(double c, double s, double v[3])
{
    const double x = v[0], y = v[1];

    v[0] = c * x - s * y;
    v[1] = s * x + c * y;
}

/* m times the acceleration of the point p / m in a frame that turns with w and e, its origin accelerating with a. */
static inline void accelerate(double m, const double p[3], const double w[3], const double e[3], const double a[3],
                       double result[3])
{
    const double v0 = w[1] * p[2] - w[2] * p[1];
    const double v1 = w[2] * p[0] - w[0] * p[2];
    const double v2 = w[0] * p[1] - w[1] * p[0];

    result[0] = m * a[0] + e[1] * p[2] - e[2] * p[1] + w[1] * v2 - w[2] * v1;
    result[1] = m * a[1] + e[2] * p[0] - e[0] * p[2] + w[2] * v0 - w[0] * v2;
    result[2] = m * a[2] + e[0] * p[1] - e[1] * p[0] + w[0] * v1 - w[1] * v0;
}

/* w, e and a of the origin of the frame f, in its coordinates, before its own joint moves. */
static inline void step_out(const double f[12], double w[3], double e[3], double a[3])
{
    double moved[3];

    accelerate(1.0, f + 9, w, e, a, moved);
    a[0] = moved[0];
    a[1] = moved[1];
    a[2] = moved[2];
    turn_out(f, a);
    turn_out(f, w);
    turn_out(f, e);
}

/* Force and moment about the origin of the frame that f is placed in, in its coordinates. */
static inline void step_in(const double f[12], double force[3], double moment[3])
{
    turn_in(f, force);
    turn_in(f, moment);
    moment[0] += f[10] * force[2] - f[11] * force[1];
    moment[1] += f[11] * force[0] - f[9] * force[2];
    moment[2] += f[9] * force[1] - f[10] * force[0];
}

/* Inertia times v. */
static inline void inertia_times(const double v[3], double result[3])
{
    result[0] = BODY[4] * v[0] + BODY[7] * v[1] + BODY[8] * v[2];
    result[1] = BODY[7] * v[0] + BODY[5] * v[1] + BODY[9] * v[2];
    result[2] = BODY[8] * v[0] + BODY[9] * v[1] + BODY[6] * v[2];
}

void ${name}_torque(
    const double q_rad[${guard}_JOINTS],
    const double dq_rad_s[${guard}_JOINTS],
    const double ddq_rad_s2[${guard}_JOINTS],
    double torque_nm[${guard}_JOINTS])
{
    double cosine[JOINTS], sine[JOINTS];
    double w[3] = {0.0, 0.0, 0.0}, e[3] = {0.0, 0.0, 0.0};
    double a[3] = {BASE_ACCELERATION[0], BASE_ACCELERATION[1], BASE_ACCELERATION[2]};
    double force[3], moment[3], momentum[3];
    const double *const first_moment = BODY + 1;
    int i;

    for (i = 0; i < JOINTS; i++) {
        cosine[i] = cos(q_rad[i]);
        sine[i] = sin(q_rad[i]);
        step_out(FRAMES[i], w, e, a);
        turn_z(cosine[i], -sine[i], w);
        turn_z(cosine[i], -sine[i], e);
        turn_z(cosine[i], -sine[i], a);
        e[0] += w[1] * dq_rad_s[i];
        e[1] -= w[0] * dq_rad_s[i];
        e[2] += ddq_rad_s2[i];
        w[2] += dq_rad_s[i];
    }
    step_out(FRAMES[JOINTS], w, e, a);

    accelerate(BODY[0], first_moment, w, e, a, force);
    inertia_times(w, momentum);
    inertia_times(e, moment);
    moment[0] += w[1] * momentum[2] - w[2] * momentum[1] + first_moment[1] * a[2] - first_moment[2] * a[1];
    moment[1] += w[2] * momentum[0] - w[0] * momentum[2] + first_moment[2] * a[0] - first_moment[0] * a[2];
    moment[2] += w[0] * momentum[1] - w[1] * momentum[0] + first_moment[0] * a[1] - first_moment[1] * a[0];

    step_in(FRAMES[JOINTS], force, moment);
    for (i = JOINTS - 1; i >= 0; i--) {
        torque_nm[i] = moment[2];
        turn_z(cosine[i], sine[i], force);
        turn_z(cosine[i], sine[i], moment);
        step_in(FRAMES[i], force, moment);
    }
}
""")


def export_c(subject: ExportSubject) -> dict[str, str]:
    """Header and source of a function `<robot>_payload_torque`.

    Args:
        subject: The payload and the arm.

    Returns:
        Texts by file name.
    """
    chain, payload = subject.chain, subject.payload
    model = feedforward_model(chain, payload.model.theta)
    frames = [model[3 + FRAME * i :][:FRAME] for i in range(chain.n)]
    frames.append(model[3 + 21 * chain.n :][:FRAME])
    name = f"{subject.identifier}_payload"
    fields = {
        "name": name,
        "guard": name.upper(),
        "n": str(chain.n),
        "gravity": _numbers(model[:3]),
        "frames": ",\n".join(f"    {{{_rows(frame)}}}" for frame in frames),
        "body": "    " + _rows(payload.model.theta),
    }
    about = [provenance(subject), _payload_text(subject), complete_inertia(payload, TENSOR).statement]
    return {
        f"{name}.h": _HEADER.substitute(fields, about=_block(about), contract=_block(_contract(subject))),
        f"{name}.c": _SOURCE.substitute(fields, about=_block([about[0], "C99; needs math.h. See the header."])),
    }


def _payload_text(subject: ExportSubject) -> str:
    """The payload in words, as its file tells it."""
    values = (f"{name} {exact(v)}" for name, v in zip(PARAMETER_NAMES, subject.payload.values, strict=True))
    return (
        "In the flange frame, mass in kg, centre of mass in m, inertia about the centre of mass in kg m2 as tensor "
        f"elements (ixy = -int xy dm): {', '.join(values)}."
    )


def _contract(subject: ExportSubject) -> list[str]:
    """What a caller has to know."""
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


def _block(paragraphs: list[str]) -> str:
    """The inside of a C comment; a name cannot end it."""
    return "\n".join(comment([p.replace("*/", "* /") for p in paragraphs], " *"))


def _rows(values: FloatArray) -> str:
    """Numbers, three to a line."""
    return ",\n     ".join(_numbers(values[i : i + 3]) for i in range(0, len(values), 3))


def _numbers(values: FloatArray) -> str:
    return ", ".join(exact(value) for value in values)
