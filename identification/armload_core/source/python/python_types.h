/* Declarations shared by the extension's files. */

#ifndef ARMLOAD_PYTHON_TYPES_H
#define ARMLOAD_PYTHON_TYPES_H

#include "instruction_sets/batch.h"
#include "python_arrays.h"

#define FASTCALL(function) ((PyCFunction)(void (*)(void))(function))

extern const batch_kernels *batch; /* in use; set when the module is loaded */

PyObject *joint_rows_into(PyObject *module, PyObject *args);

extern PyType_Spec PAYLOAD_TORQUE_SPEC;
extern PyType_Spec PAYLOAD_ESTIMATOR_SPEC;
extern PyType_Spec SERVO_LOOPS_SPEC;

#endif
