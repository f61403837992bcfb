#include "python_arrays.h"

#include "chain.h"

int has_type(const Py_buffer *view, char type)
{
    const char *format = view->format ? view->format : "B";
    if (format[0] == '\0' || format[1] != '\0') {
        return 0;
    }
    return format[0] == type || (type == 'q' && format[0] == 'l' && view->itemsize == 8);
}

static int open_array(PyObject *value, const operand *wanted, Py_buffer *view)
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

void close_arrays(Py_buffer *views, Py_ssize_t count)
{
    for (Py_ssize_t k = 0; k < count; k++) {
        PyBuffer_Release(views + k);
    }
}

static Py_ssize_t length_of(int axis, const sizes *found)
{
    switch (axis) {
    case SAMPLES:
        return found->samples;
    case JOINTS:
        return found->joints;
    case HINGES:
        return found->hinges;
    case TEN_PER_JOINT:
        return BODY_PARAMETERS * found->joints;
    case PACKED:
        return packed_length(found->joints);
    case MODEL:
        return packed_length(found->joints) + BODY_PARAMETERS;
    default:
        return axis;
    }
}

/* Find the sizes from which the lengths of all other axes follow. */
static int find_sizes(const operand *wanted, Py_ssize_t count, const Py_buffer *views, sizes *found)
{
    Py_ssize_t joints = -1;
    *found = (sizes){.samples = -1, .hinges = -1};
    for (Py_ssize_t k = 0; k < count; k++) {
        for (int axis = 0; axis < wanted[k].dimensions; axis++) {
            const int which = wanted[k].shape[axis];
            Py_ssize_t *size = which == SAMPLES  ? &found->samples
                               : which == JOINTS ? &joints
                               : which == HINGES ? &found->hinges
                                                 : NULL;
            if (size && *size < 0) {
                *size = views[k].shape[axis];
            }
        }
    }
    if (joints < 1 || joints > MOST_JOINTS) {
        PyErr_Format(PyExc_ValueError, "%zd joints; the kernels take 1 to %d", joints, MOST_JOINTS);
        return -1;
    }
    found->joints = (int)joints;
    return 0;
}

static int check_shapes(const operand *wanted, Py_ssize_t count, const Py_buffer *views, sizes *found)
{
    if (find_sizes(wanted, count, views, found) < 0) {
        return -1;
    }
    for (Py_ssize_t k = 0; k < count; k++) {
        for (int axis = 0; axis < wanted[k].dimensions; axis++) {
            const Py_ssize_t expected = length_of(wanted[k].shape[axis], found);
            if (expected != ANY && views[k].shape[axis] != expected) {
                PyErr_Format(PyExc_ValueError, "%s: axis %d has the length %zd, expected %zd", wanted[k].name, axis,
                             views[k].shape[axis], expected);
                return -1;
            }
        }
    }
    return 0;
}

int open_arrays(PyObject *const *args, Py_ssize_t given, const operand *wanted, Py_ssize_t count, Py_buffer *views,
                sizes *found)
{
    if (given != count) {
        PyErr_Format(PyExc_TypeError, "expected %zd arrays, not %zd", count, given);
        return -1;
    }
    for (Py_ssize_t k = 0; k < count; k++) {
        if (open_array(args[k], wanted + k, views + k) < 0) {
            close_arrays(views, k);
            return -1;
        }
    }
    if (check_shapes(wanted, count, views, found) < 0) {
        close_arrays(views, count);
        return -1;
    }
    return 0;
}
