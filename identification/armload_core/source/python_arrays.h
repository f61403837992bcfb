/* Arrays from Python: opened through the buffer protocol and checked, so that no kernel ever sees a shape that does
   not fit. The limited API of CPython 3.11 has all that is needed. */

#ifndef ARMLOAD_PYTHON_ARRAYS_H
#define ARMLOAD_PYTHON_ARRAYS_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

/* Lengths of axes that are not known beforehand; the first SAMPLES, JOINTS and HINGES set what the others must be. */
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

/* Open `count` C-contiguous arrays and check their types and shapes against each other. Returns 0, or -1 with an
   exception set and nothing left open. */
int open_arrays(PyObject *const *args, Py_ssize_t given, const operand *wanted, Py_ssize_t count, Py_buffer *views,
                sizes *found);

void close_arrays(Py_buffer *views, Py_ssize_t count);

/* Whether a buffer's elements are of a type, as `operand.type`. */
int has_type(const Py_buffer *view, char type);

#endif
