/* The Python module `armload_core.kernels` over the kernels, in CPython's limited API of 3.11.

   Every array comes through the buffer protocol, is checked here and is passed on as pointers: no kernel ever sees a
   shape that does not fit. Nothing but PayloadTorque.torque_nm converts; the array fronts in Python do. */

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

#include <limits.h>
#include <string.h>

#include "batch.h"
#include "chain.h"
#include "payload_torque.h"
#include "servo_loops.h"

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

static const batch_kernels *batch; /* set when the module is loaded */

/* ------------------------------------------------------------------------------------------------- arrays */

typedef struct {
    const char *name;
    char type; /* 'd': float64, 'q': int64 */
    int dimensions;
    int written;
} operand;

static int has_type(const Py_buffer *view, char type)
{
    const char *format = view->format ? view->format : "B";
    if (format[0] == '\0' || format[1] != '\0') {
        return 0;
    }
    return format[0] == type || (type == 'q' && format[0] == 'l' && view->itemsize == 8);
}

static int open_operand(PyObject *value, const operand *wanted, Py_buffer *view)
{
    const int flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (wanted->written ? PyBUF_WRITABLE : 0);
    if (PyObject_GetBuffer(value, view, flags) == 0) {
        if (has_type(view, wanted->type) && view->ndim == wanted->dimensions) {
            return 0;
        }
        PyBuffer_Release(view);
    }
    PyErr_Clear();
    PyErr_Format(PyExc_TypeError, "%s: expected a C-contiguous%s array of %s with %d dimensions", wanted->name,
                 wanted->written ? " writable" : "", wanted->type == 'd' ? "float64" : "int64", wanted->dimensions);
    return -1;
}

static void close_operands(Py_buffer *views, Py_ssize_t count)
{
    for (Py_ssize_t k = 0; k < count; k++) {
        PyBuffer_Release(views + k);
    }
}

/* All or none; `views` are to be closed afterwards. */
static int open_operands(PyObject *const *args, Py_ssize_t given, const operand *wanted, Py_ssize_t count,
                         Py_buffer *views)
{
    if (given != count) {
        PyErr_Format(PyExc_TypeError, "expected %zd arrays, not %zd", count, given);
        return -1;
    }
    for (Py_ssize_t k = 0; k < count; k++) {
        if (open_operand(args[k], wanted + k, views + k) < 0) {
            close_operands(views, k);
            return -1;
        }
    }
    return 0;
}

static int has_shape(const Py_buffer *view, const operand *which, const Py_ssize_t *shape)
{
    for (int axis = 0; axis < which->dimensions; axis++) {
        if (view->shape[axis] != shape[axis]) {
            PyErr_Format(PyExc_ValueError, "%s: axis %d has the length %zd, expected %zd", which->name, axis,
                         view->shape[axis], shape[axis]);
            return 0;
        }
    }
    return 1;
}

#define HAS_SHAPE(view, which, ...) has_shape(view, which, (const Py_ssize_t[]){__VA_ARGS__})

/* Number of joints of a packed chain, or -1. */
static int joints_of(const Py_buffer *packed, Py_ssize_t joints)
{
    if (joints < 1 || joints > MOST_JOINTS) {
        PyErr_Format(PyExc_ValueError, "a chain of %zd joints; the kernels take 1 to %d", joints, MOST_JOINTS);
        return -1;
    }
    if (packed->shape[0] != packed_length((int)joints)) {
        PyErr_Format(PyExc_ValueError, "packed: %zd numbers, expected %d for %zd joints", packed->shape[0],
                     packed_length((int)joints), joints);
        return -1;
    }
    return (int)joints;
}

/* ---------------------------------------------------------------------------------------------- functions */

PyDoc_STRVAR(regressor_doc, "regressor_into(joints, packed, q, dq, ddq, out, /)\n--\n\n"
                            "Regressor of the flange (joints = 0) or of a link.");

