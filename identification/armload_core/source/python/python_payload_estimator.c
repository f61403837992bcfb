/* The Python type PayloadEstimator, a wrapper of the recursive estimator. */

#include <stddef.h>
#include <string.h>

#include "instruction_sets/batch.h"
#include "estimator/payload_estimator.h"
#include "python_types.h"

extern const batch_kernels *batch;

typedef struct {
    PyObject_HEAD payload_estimator estimator; /* n is 0 before __init__ */
    double chain[MOST_PACKED_NUMBERS], links[MOST_JOINTS * BODY_PARAMETERS]; /* links in the turned frames */
} payload_estimator_object;

void estimator_arm(const payload_estimator *e, const double *position, const double *velocity,
                   const double *acceleration, double *regressor, double *links)
{
    const char *const object = (const char *)e - offsetof(payload_estimator_object, estimator);
    const payload_estimator_object *const self = (const payload_estimator_object *)(const void *)object;
    batch->payload_regressor(self->chain, e->n, 1, position, velocity, acceleration, regressor);
    batch->arm_torque(self->chain, e->n, self->links, 1, position, velocity, acceleration, links);
}

static int init(PyObject *object, PyObject *args, PyObject *keywords)
{
    enum { LINKS, CHAIN, FROM_EFFORT, ROTORS, PARAMETER, SCALE, ARRAYS }; /* links first: they give n */
    static const operand wanted[ARRAYS] = {{"links", 'd', 0, 2, {JOINTS, BODY_PARAMETERS}},
                                           {"packed", 'd', 0, 1, {PACKED}},
                                           {"from_effort", 'd', 0, 2, {JOINTS, JOINTS}},
                                           {"rotors", 'd', 0, 2, {JOINTS, JOINTS}},
                                           {"parameter", 'd', 0, 2, {ESTIMATOR_PARAMETERS, JOINTS}},
                                           {"scale", 'd', 0, 1, {BODY_PARAMETERS}}};
    payload_estimator_object *self = (payload_estimator_object *)object;
    payload_estimator *e = &self->estimator;
    PyObject *arrays[ARRAYS];
    Py_buffer views[ARRAYS];
    sizes found;
    double memory_s, delay_s;
    if (e->n != 0 || (keywords && PyDict_Size(keywords) != 0)) {
        PyErr_SetString(PyExc_TypeError, "PayloadEstimator is made once, and takes no keywords");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "OOOOOOdd", arrays + CHAIN, arrays + LINKS, arrays + FROM_EFFORT,
                          arrays + ROTORS, arrays + PARAMETER, arrays + SCALE, &memory_s,
                          &delay_s)
        || open_arrays(arrays, ARRAYS, wanted, ARRAYS, views, &found) < 0) {
        return -1;
    }
    const int n = found.joints;
    const double *parameter = views[PARAMETER].buf;
    int valid = memory_s > 0.0;
    for (int j = 0; j < n; j++) {
        valid &= parameter[ESTIMATOR_REVERSAL * n + j] > 0.0 && parameter[ESTIMATOR_GATE * n + j] > 0.0
                 && parameter[ESTIMATOR_NOISE * n + j] > 0.0;
    }
    if (valid) {
        memcpy(self->links, views[LINKS].buf, (size_t)views[LINKS].len);
        memcpy(self->chain, views[CHAIN].buf, (size_t)views[CHAIN].len);
        memcpy(e->from_effort, views[FROM_EFFORT].buf, (size_t)views[FROM_EFFORT].len);
        memcpy(e->rotors, views[ROTORS].buf, (size_t)views[ROTORS].len);
        memcpy(e->scale, views[SCALE].buf, (size_t)views[SCALE].len);
        for (int k = 0; k < ESTIMATOR_PARAMETERS; k++) {
            memcpy(e->parameter[k], parameter + k * n, (size_t)n * sizeof(double));
        }
        e->memory_s = memory_s;
        e->delay_s = delay_s;
        e->n = n;
        estimator_begin(e);
    } else {
        PyErr_SetString(PyExc_ValueError, "memory, reversal speed, speed of the gate and noise must be above 0");
    }
    close_arrays(views, ARRAYS);
    return valid ? 0 : -1;
}

static void dealloc(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    release(object);
    Py_DECREF(type);
}

