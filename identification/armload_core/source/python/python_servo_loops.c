/* The Python type ServoLoops: the servo loops of a simulated arm on arrays shared with Python. */

#include <limits.h>

#include "chain.h"
#include "python_types.h"
#include "scalar/servo_loops.h"

enum { PARAMETER, STATE, TO_AXIS, POSITION, VELOCITY, LINK_TORQUE, APPLIED, FRICTION, ARRAYS };

typedef struct {
    PyObject_HEAD servo_loops loops; /* n is 0 before __init__ */
    double greatest_speed_rad_s;
    Py_buffer views[ARRAYS];
} servo_loops_object;

static int init(PyObject *object, PyObject *args, PyObject *keywords)
{
    static const operand wanted[ARRAYS] = {{"parameter", 'd', 0, 2, {SERVO_PARAMETERS, JOINTS}},
                                           {"state", 'd', 1, 2, {SERVO_STATES, JOINTS}},
                                           {"to_axis", 'd', 0, 2, {JOINTS, JOINTS}},
                                           {"position", 'd', 0, 1, {HINGES}},
                                           {"velocity", 'd', 0, 1, {HINGES}},
                                           {"link_torque", 'd', 0, 1, {HINGES}},
                                           {"applied", 'd', 1, 1, {HINGES}},
                                           {"friction", 'd', 1, 1, {HINGES}}};
    servo_loops_object *self = (servo_loops_object *)object;
    PyObject *arrays[ARRAYS];
    Py_buffer *views = self->views;
    sizes found;
    double speed;
    if (self->loops.n != 0 || (keywords && PyDict_Size(keywords) != 0)) {
        PyErr_SetString(PyExc_TypeError, "ServoLoops is made once, and takes no keywords");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "OOOOOOOOd", arrays, arrays + 1, arrays + 2, arrays + 3, arrays + 4, arrays + 5,
                          arrays + 6, arrays + 7, &speed)
        || open_arrays(arrays, ARRAYS, wanted, ARRAYS, views, &found) < 0) {
        return -1;
    }
    const Py_ssize_t hinges = found.hinges / found.joints;
    if (hinges < 1 || hinges > INT_MAX / MOST_JOINTS || hinges * found.joints != found.hinges) {
        PyErr_Format(PyExc_ValueError, "%zd hinges for %d joints; expected the same number for each", found.hinges,
                     found.joints);
        close_arrays(views, ARRAYS);
        return -1;
    }
    self->greatest_speed_rad_s = speed;
    self->loops = (servo_loops){
        .n = found.joints,
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

static void dealloc(PyObject *object)
{
    servo_loops_object *self = (servo_loops_object *)object;
    PyTypeObject *type = Py_TYPE(object);
    const freefunc release = (freefunc)PyType_GetSlot(type, Py_tp_free);
    if (self->loops.n != 0) {
        close_arrays(self->views, ARRAYS);
    }
    release(object);
    Py_DECREF(type);
}

PyDoc_STRVAR(step_doc, "step($self, number, /)\n--\n\n"
                       "Close all loops once; False where the simulation has diverged.");

static PyObject *step(PyObject *object, PyObject *number)
{
    servo_loops_object *self = (servo_loops_object *)object;
    const double count = PyFloat_AsDouble(number);
    if (count == -1.0 && PyErr_Occurred()) {
        return NULL;
    }
    return PyBool_FromLong(servo_step(&self->loops, count, self->greatest_speed_rad_s));
}

static int has_axis(const servo_loops_object *self, int axis)
{
    if (axis < 0 || axis >= self->loops.n) {
        PyErr_Format(PyExc_IndexError, "axis %d of %d", axis, self->loops.n);
        return 0;
    }
    return 1;
}

PyDoc_STRVAR(setpoint_doc, "setpoint($self, axis, number, /)\n--\n\n"
                           "Setpoint of an axis at a step, in rad.");

static PyObject *setpoint(PyObject *object, PyObject *args)
{
    servo_loops_object *self = (servo_loops_object *)object;
    int axis;
    double count;
    if (!PyArg_ParseTuple(args, "id", &axis, &count) || !has_axis(self, axis)) {
        return NULL;
    }
    return PyFloat_FromDouble(servo_setpoint(&self->loops, axis, count));
}

PyDoc_STRVAR(position_doc, "position($self, axis, number, /)\n--\n\n"
                           "Position of an axis at a step as its encoder has it, in rad.");

static PyObject *position(PyObject *object, PyObject *args)
{
    servo_loops_object *self = (servo_loops_object *)object;
    int axis;
    double count;
    if (!PyArg_ParseTuple(args, "id", &axis, &count) || !has_axis(self, axis)) {
        return NULL;
    }
    return PyFloat_FromDouble(servo_position(&self->loops, axis, count));
}

PyDoc_STRVAR(ramp_doc, "ramp($self, axis, number, position, steps, slowing, /)\n--\n\n"
                       "From a step on, let an axis's setpoint go from where it is to a position.");

static PyObject *ramp(PyObject *object, PyObject *args)
{
    servo_loops_object *self = (servo_loops_object *)object;
    int axis, slowing;
    double count, position, steps;
    if (!PyArg_ParseTuple(args, "idddp", &axis, &count, &position, &steps, &slowing) || !has_axis(self, axis)) {
        return NULL;
    }
    servo_ramp(&self->loops, axis, count, position, steps, slowing);
    Py_RETURN_NONE;
}

PyDoc_STRVAR(measure_doc, "measure($self, number, out, /)\n--\n\n"
                          "What all axes and joints do at a step, into (SERVO_MEASUREMENTS, n).");

static PyObject *measure(PyObject *object, PyObject *args)
{
    static const operand wanted[] = {{"out", 'd', 1, 2, {SERVO_MEASUREMENTS, JOINTS}}};
    servo_loops_object *self = (servo_loops_object *)object;
    PyObject *out;
    Py_buffer view;
    sizes found;
    double count;
    if (!PyArg_ParseTuple(args, "dO", &count, &out) || open_arrays(&out, 1, wanted, 1, &view, &found) < 0) {
        return NULL;
    }
    if (found.joints != self->loops.n) {
        PyErr_Format(PyExc_ValueError, "out: axis 1 has the length %d, expected %d", found.joints, self->loops.n);
        PyBuffer_Release(&view);
        return NULL;
    }
    servo_measure(&self->loops, count, view.buf);
    PyBuffer_Release(&view);
    Py_RETURN_NONE;
}

static PyMethodDef METHODS[] = {{"step", step, METH_O, step_doc},
                                {"setpoint", setpoint, METH_VARARGS, setpoint_doc},
                                {"position", position, METH_VARARGS, position_doc},
                                {"ramp", ramp, METH_VARARGS, ramp_doc},
                                {"measure", measure, METH_VARARGS, measure_doc},
                                {NULL, NULL, 0, NULL}};

PyDoc_STRVAR(type_doc, "ServoLoops(parameter, state, to_axis, position, velocity, link_torque, applied, friction, "
                       "greatest_speed_rad_s, /)\n--\n\n"
                       "The servo loops of a simulated arm over arrays that they share with it.");

static PyType_Slot SLOTS[] = {{Py_tp_doc, (void *)type_doc}, {Py_tp_new, (void *)PyType_GenericNew},
                              {Py_tp_init, (void *)init},    {Py_tp_dealloc, (void *)dealloc},
                              {Py_tp_methods, METHODS},      {0, NULL}};

PyType_Spec SERVO_LOOPS_SPEC = {.name = "armload_core.kernels.ServoLoops",
                                .basicsize = sizeof(servo_loops_object),
                                .flags = Py_TPFLAGS_DEFAULT,
                                .slots = SLOTS};