static PyObject *regressor_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {
        {"packed", 'd', 1, 0}, {"q", 'd', 2, 0}, {"dq", 'd', 2, 0}, {"ddq", 'd', 2, 0}, {"out", 'd', 3, 1}};
    Py_buffer views[COUNT];
    long joints;
    int n, fits;
    (void)module;
    if (given < 1) {
        PyErr_SetString(PyExc_TypeError, "expected the number of the link, and arrays");
        return NULL;
    }
    joints = PyLong_AsLong(args[0]);
    if (joints == -1 && PyErr_Occurred()) {
        return NULL;
    }
    if (open_operands(args + 1, given - 1, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + OUT, wanted + OUT, samples, n, BODY_PARAMETERS);
    if (fits && (joints < 0 || joints > n)) {
        PyErr_Format(PyExc_ValueError, "link %ld of a chain of %d joints", joints, n);
        fits = 0;
    }
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->regressor(views[PACKED].buf, n, (int)joints, samples, views[Q].buf, views[DQ].buf, views[DDQ].buf,
                         views[OUT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(body_regressor_doc, "body_regressor_into(packed, q, dq, ddq, out, /)\n--\n\n"
                                 "Regressors of all links side by side.");

static PyObject *body_regressor_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {
        {"packed", 'd', 1, 0}, {"q", 'd', 2, 0}, {"dq", 'd', 2, 0}, {"ddq", 'd', 2, 0}, {"out", 'd', 3, 1}};
    Py_buffer views[COUNT];
    int n, fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + OUT, wanted + OUT, samples, n, BODY_PARAMETERS * n);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->body_regressor(views[PACKED].buf, n, samples, views[Q].buf, views[DQ].buf, views[DDQ].buf,
                              views[OUT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(payload_torque_doc, "payload_torque_into(model, q, dq, ddq, out, /)\n--\n\n"
                                 "Torque of a payload, sample by sample.");

static PyObject *payload_torque_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { MODEL, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {
        {"model", 'd', 1, 0}, {"q", 'd', 2, 0}, {"dq", 'd', 2, 0}, {"ddq", 'd', 2, 0}, {"out", 'd', 2, 1}};
    Py_buffer views[COUNT];
    int fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0], n = views[Q].shape[1];
    fits = n > 0 && n <= MOST_JOINTS;
    if (!fits) {
        PyErr_Format(PyExc_ValueError, "a chain of %zd joints; the kernels take 1 to %d", n, MOST_JOINTS);
    }
    fits = fits && HAS_SHAPE(views + MODEL, wanted + MODEL, packed_length((int)n) + BODY_PARAMETERS)
           && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + OUT, wanted + OUT, samples, n);
    if (fits) {
        const double *q = views[Q].buf, *dq = views[DQ].buf, *ddq = views[DDQ].buf;
        double *out = views[OUT].buf;
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t t = 0; t < samples * n; t += n) {
            payload_torque(views[MODEL].buf, (int)n, q + t, dq + t, ddq + t, out + t);
        }
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(arm_torque_doc, "arm_torque_into(packed, links, q, dq, ddq, out, /)\n--\n\n"
                             "Torque of all links, given in the turned joint frames.");

static PyObject *arm_torque_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, LINKS, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {{"packed", 'd', 1, 0}, {"links", 'd', 2, 0}, {"q", 'd', 2, 0},
                                          {"dq", 'd', 2, 0},     {"ddq", 'd', 2, 0},   {"out", 'd', 2, 1}};
    Py_buffer views[COUNT];
    int n, fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + LINKS, wanted + LINKS, n, BODY_PARAMETERS)
           && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + OUT, wanted + OUT, samples, n);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->arm_torque(views[PACKED].buf, n, views[LINKS].buf, samples, views[Q].buf, views[DQ].buf,
                          views[DDQ].buf, views[OUT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(arm_torque_slope_doc, "arm_torque_slope_into(packed, links, weight, q, dq, ddq, slope, /)\n--\n\n"
                                   "Derivative of the weighted sum of all links' torques by q, dq, ddq.");

static PyObject *arm_torque_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, LINKS, WEIGHT, Q, DQ, DDQ, SLOPE, COUNT };
    static const operand wanted[COUNT] = {{"packed", 'd', 1, 0}, {"links", 'd', 2, 0}, {"weight", 'd', 2, 0},
                                          {"q", 'd', 2, 0},      {"dq", 'd', 2, 0},    {"ddq", 'd', 2, 0},
                                          {"slope", 'd', 3, 1}};
    Py_buffer views[COUNT];
    int n, fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + LINKS, wanted + LINKS, n, BODY_PARAMETERS)
           && HAS_SHAPE(views + WEIGHT, wanted + WEIGHT, samples, n)
           && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + SLOPE, wanted + SLOPE, 3, samples, n);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->arm_torque_slope(views[PACKED].buf, n, views[LINKS].buf, views[WEIGHT].buf, samples, views[Q].buf,
                                views[DQ].buf, views[DDQ].buf, views[SLOPE].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(information_doc, "information_into(packed, weight, q, dq, ddq, out, /)\n--\n\n"
                              "Sum of Phi^T diag(weight) Phi of the flange's regressor.");

static PyObject *information_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, WEIGHT, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {{"packed", 'd', 1, 0}, {"weight", 'd', 1, 0}, {"q", 'd', 2, 0},
                                          {"dq", 'd', 2, 0},     {"ddq", 'd', 2, 0},    {"out", 'd', 2, 1}};
    Py_buffer views[COUNT];
    int n, fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + WEIGHT, wanted + WEIGHT, n) && HAS_SHAPE(views + DQ, wanted + DQ, samples, n)
           && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + OUT, wanted + OUT, BODY_PARAMETERS, BODY_PARAMETERS);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->information(views[PACKED].buf, n, views[WEIGHT].buf, samples, views[Q].buf, views[DQ].buf,
                           views[DDQ].buf, views[OUT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(information_slope_doc, "information_slope_into(packed, weight, gain, q, dq, ddq, slope, /)\n--\n\n"
                                    "Derivative of tr(gain M) by q, dq, ddq.");

static PyObject *information_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { PACKED, WEIGHT, GAIN, Q, DQ, DDQ, SLOPE, COUNT };
    static const operand wanted[COUNT] = {{"packed", 'd', 1, 0}, {"weight", 'd', 1, 0}, {"gain", 'd', 2, 0},
                                          {"q", 'd', 2, 0},      {"dq", 'd', 2, 0},     {"ddq", 'd', 2, 0},
                                          {"slope", 'd', 3, 1}};
    Py_buffer views[COUNT];
    int n, fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = joints_of(views + PACKED, views[Q].shape[1]);
    fits = n > 0 && HAS_SHAPE(views + WEIGHT, wanted + WEIGHT, n)
           && HAS_SHAPE(views + GAIN, wanted + GAIN, BODY_PARAMETERS, BODY_PARAMETERS)
           && HAS_SHAPE(views + DQ, wanted + DQ, samples, n) && HAS_SHAPE(views + DDQ, wanted + DDQ, samples, n)
           && HAS_SHAPE(views + SLOPE, wanted + SLOPE, 3, samples, n);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        batch->information_slope(views[PACKED].buf, n, views[WEIGHT].buf, views[GAIN].buf, samples, views[Q].buf,
                                 views[DQ].buf, views[DDQ].buf, views[SLOPE].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

/* Whether every number in a column of an (., columns) array of int64 is one of 0 to limit - 1. */
static int within(const Py_buffer *view, const char *name, Py_ssize_t columns, Py_ssize_t column, Py_ssize_t limit)
{
    const int64_t *values = view->buf;
    for (Py_ssize_t i = column; i < view->shape[0] * columns; i += columns) {
        if (values[i] < 0 || values[i] >= limit) {
            PyErr_Format(PyExc_ValueError, "%s: %lld in column %zd, expected 0 to %zd", name, (long long)values[i],
                         column, limit - 1);
            return 0;
        }
    }
    return 1;
}

enum { PACKED, LINKS, SPHERES, PLANES, ON_PLANE, BOXES, ON_BOX, PAIRS, Q, RESULT, WEIGHT };

static const operand CLEARANCE_OPERANDS[] = {
    {"packed", 'd', 1, 0},   {"links", 'q', 1, 0},  {"spheres", 'd', 2, 0}, {"planes", 'd', 2, 0},
    {"on_plane", 'q', 2, 0}, {"boxes", 'd', 2, 0},  {"on_box", 'q', 2, 0},  {"pairs", 'q', 2, 0},
    {"q", 'd', 2, 0},        {"result", 'd', 2, 1}, {"weight", 'd', 2, 0}};

/* Fill in what the spheres must not touch. Returns the number of joints, or -1. */
static int read_obstacles(const Py_buffer *views, obstacles *around)
{
    const operand *wanted = CLEARANCE_OPERANDS;
    const int n = joints_of(views + PACKED, views[Q].shape[1]);
    const Py_ssize_t spheres = views[LINKS].shape[0];
    const int fits =
        n > 0 && HAS_SHAPE(views + SPHERES, wanted + SPHERES, spheres, 4)
        && HAS_SHAPE(views + PLANES, wanted + PLANES, views[PLANES].shape[0], 4)
        && HAS_SHAPE(views + BOXES, wanted + BOXES, views[BOXES].shape[0], BOX_NUMBERS)
        && HAS_SHAPE(views + ON_PLANE, wanted + ON_PLANE, views[ON_PLANE].shape[0], 2)
        && HAS_SHAPE(views + ON_BOX, wanted + ON_BOX, views[ON_BOX].shape[0], 2)
        && HAS_SHAPE(views + PAIRS, wanted + PAIRS, views[PAIRS].shape[0], 2)
        && within(views + LINKS, "links", 1, 0, n + 1) && within(views + ON_PLANE, "on_plane", 2, 0, spheres)
        && within(views + ON_PLANE, "on_plane", 2, 1, views[PLANES].shape[0])
        && within(views + ON_BOX, "on_box", 2, 0, spheres)
        && within(views + ON_BOX, "on_box", 2, 1, views[BOXES].shape[0])
        && within(views + PAIRS, "pairs", 2, 0, spheres) && within(views + PAIRS, "pairs", 2, 1, spheres);
    if (!fits) {
        return -1;
    }
    *around = (obstacles){
        .spheres = spheres,
        .link = views[LINKS].buf,
        .sphere = views[SPHERES].buf,
        .plane = views[PLANES].buf,
        .on_planes = views[ON_PLANE].shape[0],
        .on_plane = views[ON_PLANE].buf,
        .box = views[BOXES].buf,
        .on_boxes = views[ON_BOX].shape[0],
        .on_box = views[ON_BOX].buf,
        .pairs = views[PAIRS].shape[0],
        .pair = views[PAIRS].buf,
    };
    return n;
}

PyDoc_STRVAR(clearances_doc,
             "clearances_into(packed, links, spheres, planes, on_plane, boxes, on_box, pairs, q, out, /)\n--\n\n"
             "Distances of spheres from half-spaces, boxes and each other.");

static PyObject *clearances_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { COUNT = RESULT + 1 };
    const operand *wanted = CLEARANCE_OPERANDS;
    Py_buffer views[COUNT];
    obstacles around;
    int n, fits, done = 0;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = read_obstacles(views, &around);
    fits = n > 0
           && HAS_SHAPE(views + RESULT, wanted + RESULT, samples, around.on_planes + around.on_boxes + around.pairs);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        done = batch->clearances(views[PACKED].buf, n, &around, samples, views[Q].buf, views[RESULT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    if (done < 0) {
        return PyErr_NoMemory();
    }
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(clearance_slope_doc, "clearance_slope_into(packed, links, spheres, planes, on_plane, boxes, on_box, "
                                  "pairs, q, slope, weight, /)\n--\n\n"
                                  "Derivative of the weighted sum of all clearances by q.");

static PyObject *clearance_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { COUNT = WEIGHT + 1 };
    const operand *wanted = CLEARANCE_OPERANDS;
    Py_buffer views[COUNT];
    obstacles around;
    int n, fits, done = 0;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t samples = views[Q].shape[0];
    n = read_obstacles(views, &around);
    fits = n > 0 && HAS_SHAPE(views + RESULT, wanted + RESULT, samples, n)
           && HAS_SHAPE(views + WEIGHT, wanted + WEIGHT, samples, around.on_planes + around.on_boxes + around.pairs);
    if (fits) {
        Py_BEGIN_ALLOW_THREADS
        done = batch->clearance_slope(views[PACKED].buf, n, &around, views[WEIGHT].buf, samples, views[Q].buf,
                                      views[RESULT].buf);
        Py_END_ALLOW_THREADS
    }
    close_operands(views, COUNT);
    if (done < 0) {
        return PyErr_NoMemory();
    }
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(sine_cosine_doc, "sine_cosine_into(angle, sine, cosine, /)\n--\n\n"
                              "Sine and cosine as the batch kernels compute them.");

static PyObject *sine_cosine_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ANGLE, SINE, COSINE, COUNT };
    static const operand wanted[COUNT] = {{"angle", 'd', 1, 0}, {"sine", 'd', 1, 1}, {"cosine", 'd', 1, 1}};
    Py_buffer views[COUNT];
    int fits;
    (void)module;
    if (open_operands(args, given, wanted, COUNT, views) < 0) {
        return NULL;
    }
    const Py_ssize_t count = views[ANGLE].shape[0];
    fits = HAS_SHAPE(views + SINE, wanted + SINE, count) && HAS_SHAPE(views + COSINE, wanted + COSINE, count);
    if (fits) {
        batch->sine_cosine(count, views[ANGLE].buf, views[SINE].buf, views[COSINE].buf);
    }
    close_operands(views, COUNT);
    return fits ? Py_NewRef(Py_None) : NULL;
}

PyDoc_STRVAR(variants_doc, "variants()\n--\n\n"
                           "Names of the batch kernels that this processor can run, the fastest first.");

static PyObject *variants(PyObject *module, PyObject *unused)
{
    PyObject *names = PyList_New(0);
    (void)module;
    (void)unused;
    for (const batch_kernels *const *one = batch_variants(); names && *one; one++) {
        PyObject *name = PyUnicode_FromString((*one)->name);
        if (!name || PyList_Append(names, name) < 0) {
            Py_CLEAR(names);
        }
        Py_XDECREF(name);
    }
    return names;
}

PyDoc_STRVAR(use_variant_doc, "use_variant(name, /)\n--\n\n"
                              "Choose batch kernels by name, for the whole process: for tests and benchmarks.");

static PyObject *use_variant(PyObject *module, PyObject *name)
{
    (void)module;
    if (!PyUnicode_Check(name)) {
        PyErr_SetString(PyExc_TypeError, "expected the name of a variant");
        return NULL;
    }
    for (const batch_kernels *const *one = batch_variants(); *one; one++) {
        if (PyUnicode_CompareWithASCIIString(name, (*one)->name) == 0) {
            batch = *one;
            Py_RETURN_NONE;
        }
    }
    PyErr_Format(PyExc_ValueError, "%R is none of the variants that this processor can run", name);
    return NULL;
}

static PyMethodDef FUNCTIONS[] = {
    {"regressor_into", FASTCALL(regressor_into), METH_FASTCALL, regressor_doc},
    {"body_regressor_into", FASTCALL(body_regressor_into), METH_FASTCALL, body_regressor_doc},
    {"payload_torque_into", FASTCALL(payload_torque_into), METH_FASTCALL, payload_torque_doc},
    {"arm_torque_into", FASTCALL(arm_torque_into), METH_FASTCALL, arm_torque_doc},
    {"arm_torque_slope_into", FASTCALL(arm_torque_slope_into), METH_FASTCALL, arm_torque_slope_doc},
    {"information_into", FASTCALL(information_into), METH_FASTCALL, information_doc},
    {"information_slope_into", FASTCALL(information_slope_into), METH_FASTCALL, information_slope_doc},
    {"clearances_into", FASTCALL(clearances_into), METH_FASTCALL, clearances_doc},
    {"clearance_slope_into", FASTCALL(clearance_slope_into), METH_FASTCALL, clearance_slope_doc},
    {"sine_cosine_into", FASTCALL(sine_cosine_into), METH_FASTCALL, sine_cosine_doc},
    {"variants", variants, METH_NOARGS, variants_doc},
    {"use_variant", use_variant, METH_O, use_variant_doc},
    {NULL, NULL, 0, NULL}};

/* ------------------------------------------------------------------------------------------ PayloadTorque */

enum { MOST_MODEL_NUMBERS = 15 + 21 * MOST_JOINTS + BODY_PARAMETERS };

/* All of it is touched with the interpreter's lock held, which is what makes a change from another thread whole. */
typedef struct {
    PyObject_HEAD
    int n; /* 0 before __init__ */
    double model[MOST_MODEL_NUMBERS];
    double from[BODY_PARAMETERS], to[BODY_PARAMETERS]; /* the ends of a change */
    Py_ssize_t calls, left;                            /* that it takes, that are left of it */
    PyObject *torque;                                  /* the array that is handed out */
    Py_buffer torque_view;
} payload_torque_object;

static void let_go_of_torque(payload_torque_object *self)
{
    self->n = 0;
    if (self->torque) {
        PyBuffer_Release(&self->torque_view);
        Py_CLEAR(self->torque);
    }
}

static int payload_torque_init(PyObject *object, PyObject *args, PyObject *keywords)
{
    static const operand wanted[] = {{"model", 'd', 1, 0}, {"torque", 'd', 1, 1}};
    payload_torque_object *self = (payload_torque_object *)object;
    PyObject *model, *torque;
    Py_buffer model_view;
    if (keywords && PyDict_Size(keywords) != 0) {
        PyErr_SetString(PyExc_TypeError, "PayloadTorque takes no keywords");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "OO", &model, &torque)) {
        return -1;
    }
    let_go_of_torque(self);
    if (open_operand(model, wanted, &model_view) < 0) {
        return -1;
    }
    if (open_operand(torque, wanted + 1, &self->torque_view) < 0) {
        PyBuffer_Release(&model_view);
        return -1;
    }
    self->torque = Py_NewRef(torque);
    const Py_ssize_t n = self->torque_view.shape[0], numbers = model_view.shape[0];
    const int fits = n > 0 && n <= MOST_JOINTS && numbers == packed_length((int)n) + BODY_PARAMETERS;
    if (fits) {
        memcpy(self->model, model_view.buf, (size_t)numbers * sizeof(double));
        self->calls = self->left = 0;
        self->n = (int)n;
    } else {
        PyErr_Format(PyExc_ValueError, "a model of %zd numbers for %zd joints; expected 1 to %d joints and 25 numbers "
                     "and 21 for each of them", numbers, n, MOST_JOINTS);
        let_go_of_torque(self);
    }
    PyBuffer_Release(&model_view);
    return fits ? 0 : -1;
}

static void payload_torque_free(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    let_go_of_torque((payload_torque_object *)object);
    release(object);
    Py_DECREF(type);
}

/* n numbers from any one-dimensional array of float64. Returns 1, 0 where it is of another kind, -1 with an error. */
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
        if (view.strides[0] == sizeof(double)) {
            memcpy(row, view.buf, (size_t)n * sizeof(double));
        } else {
            for (int i = 0; i < n; i++) {
                memcpy(row + i, (const char *)view.buf + i * view.strides[0], sizeof(double));
            }
        }
    } else if (found < 0) {
        PyErr_SetString(PyExc_ValueError,
                        "position, velocity and acceleration must have one number per joint of the chain");
    }
    PyBuffer_Release(&view);
    return found;
}

