/* The Python function joint_rows_into, which calls the scanner of messages. */

#include "chain.h"
#include "scalar/joint_messages.h"
#include "python_types.h"

static int open_table(PyObject *array, const message_layout *layout, Py_buffer *view)
{
    if (PyObject_GetBuffer(array, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | PyBUF_WRITABLE) < 0) {
        return -1;
    }
    if (has_type(view, 'd') && view->ndim == 2 && view->shape[1] == (Py_ssize_t)message_row_width(layout)) {
        return 0;
    }
    PyErr_Format(PyExc_ValueError, "table: expected rows of %zu float64", message_row_width(layout));
    PyBuffer_Release(view);
    return -1;
}

PyObject *joint_rows_into(PyObject *module, PyObject *args)
{
    enum { RECORDS, CHANNELS, TABLE, VIEWS };
    Py_buffer views[VIEWS];
    Py_ssize_t at, joints;
    unsigned int arrays;
    PyObject *table, *answer = NULL;
    (void)module;
    if (!PyArg_ParseTuple(args, "y*ny*InO", views + RECORDS, &at, views + CHANNELS, &arrays, &joints, &table)) {
        return NULL;
    }
    const message_layout layout = {views[CHANNELS].buf, (size_t)views[CHANNELS].len / 2, arrays, (size_t)joints};
    if (at < 0 || joints < 1 || joints > MOST_JOINTS_OF_A_MESSAGE || arrays >> OPTIONAL_ARRAYS
        || views[CHANNELS].len % 2) {
        PyErr_SetString(PyExc_ValueError, "expected an offset, channels of two bytes, bits of arrays and joints");
    } else if (open_table(table, &layout, views + TABLE) == 0) {
        scanned_messages scanned;
        Py_BEGIN_ALLOW_THREADS scanned = scan_messages(views[RECORDS].buf, (size_t)views[RECORDS].len, (size_t)at,
                                                       &layout, views[TABLE].buf, (size_t)views[TABLE].shape[0]);
        Py_END_ALLOW_THREADS PyBuffer_Release(views + TABLE);
        answer = Py_BuildValue("nnn", (Py_ssize_t)scanned.rows, (Py_ssize_t)scanned.missing, (Py_ssize_t)scanned.at);
    }
    PyBuffer_Release(views + RECORDS);
    PyBuffer_Release(views + CHANNELS);
    return answer;
}
