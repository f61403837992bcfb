/* Arrays from Python, opened through the buffer protocol (limited API of CPython 3.11) and checked, so that every
   kernel gets arrays of the right types and shapes. */

#ifndef ARMLOAD_PYTHON_ARRAYS_H
#define ARMLOAD_PYTHON_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

/* Variable axis lengths; the first array with SAMPLES, JOINTS or HINGES sets that length for the others. */
enum {
    ANY = -1,
    SAMPLES = -2,
    JOINTS = -3,
    HINGES = -4,
    TEN_PER_JOINT = -5, /* ten columns for each link */
    PACKED = -6,        /* numbers of a packed chain */
    MODEL = -7          /* numbers of a packed chain and a payload */
};

typedef struct {
    const char *name;
    char type; /* 'd': float64, 'q': int64 */
    int written;
    int dimensions;
    int shape[3];
} operand;

typedef struct {
    Py_ssize_t samples, hinges;
    int joints;
} sizes;

/* Open `count` C-contiguous arrays and check their types and that their shapes agree. Returns 0, or -1 with an
   exception set and no buffer left open. */
int open_arrays(PyObject *const *args, Py_ssize_t given, const operand *wanted, Py_ssize_t count, Py_buffer *views,
                sizes *found);

void close_arrays(Py_buffer *views, Py_ssize_t count);

/* Whether a buffer's elements are of the given type, coded like `operand.type`. */
int has_type(const Py_buffer *view, char type);

#endif