/* The same from anything that numpy.array takes. Returns 0 or -1. */
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

static PyObject *payload_torque_nm(PyObject *object, PyObject *const *args, Py_ssize_t given)
{
    payload_torque_object *self = (payload_torque_object *)object;
    double state[3][MOST_JOINTS];
    if (given != 3 || self->n == 0) {
        PyErr_SetString(PyExc_TypeError, given != 3 ? "expected position, velocity and acceleration"
                                                    : "PayloadTorque.__init__ was not called");
        return NULL;
    }
    const int n = self->n;
    for (int k = 0; k < 3; k++) {
        const int found = read_row(args[k], n, state[k]);
        if (found < 0 || (found == 0 && read_anything(args[k], n, state[k]) < 0)) {
            return NULL;
        }
    }
    if (n != self->n) {
        PyErr_SetString(PyExc_RuntimeError, "PayloadTorque.__init__ was called during a call");
        return NULL;
    }
    if (self->left) {
        advance_change(self);
    }
    payload_torque(self->model, n, state[0], state[1], state[2], self->torque_view.buf);
    return Py_NewRef(self->torque);
}

PyDoc_STRVAR(change_doc, "change_parameters($self, theta, calls, /)\n--\n\n"
                         "Go to other parameters over a number of calls, with rest at both ends.");

