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
    MOST_JOINTS = 16,
    BODY_PARAMETERS = 10 /* m, m cx, m cy, m cz, Ixx, Iyy, Izz, Ixy, Ixz, Iyz; tensor elements about the origin */
};

static inline const double *joint_of(const double *packed, int joint)
{
    return packed + 3 + 12 * joint;
}

static inline const double *turned_of(const double *packed, int n, int joint)
{
    return packed + 3 + 12 * n + 9 * joint;
}

static inline const double *flange_of(const double *packed, int n)
{
    return packed + 3 + 21 * n;
}

static inline int packed_length(int n)
{
    return 15 + 21 * n;
}

#endif
