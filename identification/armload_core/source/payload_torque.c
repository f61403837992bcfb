/* tau = J(q)^T w(q, dq, ddq, theta): accelerations outwards in each frame's own coordinates, the payload's force and
   moment at the flange, and the wrench back inwards. Chen 2016, eq. (2). */

#include "payload_torque.h"

#include <math.h>

#include "chain.h"

typedef struct {
    double x, y, z;
} vec3;

static inline vec3 sum(vec3 a, vec3 b)
{
    return (vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline vec3 times(double s, vec3 v)
{
    return (vec3){s * v.x, s * v.y, s * v.z};
}

static inline vec3 cross(vec3 a, vec3 b)
{
    return (vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

/* R v and R^T v for a rotation by rows. */
static inline vec3 turned(const double *r, vec3 v)
{
    return (vec3){
        r[0] * v.x + r[1] * v.y + r[2] * v.z,
        r[3] * v.x + r[4] * v.y + r[5] * v.z,
        r[6] * v.x + r[7] * v.y + r[8] * v.z,
    };
}

static inline vec3 turned_back(const double *r, vec3 v)
{
    return (vec3){
        r[0] * v.x + r[3] * v.y + r[6] * v.z,
        r[1] * v.x + r[4] * v.y + r[7] * v.z,
        r[2] * v.x + r[5] * v.y + r[8] * v.z,
    };
}

/* Rz(angle) v for the angle's cosine and sine. */
static inline vec3 turned_z(double c, double s, vec3 v)
{
    return (vec3){c * v.x - s * v.y, s * v.x + c * v.y, v.z};
}

static inline vec3 tensor_times(const double *i, vec3 v)
{
    return (vec3){
        i[0] * v.x + i[3] * v.y + i[4] * v.z,
        i[3] * v.x + i[1] * v.y + i[5] * v.z,
        i[4] * v.x + i[5] * v.y + i[2] * v.z,
    };
}

typedef struct {
    vec3 w, dw, a;
} velocities;

/* The motion of a frame that is fixed to a moving one at `placement` (rotation by rows, position). */
static inline velocities at_placement(velocities m, const double *placement)
{
    const vec3 lever = {placement[9], placement[10], placement[11]};
    const vec3 a = sum(m.a, sum(cross(m.dw, lever), cross(m.w, cross(m.w, lever))));
    return (velocities){turned_back(placement, m.w), turned_back(placement, m.dw), turned_back(placement, a)};
}

void payload_torque(const double *model, int n, const double *q, const double *dq, const double *ddq, double *torque)
{
    const double *flange = flange_of(model, n), *body = model + packed_length(n);
    double cosine[MOST_JOINTS], sine[MOST_JOINTS];
    velocities m = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {model[0], model[1], model[2]}};
    for (int i = 0; i < n; i++) {
        const double c = cos(q[i]), s = sin(q[i]);
        cosine[i] = c;
        sine[i] = s;
        m = at_placement(m, joint_of(model, i));
        m.w = turned_z(c, -s, m.w);
        m.dw = turned_z(c, -s, m.dw);
        m.a = turned_z(c, -s, m.a);
        m.dw.x += m.w.y * dq[i];
        m.dw.y -= m.w.x * dq[i];
        m.dw.z += ddq[i];
        m.w.z += dq[i];
    }
    m = at_placement(m, flange);

    const double mass = body[0], *inertia = body + 4;
    const vec3 first = {body[1], body[2], body[3]};
    vec3 force = sum(times(mass, m.a), sum(cross(m.dw, first), cross(m.w, cross(m.w, first))));
    vec3 moment =
        sum(sum(tensor_times(inertia, m.dw), cross(m.w, tensor_times(inertia, m.w))), cross(first, m.a));

    const double *placement = flange;
    for (int i = n - 1; i >= 0; i--) {
        /* the wrench about the joint's origin, in its coordinates before and after it has turned */
        force = turned(placement, force);
        moment = sum(turned(placement, moment), cross((vec3){placement[9], placement[10], placement[11]}, force));
        torque[i] = moment.z;
        force = turned_z(cosine[i], sine[i], force);
        moment = turned_z(cosine[i], sine[i], moment);
        placement = joint_of(model, i);
    }
}