static PyObject *payload_torque_change(PyObject *object, PyObject *args)
{
    static const operand wanted = {"theta", 'd', 1, 0};
    payload_torque_object *self = (payload_torque_object *)object;
    PyObject *theta;
    Py_ssize_t calls;
    Py_buffer view;
    if (!PyArg_ParseTuple(args, "On", &theta, &calls) || open_operand(theta, &wanted, &view) < 0) {
        return NULL;
    }
    const int fits = self->n > 0 && view.shape[0] == BODY_PARAMETERS && calls >= 1;
    if (fits) {
        memcpy(self->from, self->model + packed_length(self->n), sizeof self->from);
        memcpy(self->to, view.buf, sizeof self->to);
        self->calls = self->left = calls;
    } else {
        PyErr_Format(PyExc_ValueError, "%zd parameters over %zd calls; expected %d over at least one", view.shape[0],
                     calls, BODY_PARAMETERS);
    }
    PyBuffer_Release(&view);
    return fits ? Py_NewRef(Py_None) : NULL;
}

static PyMethodDef PAYLOAD_TORQUE_METHODS[] = {
    {"torque_nm", FASTCALL(payload_torque_nm), METH_FASTCALL, torque_nm_doc},
    {"change_parameters", payload_torque_change, METH_VARARGS, change_doc},
    {NULL, NULL, 0, NULL}};