/* Read n numbers from an array of float64 with any stride. Returns 0, or -1 with an exception set. */
static int read_row(PyObject *value, int n, double *row)
{
    Py_buffer view;
    if (PyObject_GetBuffer(value, &view, PyBUF_STRIDES | PyBUF_FORMAT) < 0) {
        return -1;
    }
    const int fits = has_type(&view, 'd') && view.ndim == 1 && view.shape[0] == n;
    for (int i = 0; fits && i < n; i++) {
        memcpy(row + i, (const char *)view.buf + i * view.strides[0], sizeof(double));
    }
    PyBuffer_Release(&view);
    if (!fits) {
        PyErr_Format(PyExc_ValueError, "position and effort must be float64 arrays of %d numbers, one per joint", n);
    }
    return fits ? 0 : -1;
}

PyDoc_STRVAR(update_doc, "update($self, time_s, position_rad, effort, /)\n--\n\nTake a sample.");

static PyObject *update(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    double position[MOST_JOINTS], effort[MOST_JOINTS];
    if (given != 3 || e->n == 0) {
        PyErr_SetString(PyExc_TypeError, given != 3 ? "expected time, positions and efforts"
                                                    : "PayloadEstimator.__init__ was not called");
        return NULL;
    }
    const double time_s = PyFloat_AsDouble(args[0]);
    if ((time_s == -1.0 && PyErr_Occurred()) || read_row(args[1], e->n, position) < 0
        || read_row(args[2], e->n, effort) < 0) {
        return NULL;
    }
    estimator_update(e, time_s, position, effort);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(update_all_doc, "update_all($self, time_s, position_rad, effort, /)\n--\n\nTake many samples.");

static PyObject *update_all(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    enum { TIME, POSITION, EFFORT, ARRAYS };
    static const operand wanted[ARRAYS] = {{"time_s", 'd', 0, 1, {SAMPLES}},
                                           {"position", 'd', 0, 2, {SAMPLES, JOINTS}},
                                           {"effort", 'd', 0, 2, {SAMPLES, JOINTS}}};
    payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    Py_buffer views[ARRAYS];
    sizes found;
    if (e->n == 0) {
        PyErr_SetString(PyExc_TypeError, "PayloadEstimator.__init__ was not called");
        return NULL;
    }
    if (open_arrays(args, given, wanted, ARRAYS, views, &found) < 0) {
        return NULL;
    }
    const int fits = found.joints == e->n;
    if (fits) {
        const double *time = views[TIME].buf, *position = views[POSITION].buf, *effort = views[EFFORT].buf;
        for (Py_ssize_t t = 0; t < found.samples; t++) {
            estimator_update(e, time[t], position + t * e->n, effort + t * e->n);
        }
    } else {
        PyErr_Format(PyExc_ValueError, "%d joints for an estimator of %d", found.joints, e->n);
    }
    close_arrays(views, ARRAYS);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(exchange_doc, "exchange($self, time_s, /)\n--\n\nAnother payload since a time.");

static PyObject *exchange(PyObject *object, PyObject *value)
{
    const double time_s = PyFloat_AsDouble(value);
    if (time_s == -1.0 && PyErr_Occurred()) {
        return NULL;
    }
    payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    e->noticing = 1;
    e->noticed = time_s;
    e->noticed_mass = 0.0;
    Py_RETURN_NONE;
}

PyDoc_STRVAR(become_doc, "become($self, other, /)\n--\n\nThe state of another estimator.");

static PyObject *become(PyObject *object, PyObject *other)
{
    payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    if (Py_TYPE(other) != Py_TYPE(object) || ((payload_estimator_object *)other)->estimator.n != e->n) {
        PyErr_SetString(PyExc_TypeError, "expected a PayloadEstimator of as many joints");
        return NULL;
    }
    *e = ((payload_estimator_object *)other)->estimator;
    Py_RETURN_NONE;
}

PyDoc_STRVAR(read_into_doc, "read_into($self, theta, covariance, friction, moving_s, status, /)\n--\n\n"
                            "The estimate into arrays.");

static PyObject *read_into(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    static const operand wanted[] = {{"theta", 'd', 1, 1, {BODY_PARAMETERS}},
                                     {"covariance", 'd', 1, 2, {BODY_PARAMETERS, BODY_PARAMETERS}},
                                     {"friction", 'd', 1, 2, {FRICTION_STATES, JOINTS}},
                                     {"moving_s", 'd', 1, 1, {JOINTS}},
                                     {"status", 'd', 1, 1, {ESTIMATOR_STATUS}}};
    const payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    Py_buffer views[5];
    sizes found;
    if (open_arrays(args, given, wanted, 5, views, &found) < 0) {
        return NULL;
    }
    const int fits = e->n != 0 && found.joints == e->n;
    if (fits) {
        estimator_read(e, views[0].buf, views[1].buf, views[2].buf, views[3].buf, views[4].buf);
    } else {
        PyErr_Format(PyExc_ValueError, "%d joints for an estimator of %d", found.joints, e->n);
    }
    close_arrays(views, 5);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(friction_into_doc, "friction_into($self, covariance, /)\n--\n\nThe covariance of the changes of friction.");

static PyObject *friction_into(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    static const operand wanted[] = {{"covariance", 'd', 1, 3, {JOINTS, FRICTION_STATES, FRICTION_STATES}}};
    const payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    Py_buffer view;
    sizes found;
    if (open_arrays(args, given, wanted, 1, &view, &found) < 0) {
        return NULL;
    }
    const int fits = e->n != 0 && found.joints == e->n;
    if (fits) {
        estimator_read_friction(e, view.buf);
    } else {
        PyErr_Format(PyExc_ValueError, "%d joints for an estimator of %d", found.joints, e->n);
    }
    close_arrays(&view, 1);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(rows_into_doc, "rows_into($self, rows, /)\n--\n\nThe remembered rows into an array; how many there are.");

/* The remembered rows, oldest first: time, q, dq, ddq, tau (n each). Returns their number. */
static int remembered_rows(const payload_estimator *e, double *out)
{
    const size_t joints = (size_t)e->n;
    for (int k = 0; k < e->remembered; k++) {
        const estimator_row *row = e->row + (e->next_row + REMEMBERED_ROWS - e->remembered + k) % REMEMBERED_ROWS;
        *out++ = row->time;
        memcpy(out, row->position, joints * sizeof(double));
        memcpy(out + joints, row->velocity, joints * sizeof(double));
        memcpy(out + 2 * joints, row->acceleration, joints * sizeof(double));
        memcpy(out + 3 * joints, row->torque, joints * sizeof(double));
        out += 4 * joints;
    }
    return e->remembered;
}

static PyObject *rows_into(PyObject *object, PyObject *value)
{
    const payload_estimator *e = &((payload_estimator_object *)object)->estimator;
    Py_buffer view;
    if (e->n == 0 || PyObject_GetBuffer(value, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | PyBUF_WRITABLE) < 0) {
        PyErr_Clear();
        PyErr_SetString(PyExc_TypeError, "expected a writable array of an estimator that __init__ has made");
        return NULL;
    }
    const int fits = has_type(&view, 'd') && view.ndim == 2 && view.shape[0] == REMEMBERED_ROWS
                     && view.shape[1] == 1 + 4 * e->n;
    const int rows = fits ? remembered_rows(e, view.buf) : 0;
    PyBuffer_Release(&view);
    if (!fits) {
        PyErr_Format(PyExc_ValueError, "expected an array of float64 (%d, %d)", REMEMBERED_ROWS, 1 + 4 * e->n);
        return NULL;
    }
    return PyLong_FromLong(rows);
}

static PyMethodDef METHODS[] = {{"update", FASTCALL(update), METH_FASTCALL, update_doc},
                                {"update_all", FASTCALL(update_all), METH_FASTCALL, update_all_doc},
                                {"read_into", FASTCALL(read_into), METH_FASTCALL, read_into_doc},
                                {"friction_into", FASTCALL(friction_into), METH_FASTCALL, friction_into_doc},
                                {"exchange", exchange, METH_O, exchange_doc},
                                {"become", become, METH_O, become_doc},
                                {"rows_into", rows_into, METH_O, rows_into_doc},
                                {NULL, NULL, 0, NULL}};

PyDoc_STRVAR(type_doc, "PayloadEstimator(packed, links, from_effort, rotors, parameter, scale, memory_s, delay_s, /)\n"
                       "--\n\n"
                       "What an arm carries, sample by sample.");

static PyType_Slot SLOTS[] = {{Py_tp_doc, (void *)type_doc}, {Py_tp_new, (void *)PyType_GenericNew},
                              {Py_tp_init, (void *)init},    {Py_tp_dealloc, (void *)dealloc},
                              {Py_tp_methods, METHODS},      {0, NULL}};

PyType_Spec PAYLOAD_ESTIMATOR_SPEC = {.name = "armload_core.kernels.PayloadEstimator",
                                      .basicsize = sizeof(payload_estimator_object),
                                      .flags = Py_TPFLAGS_DEFAULT,
                                      .slots = SLOTS};
