/* Layout of Python's `Chain.packed`, the array from which the kernels read an arm.

   Every joint frame is turned so that its axis is z. Rotations are stored row by row. With n joints:

       offset       content                                                               length
       0            minus gravity in the base frame                                       3
       3            per joint: rotation at q = 0 in the previous turned frame, position   9 + 3
       3 + 12 n     per joint: rotation from the joint frame to its turned frame          9
       3 + 21 n     flange in the last turned frame: rotation, position                   9 + 3
       15 + 21 n    a payload's ten parameters in the flange frame, if one is mounted     10 */

#ifndef ARMLOAD_CHAIN_H
#define ARMLOAD_CHAIN_H

enum {
    MOST_JOINTS = 16,     /* of any arm: the kernels' work space is on the stack */
    BODY_PARAMETERS = 10, /* m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz; tensor elements about the origin */
    VECTOR_NUMBERS = 3,
    ROTATION_NUMBERS = 9,
    POSE_X = ROTATION_NUMBERS, /* in a pose: its position follows its rotation */
    POSE_Y,
    POSE_Z,
    POSE_NUMBERS = ROTATION_NUMBERS + VECTOR_NUMBERS,
    JOINT_NUMBERS = POSE_NUMBERS + ROTATION_NUMBERS, /* of a joint, in the two blocks together */
    MOST_PACKED_NUMBERS = VECTOR_NUMBERS + JOINT_NUMBERS * MOST_JOINTS + POSE_NUMBERS
};

static inline const double *joint_of(const double *packed, int joint)
{
    return packed + VECTOR_NUMBERS + POSE_NUMBERS * joint;
}

static inline const double *turned_of(const double *packed, int n, int joint)
{
    return packed + VECTOR_NUMBERS + POSE_NUMBERS * n + ROTATION_NUMBERS * joint;
}

static inline const double *flange_of(const double *packed, int n)
{
    return packed + VECTOR_NUMBERS + JOINT_NUMBERS * n;
}

static inline int packed_length(int n)
{
    return VECTOR_NUMBERS + JOINT_NUMBERS * n + POSE_NUMBERS;
}

#endif