PyDoc_STRVAR(payload_torque_type_doc, "PayloadTorque(model, torque, /)\n--\n\n"
                                      "Torque of a payload for one state after the other, into the array `torque`.");

static PyType_Slot PAYLOAD_TORQUE_SLOTS[] = {{Py_tp_doc, (void *)payload_torque_type_doc},
                                             {Py_tp_new, (void *)PyType_GenericNew},
                                             {Py_tp_init, (void *)payload_torque_init},
                                             {Py_tp_dealloc, (void *)payload_torque_free},
                                             {Py_tp_methods, PAYLOAD_TORQUE_METHODS},
                                             {0, NULL}};

static PyType_Spec PAYLOAD_TORQUE_SPEC = {.name = "armload_core.kernels.PayloadTorque",
                                          .basicsize = sizeof(payload_torque_object),
                                          .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                                          .slots = PAYLOAD_TORQUE_SLOTS};

/* --------------------------------------------------------------------------------------------- ServoLoops */

enum { PARAMETER, STATE, TO_AXIS, POSITION, VELOCITY, LINK_TORQUE, APPLIED, FRICTION, SERVO_ARRAYS };

static const operand SERVO_OPERANDS[SERVO_ARRAYS] = {
    {"parameter", 'd', 2, 0}, {"state", 'd', 2, 1},       {"to_axis", 'd', 2, 0}, {"position", 'd', 1, 0},
    {"velocity", 'd', 1, 0},  {"link_torque", 'd', 1, 0}, {"applied", 'd', 1, 1}, {"friction", 'd', 1, 1}};

