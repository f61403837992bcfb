/* The Python module `armload_core.kernels`; its types are in `kernels.pyi`. */

#include "instruction_sets/batch.h"
#include "chain.h"
#include "estimator/payload_estimator.h"
#include "scalar/joint_messages.h"
#include "python_types.h"
#include "scalar/servo_loops.h"

const batch_kernels *batch;

/* clang-format off */
#define CHAIN {"packed", 'd', 0, 1, {PACKED}}
#define STATES                                                                                                        \
    {"q", 'd', 0, 2, {SAMPLES, JOINTS}}, {"dq", 'd', 0, 2, {SAMPLES, JOINTS}}, {"ddq", 'd', 0, 2, {SAMPLES, JOINTS}}
/* clang-format on */

PyDoc_STRVAR(payload_regressor_doc, "payload_regressor_into(packed, q, dq, ddq, out, /)\n--\n\n"
                                    "Regressor of a body on the flange.");

static PyObject *payload_regressor_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {CHAIN, STATES, {"out", 'd', 1, 3, {SAMPLES, JOINTS, BODY_PARAMETERS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    Py_BEGIN_ALLOW_THREADS batch->payload_regressor(views[ARM].buf, size.joints, size.samples, views[Q].buf,
                                                    views[DQ].buf, views[DDQ].buf, views[OUT].buf);
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(body_regressor_doc, "body_regressor_into(packed, q, dq, ddq, out, /)\n--\n\n"
                                 "Regressors of all links side by side.");

static PyObject *body_regressor_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {CHAIN, STATES, {"out", 'd', 1, 3, {SAMPLES, JOINTS, TEN_PER_JOINT}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    Py_BEGIN_ALLOW_THREADS batch->body_regressor(views[ARM].buf, size.joints, size.samples, views[Q].buf, views[DQ].buf,
                                                 views[DDQ].buf, views[OUT].buf);
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(payload_torque_doc, "payload_torque_into(model, q, dq, ddq, out, /)\n--\n\n"
                                 "Torque of a payload, sample by sample.");

static PyObject *payload_torque_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {{"model", 'd', 0, 1, {MODEL}}, STATES, {"out", 'd', 1, 2, {SAMPLES, JOINTS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    const double *q = views[Q].buf, *dq = views[DQ].buf, *ddq = views[DDQ].buf;
    double *out = views[OUT].buf;
    Py_BEGIN_ALLOW_THREADS for (Py_ssize_t t = 0; t < size.samples * size.joints; t += size.joints)
    {
        batch->payload_torque(views[ARM].buf, size.joints, q + t, dq + t, ddq + t, out + t);
    }
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(arm_torque_doc, "arm_torque_into(packed, links, q, dq, ddq, out, /)\n--\n\n"
                             "Torque of all links, given in the turned joint frames.");

static PyObject *arm_torque_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, LINKS, Q, DQ, DDQ, OUT, COUNT };
    static const operand wanted[COUNT] = {
        CHAIN, {"links", 'd', 0, 2, {JOINTS, BODY_PARAMETERS}}, STATES, {"out", 'd', 1, 2, {SAMPLES, JOINTS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    Py_BEGIN_ALLOW_THREADS batch->arm_torque(views[ARM].buf, size.joints, views[LINKS].buf, size.samples, views[Q].buf,
                                             views[DQ].buf, views[DDQ].buf, views[OUT].buf);
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(arm_torque_slope_doc, "arm_torque_slope_into(packed, links, weight, q, dq, ddq, slope, /)\n--\n\n"
                                   "Derivative of the weighted sum of all links' torques by q, dq, ddq.");

static PyObject *arm_torque_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, LINKS, WEIGHT, Q, DQ, DDQ, SLOPE, COUNT };
    static const operand wanted[COUNT] = {CHAIN,
                                          {"links", 'd', 0, 2, {JOINTS, BODY_PARAMETERS}},
                                          {"weight", 'd', 0, 2, {SAMPLES, JOINTS}},
                                          STATES,
                                          {"slope", 'd', 1, 3, {3, SAMPLES, JOINTS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    Py_BEGIN_ALLOW_THREADS batch->arm_torque_slope(views[ARM].buf, size.joints, views[LINKS].buf, views[WEIGHT].buf,
                                                   size.samples, views[Q].buf, views[DQ].buf, views[DDQ].buf,
                                                   views[SLOPE].buf);
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(regressor_slope_doc, "regressor_slope_into(packed, bodies, q, dq, ddq, slope, /)\n--\n\n"
                                  "Derivative of the sum of all products of regressor and bodies by q, dq, ddq.");

static PyObject *regressor_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ARM, BODIES, Q, DQ, DDQ, SLOPE, COUNT };
    static const operand wanted[COUNT] = {CHAIN,
                                          {"bodies", 'd', 0, 3, {SAMPLES, JOINTS, BODY_PARAMETERS}},
                                          STATES,
                                          {"slope", 'd', 1, 3, {3, SAMPLES, JOINTS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    Py_BEGIN_ALLOW_THREADS batch->regressor_slope(views[ARM].buf, size.joints, views[BODIES].buf, size.samples,
                                                  views[Q].buf, views[DQ].buf, views[DDQ].buf, views[SLOPE].buf);
    Py_END_ALLOW_THREADS close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

/* Whether all values in one column of an int64 array (., columns) lie within 0 to limit - 1. */
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

/* Leading arguments of both clearance functions. */
/* clang-format off */
#define OBSTACLES                                                                                                     \
    CHAIN, {"links", 'q', 0, 1, {ANY}}, {"spheres", 'd', 0, 2, {ANY, 4}}, {"planes", 'd', 0, 2, {ANY, 4}},            \
    {"on_plane", 'q', 0, 2, {ANY, 2}}, {"boxes", 'd', 0, 2, {ANY, BOX_NUMBERS}}, {"on_box", 'q', 0, 2, {ANY, 2}},     \
    {"pairs", 'q', 0, 2, {ANY, 2}}, {"q", 'd', 0, 2, {SAMPLES, JOINTS}}
/* clang-format on */
enum { OF_ARM, OF_LINKS, OF_SPHERES, OF_PLANES, OF_ON_PLANE, OF_BOXES, OF_ON_BOX, OF_PAIRS, OF_Q, OF_OBSTACLES };

/* Fill in the collision geometry. Returns the number of clearances, or -1 with an exception set. */
static Py_ssize_t read_obstacles(const Py_buffer *views, int n, obstacles *around)
{
    const Py_ssize_t spheres = views[OF_LINKS].shape[0], planes = views[OF_PLANES].shape[0];
    const Py_ssize_t boxes = views[OF_BOXES].shape[0];
    if (views[OF_SPHERES].shape[0] != spheres) {
        PyErr_Format(PyExc_ValueError, "spheres: %zd rows for %zd links", views[OF_SPHERES].shape[0], spheres);
        return -1;
    }
    if (!within(views + OF_LINKS, "links", 1, 0, n + 1) || !within(views + OF_ON_PLANE, "on_plane", 2, 0, spheres)
        || !within(views + OF_ON_PLANE, "on_plane", 2, 1, planes) || !within(views + OF_ON_BOX, "on_box", 2, 0, spheres)
        || !within(views + OF_ON_BOX, "on_box", 2, 1, boxes) || !within(views + OF_PAIRS, "pairs", 2, 0, spheres)
        || !within(views + OF_PAIRS, "pairs", 2, 1, spheres)) {
        return -1;
    }
    *around = (obstacles){
        .spheres = spheres,
        .link = views[OF_LINKS].buf,
        .sphere = views[OF_SPHERES].buf,
        .plane = views[OF_PLANES].buf,
        .on_planes = views[OF_ON_PLANE].shape[0],
        .on_plane = views[OF_ON_PLANE].buf,
        .box = views[OF_BOXES].buf,
        .on_boxes = views[OF_ON_BOX].shape[0],
        .on_box = views[OF_ON_BOX].buf,
        .pairs = views[OF_PAIRS].shape[0],
        .pair = views[OF_PAIRS].buf,
    };
    return around->on_planes + around->on_boxes + around->pairs;
}

/* Whether an array (samples, K) has one column per clearance; 0 with an exception set if not. */
static int has_columns(const Py_buffer *view, const char *name, Py_ssize_t clearances)
{
    if (clearances >= 0 && view->shape[1] != clearances) {
        PyErr_Format(PyExc_ValueError, "%s: %zd columns, expected %zd", name, view->shape[1], clearances);
        return 0;
    }
    return clearances >= 0;
}

PyDoc_STRVAR(clearances_doc,
             "clearances_into(packed, links, spheres, planes, on_plane, boxes, on_box, pairs, q, out, /)\n--\n\n"
             "Distances of spheres from half-spaces, boxes and each other.");

static PyObject *clearances_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { OUT = OF_OBSTACLES, COUNT };
    static const operand wanted[COUNT] = {OBSTACLES, {"out", 'd', 1, 2, {SAMPLES, ANY}}};
    Py_buffer views[COUNT];
    sizes size;
    obstacles around;
    int done = -1;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    if (has_columns(views + OUT, "out", read_obstacles(views, size.joints, &around))) {
        Py_BEGIN_ALLOW_THREADS done =
            batch->clearances(views[OF_ARM].buf, size.joints, &around, size.samples, views[OF_Q].buf, views[OUT].buf);
        Py_END_ALLOW_THREADS if (done < 0)
        {
            PyErr_NoMemory();
        }
    }
    close_arrays(views, COUNT);
    return done < 0 ? NULL : Py_NewRef(Py_None);
}

PyDoc_STRVAR(clearance_slope_doc, "clearance_slope_into(packed, links, spheres, planes, on_plane, boxes, on_box, "
                                  "pairs, q, slope, weight, /)\n--\n\n"
                                  "Derivative of the weighted sum of all clearances by q.");

static PyObject *clearance_slope_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { SLOPE = OF_OBSTACLES, WEIGHT, COUNT };
    static const operand wanted[COUNT] = {
        OBSTACLES, {"slope", 'd', 1, 2, {SAMPLES, JOINTS}}, {"weight", 'd', 0, 2, {SAMPLES, ANY}}};
    Py_buffer views[COUNT];
    sizes size;
    obstacles around;
    int done = -1;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    if (has_columns(views + WEIGHT, "weight", read_obstacles(views, size.joints, &around))) {
        Py_BEGIN_ALLOW_THREADS done = batch->clearance_slope(views[OF_ARM].buf, size.joints, &around, views[WEIGHT].buf,
                                                             size.samples, views[OF_Q].buf, views[SLOPE].buf);
        Py_END_ALLOW_THREADS if (done < 0)
        {
            PyErr_NoMemory();
        }
    }
    close_arrays(views, COUNT);
    return done < 0 ? NULL : Py_NewRef(Py_None);
}

PyDoc_STRVAR(sine_cosine_doc, "sine_cosine_into(angle, sine, cosine, /)\n--\n\n"
                              "Sine and cosine as the kernels compute them.");

static PyObject *sine_cosine_into(PyObject *module, PyObject *const *args, Py_ssize_t given)
{
    enum { ANGLE, SINE, COSINE, COUNT };
    static const operand wanted[COUNT] = {{"angle", 'd', 0, 2, {SAMPLES, JOINTS}},
                                          {"sine", 'd', 1, 2, {SAMPLES, JOINTS}},
                                          {"cosine", 'd', 1, 2, {SAMPLES, JOINTS}}};
    Py_buffer views[COUNT];
    sizes size;
    (void)module;
    if (open_arrays(args, given, wanted, COUNT, views, &size) < 0) {
        return NULL;
    }
    batch->sine_cosine(size.samples * size.joints, views[ANGLE].buf, views[SINE].buf, views[COSINE].buf);
    close_arrays(views, COUNT);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(variants_doc, "variants()\n--\n\n"
                           "Instruction sets that the kernels can use on this processor, the fastest first.");

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
                              "Choose kernels by instruction set, for the whole process: for tests and benchmarks.");

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

PyDoc_STRVAR(joint_rows_doc, "joint_rows_into(records, at, channels, arrays, joints, table, /)\n--\n\n"
                             "Rows of numbers from the messages of a recording.");

static PyMethodDef FUNCTIONS[] = {
    {"payload_regressor_into", FASTCALL(payload_regressor_into), METH_FASTCALL, payload_regressor_doc},
    {"body_regressor_into", FASTCALL(body_regressor_into), METH_FASTCALL, body_regressor_doc},
    {"payload_torque_into", FASTCALL(payload_torque_into), METH_FASTCALL, payload_torque_doc},
    {"arm_torque_into", FASTCALL(arm_torque_into), METH_FASTCALL, arm_torque_doc},
    {"arm_torque_slope_into", FASTCALL(arm_torque_slope_into), METH_FASTCALL, arm_torque_slope_doc},
    {"regressor_slope_into", FASTCALL(regressor_slope_into), METH_FASTCALL, regressor_slope_doc},
    {"clearances_into", FASTCALL(clearances_into), METH_FASTCALL, clearances_doc},
    {"clearance_slope_into", FASTCALL(clearance_slope_into), METH_FASTCALL, clearance_slope_doc},
    {"sine_cosine_into", FASTCALL(sine_cosine_into), METH_FASTCALL, sine_cosine_doc},
    {"joint_rows_into", joint_rows_into, METH_VARARGS, joint_rows_doc},
    {"variants", variants, METH_NOARGS, variants_doc},
    {"use_variant", use_variant, METH_O, use_variant_doc},
    {NULL, NULL, 0, NULL}};

static int add_type(PyObject *module, const char *name, PyType_Spec *spec)
{
    PyObject *type = PyType_FromSpec(spec);
    const int done = type ? PyModule_AddObjectRef(module, name, type) : -1;
    Py_XDECREF(type);
    return done;
}

static int fill_module(PyObject *module)
{
#define ADD_ROW(name)                                                                                                  \
    if (PyModule_AddIntConstant(module, "SERVO_" #name, SERVO_##name) < 0) {                                           \
        return -1;                                                                                                     \
    }
    SERVO_PARAMETER_ROWS(ADD_ROW)
    SERVO_STATE_ROWS(ADD_ROW)
    SERVO_MEASURED_ROWS(ADD_ROW)
    ADD_ROW(PARAMETERS)
    ADD_ROW(STATES)
    ADD_ROW(MEASUREMENTS)
#undef ADD_ROW
#define ADD_ROW(name)                                                                                                  \
    if (PyModule_AddIntConstant(module, "ESTIMATOR_" #name, ESTIMATOR_##name) < 0) {                                   \
        return -1;                                                                                                     \
    }
    ESTIMATOR_PARAMETER_ROWS(ADD_ROW)
    ESTIMATOR_STATUS_ROWS(ADD_ROW)
    ADD_ROW(PARAMETERS)
    ADD_ROW(STATUS)
#undef ADD_ROW
    if (PyModule_AddIntConstant(module, "MOST_JOINTS", MOST_JOINTS) < 0
        || PyModule_AddIntConstant(module, "MOST_JOINTS_OF_A_MESSAGE", MOST_JOINTS_OF_A_MESSAGE) < 0
        || PyModule_AddIntConstant(module, "BODY_PARAMETERS", BODY_PARAMETERS) < 0
        || PyModule_AddIntConstant(module, "BOX_NUMBERS", BOX_NUMBERS) < 0
        || add_type(module, "PayloadTorque", &PAYLOAD_TORQUE_SPEC) < 0
        || PyModule_AddIntConstant(module, "REMEMBERED_ROWS", REMEMBERED_ROWS) < 0
        || add_type(module, "PayloadEstimator", &PAYLOAD_ESTIMATOR_SPEC) < 0
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
    .m_doc = "Kernels over arrays; kernels.pyi has their types, source/ the C.",
    .m_methods = FUNCTIONS,
    .m_slots = MODULE_SLOTS,
};

PyMODINIT_FUNC PyInit_kernels(void)
{
    return PyModuleDef_Init(&MODULE);
}
