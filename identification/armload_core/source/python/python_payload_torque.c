/* The Python type PayloadTorque: the feed-forward's torque in one call, without Python code in between. */

#include <string.h>

#include "chain.h"
#include "python_types.h"

enum { MOST_MODEL_NUMBERS = MOST_PACKED_NUMBERS + BODY_PARAMETERS };

/* Accessed only with the interpreter's lock held, which makes a change from another thread atomic. */
typedef struct {
    PyObject_HEAD int n; /* 0 before __init__ */
    double model[MOST_MODEL_NUMBERS];
    double from[BODY_PARAMETERS], to[BODY_PARAMETERS]; /* the ends of a change */
    Py_ssize_t calls, left;                            /* calls that the change takes, calls that are left */
    PyObject *torque;                                  /* the array that every call returns */
    Py_buffer torque_view;
} payload_torque_object;

static int has_no_keywords(PyObject *keywords)
{
    if (keywords && PyDict_Size(keywords) != 0) {
        PyErr_SetString(PyExc_TypeError, "PayloadTorque takes no keywords");
        return 0;
    }
    return 1;
}

static int init(PyObject *object, PyObject *args, PyObject *keywords)
{
    static const operand wanted[] = {{"model", 'd', 0, 1, {MODEL}}, {"torque", 'd', 1, 1, {JOINTS}}};
    payload_torque_object *self = (payload_torque_object *)object;
    PyObject *arrays[2];
    Py_buffer views[2];
    sizes found;
    if (self->n != 0) {
        PyErr_SetString(PyExc_RuntimeError, "PayloadTorque.__init__ was called before");
        return -1;
    }
    if (!has_no_keywords(keywords) || !PyArg_ParseTuple(args, "OO", arrays, arrays + 1)
        || open_arrays(arrays, 2, wanted, 2, views, &found) < 0) {
        return -1;
    }
    memcpy(self->model, views[0].buf, (size_t)views[0].len);
    PyBuffer_Release(views);
    self->torque = Py_NewRef(arrays[1]);
    self->torque_view = views[1];
    self->n = found.joints;
    return 0;
}

static void dealloc(PyObject *object)
{
    payload_torque_object *self = (payload_torque_object *)object;
    PyTypeObject *type = Py_TYPE(object);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    if (self->n != 0) {
        PyBuffer_Release(&self->torque_view);
        Py_CLEAR(self->torque);
    }
    release(object);
    Py_DECREF(type);
}

/* Read n numbers from a one-dimensional array of float64 with any stride. Returns 1; 0 if it is another type of object;
   -1 with an exception set. */
static int read_row(PyObject *value, int n, double *row)
{
    Py_buffer view;
    int found = 0;
    if (PyObject_GetBuffer(value, &view, PyBUF_STRIDES | PyBUF_FORMAT) < 0) {
        PyErr_Clear();
        return 0;
    }
    if (has_type(&view, 'd')) {
        found = view.ndim == 1 && view.shape[0] == n ? 1 : -1;
    }
    if (found == 1) {
        for (int i = 0; i < n; i++) {
            memcpy(row + i, (const char *)view.buf + i * view.strides[0], sizeof(double));
        }
    } else if (found < 0) {
        PyErr_Format(PyExc_ValueError, "position, velocity and acceleration: expected one number per joint, %d each", n);
    }
    PyBuffer_Release(&view);
    return found;
}

/* Read n numbers from anything that numpy.array accepts. Returns 0, or -1 with an exception set. */
static int read_anything(PyObject *value, int n, double *row)
{
    PyObject *numpy = PyImport_ImportModule("numpy");
    PyObject *array = numpy ? PyObject_CallMethod(numpy, "array", "Os", value, "float64") : NULL;
    const int found = array ? read_row(array, n, row) : -1;
    Py_XDECREF(numpy);
    Py_XDECREF(array);
    return found == 1 ? 0 : -1;
}

static void advance_change(payload_torque_object *self)
{
    double *theta = self->model + packed_length(self->n);
    self->left--;
    const double done = 1.0 - (double)self->left / (double)self->calls;
    const double share = (3.0 - 2.0 * done) * done * done;
    for (int k = 0; k < BODY_PARAMETERS; k++) {
        theta[k] = self->from[k] + share * (self->to[k] - self->from[k]);
    }
}

PyDoc_STRVAR(torque_nm_doc, "torque_nm($self, position_rad, velocity_rad_s, acceleration_rad_s2, /)\n--\n\n"
                            "Joint torques for one state, in the array that was given.");

static PyObject *torque_nm(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    payload_torque_object *self = (payload_torque_object *)object;
    double state[3][MOST_JOINTS];
    if (given != 3 || self->n == 0) {
        PyErr_SetString(PyExc_TypeError, given != 3 ? "expected position, velocity and acceleration"
                                                    : "PayloadTorque.__init__ was not called");
        return NULL;
    }
    for (int k = 0; k < 3; k++) {
        const int found = read_row(args[k], self->n, state[k]);
        if (found < 0 || (found == 0 && read_anything(args[k], self->n, state[k]) < 0)) {
            return NULL;
        }
    }
    if (self->left) {
        advance_change(self);
    }
    batch->payload_torque(self->model, self->n, state[0], state[1], state[2], self->torque_view.buf);
    return Py_NewRef(self->torque);
}

PyDoc_STRVAR(change_doc, "change_parameters($self, theta, calls, /)\n--\n\n"
                         "Go to other parameters over a number of calls, with rest at both ends.");

static PyObject *change_parameters(PyObject *object, PyObject *args)
{
    payload_torque_object *self = (payload_torque_object *)object;
    double to[BODY_PARAMETERS];
    PyObject *theta;
    Py_buffer view;
    Py_ssize_t calls;
    if (!PyArg_ParseTuple(args, "On", &theta, &calls)
        || PyObject_GetBuffer(theta, &view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT) < 0) {
        return NULL;
    }
    const int fits = has_type(&view, 'd') && view.ndim == 1 && view.shape[0] == BODY_PARAMETERS;
    if (fits) {
        memcpy(to, view.buf, sizeof to);
    }
    PyBuffer_Release(&view);
    if (!fits || calls < 1 || self->n == 0) {
        PyErr_Format(PyExc_ValueError,
                     "expected %d parameters of float64 and at least one call, on an object that "
                     "__init__ has made",
                     BODY_PARAMETERS);
        return NULL;
    }
    memcpy(self->from, self->model + packed_length(self->n), sizeof self->from);
    memcpy(self->to, to, sizeof self->to);
    self->calls = self->left = calls;
    Py_RETURN_NONE;
}

static PyMethodDef METHODS[] = {{"torque_nm", FASTCALL(torque_nm), METH_FASTCALL, torque_nm_doc},
                                {"change_parameters", change_parameters, METH_VARARGS, change_doc},
                                {NULL, NULL, 0, NULL}};

PyDoc_STRVAR(type_doc, "PayloadTorque(model, torque, /)\n--\n\n"
                       "Torque of a payload for one state after the other, into the array `torque`.");

static PyType_Slot SLOTS[] = {{Py_tp_doc, (void *)type_doc}, {Py_tp_new, (void *)PyType_GenericNew},
                              {Py_tp_init, (void *)init},    {Py_tp_dealloc, (void *)dealloc},
                              {Py_tp_methods, METHODS},      {0, NULL}};

PyType_Spec PAYLOAD_TORQUE_SPEC = {.name = "armload_core.kernels.PayloadTorque",
                                   .basicsize = sizeof(payload_torque_object),
                                   .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                                   .slots = SLOTS};