typedef struct {
    PyObject_HEAD
    servo_loops loops; /* n is 0 before __init__ */
    double greatest_speed_rad_s;
    Py_buffer views[SERVO_ARRAYS];
} servo_loops_object;

static void let_go_of_arrays(servo_loops_object *self)
{
    if (self->loops.n) {
        close_operands(self->views, SERVO_ARRAYS);
    }
    self->loops.n = 0;
}

static int servo_loops_init(PyObject *object, PyObject *args, PyObject *keywords)
{
    servo_loops_object *self = (servo_loops_object *)object;
    const operand *wanted = SERVO_OPERANDS;
    Py_buffer *views = self->views;
    PyObject *arrays[SERVO_ARRAYS];
    double speed;
    if (keywords && PyDict_Size(keywords) != 0) {
        PyErr_SetString(PyExc_TypeError, "ServoLoops takes no keywords");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "OOOOOOOOd", arrays, arrays + 1, arrays + 2, arrays + 3, arrays + 4, arrays + 5,
                          arrays + 6, arrays + 7, &speed)) {
        return -1;
    }
    let_go_of_arrays(self);
    if (open_operands(arrays, SERVO_ARRAYS, wanted, SERVO_ARRAYS, views) < 0) {
        return -1;
    }
    const Py_ssize_t n = views[TO_AXIS].shape[0], width = views[POSITION].shape[0];
    const Py_ssize_t hinges = n > 0 ? width / n : 0;
    int fits = n > 0 && n <= MOST_JOINTS && hinges > 0 && hinges <= INT_MAX && width == n * hinges;
    if (!fits) {
        PyErr_Format(PyExc_ValueError, "%zd hinges for %zd joints; expected 1 to %d joints and the same number of "
                     "hinges for each", width, n, MOST_JOINTS);
    }
    fits = fits && HAS_SHAPE(views + PARAMETER, wanted + PARAMETER, SERVO_PARAMETERS, n)
           && HAS_SHAPE(views + STATE, wanted + STATE, SERVO_STATES, n)
           && HAS_SHAPE(views + TO_AXIS, wanted + TO_AXIS, n, n);
    for (int k = VELOCITY; fits && k < SERVO_ARRAYS; k++) {
        fits = HAS_SHAPE(views + k, wanted + k, width);
    }
    if (!fits) {
        close_operands(views, SERVO_ARRAYS);
        return -1;
    }
    self->greatest_speed_rad_s = speed;
    self->loops = (servo_loops){
        .n = (int)n,
        .hinges = (int)hinges,
        .parameter = views[PARAMETER].buf,
        .state = views[STATE].buf,
        .to_axis = views[TO_AXIS].buf,
        .position = views[POSITION].buf,
        .velocity = views[VELOCITY].buf,
        .link_torque = views[LINK_TORQUE].buf,
        .applied = views[APPLIED].buf,
        .friction = views[FRICTION].buf,
    };
    return 0;
}

static void servo_loops_free(PyObject *object)
{
    PyTypeObject *type = Py_TYPE(object);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    let_go_of_arrays((servo_loops_object *)object);
    release(object);
    Py_DECREF(type);
}

PyDoc_STRVAR(step_doc, "step($self, number, /)\n--\n\n"
                       "Close all loops once; False where the simulation has diverged.");

static PyObject *servo_loops_step(PyObject *object, PyObject *number)
{
    servo_loops_object *self = (servo_loops_object *)object;
    const double step = PyFloat_AsDouble(number);
    if (step == -1.0 && PyErr_Occurred()) {
        return NULL;
    }
    return PyBool_FromLong(servo_step(&self->loops, step, self->greatest_speed_rad_s));
}

PyDoc_STRVAR(setpoint_doc, "setpoint($self, axis, number, /)\n--\n\n"
                           "Setpoint of an axis at a step, in rad.");

static PyObject *servo_loops_setpoint(PyObject *object, PyObject *args)
{
    servo_loops_object *self = (servo_loops_object *)object;
    int axis;
    double step;
    if (!PyArg_ParseTuple(args, "id", &axis, &step)) {
        return NULL;
    }
    if (axis < 0 || axis >= self->loops.n) {
        PyErr_Format(PyExc_IndexError, "axis %d of %d", axis, self->loops.n);
        return NULL;
    }
    return PyFloat_FromDouble(servo_setpoint(&self->loops, axis, step));
}

static PyMethodDef SERVO_LOOPS_METHODS[] = {{"step", servo_loops_step, METH_O, step_doc},
                                            {"setpoint", servo_loops_setpoint, METH_VARARGS, setpoint_doc},
                                            {NULL, NULL, 0, NULL}};

PyDoc_STRVAR(servo_loops_type_doc,
             "ServoLoops(parameter, state, to_axis, position, velocity, link_torque, applied, friction, "
             "greatest_speed_rad_s, /)\n--\n\n"
             "The servo loops of a simulated arm over arrays that they share with it.");

static PyType_Slot SERVO_LOOPS_SLOTS[] = {{Py_tp_doc, (void *)servo_loops_type_doc},
                                          {Py_tp_new, (void *)PyType_GenericNew},
                                          {Py_tp_init, (void *)servo_loops_init},
                                          {Py_tp_dealloc, (void *)servo_loops_free},
                                          {Py_tp_methods, SERVO_LOOPS_METHODS},
                                          {0, NULL}};

static PyType_Spec SERVO_LOOPS_SPEC = {.name = "armload_core.kernels.ServoLoops",
                                       .basicsize = sizeof(servo_loops_object),
                                       .flags = Py_TPFLAGS_DEFAULT,
                                       .slots = SERVO_LOOPS_SLOTS};

/* ------------------------------------------------------------------------------------------------- module */

static int add_type(PyObject *module, const char *name, PyType_Spec *spec)
{
    PyObject *type = PyType_FromSpec(spec);
    const int done = type ? PyModule_AddObjectRef(module, name, type) : -1;
    Py_XDECREF(type);
    return done;
}

static int fill_module(PyObject *module)
{
#define ADD_ROW(name)                                                                                                 \
    if (PyModule_AddIntConstant(module, "SERVO_" #name, SERVO_##name) < 0) {                                          \
        return -1;                                                                                                    \
    }
    SERVO_PARAMETER_ROWS(ADD_ROW)
    SERVO_STATE_ROWS(ADD_ROW)
    ADD_ROW(PARAMETERS)
    ADD_ROW(STATES)
#undef ADD_ROW
    if (PyModule_AddIntConstant(module, "MOST_JOINTS", MOST_JOINTS) < 0
        || PyModule_AddIntConstant(module, "BODY_PARAMETERS", BODY_PARAMETERS) < 0
        || PyModule_AddIntConstant(module, "BOX_NUMBERS", BOX_NUMBERS) < 0
        || add_type(module, "PayloadTorque", &PAYLOAD_TORQUE_SPEC) < 0
        || add_type(module, "ServoLoops", &SERVO_LOOPS_SPEC) < 0) {
        return -1;
    }
    batch = *batch_variants();
    return 0;
}

static PyModuleDef_Slot MODULE_SLOTS[] = {{Py_mod_exec, (void *)fill_module}, {0, NULL}};

static struct PyModuleDef MODULE = {
    PyModuleDef_HEAD_INIT,
    .m_name = "kernels",
    .m_doc = "The compiled kernels; kernels.pyi has their types, source/ the C.",
    .m_methods = FUNCTIONS,
    .m_slots = MODULE_SLOTS,
};

PyMODINIT_FUNC PyInit_kernels(void)
{
    return PyModuleDef_Init(&MODULE);
}
