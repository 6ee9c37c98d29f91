/* Generated. Measurements e_y, e_psi, v_y, r; steering [rad] and status that follow; curvature
 * and speed each period: row k now, k + offset + stride j in stage j. SI. */
#ifndef TIREID_MPC_VECTORS_H
#define TIREID_MPC_VECTORS_H

#define VECTORS 4U
#define VECTOR_OFFSET 5U
#define VECTOR_STRIDE 5U
#define VECTOR_TOLERANCE_DOUBLE 1e-09 /* rad */
#define VECTOR_TOLERANCE_SINGLE 0.001 /* rad */

static const double vector_input[VECTORS][4] = {
    { 0.3, 0.0, 0.0, 0.0 },
    { 0.3, 0.0, 0.0, 0.0 },
    { 0.3, 0.0, 0.0, 0.0 },
    { 0.3, 0.0, 0.0, 0.0 },
};

static const double vector_output[VECTORS][2] = {
    { -0.008, 0.0 },
    { -0.016, 0.0 },
    { -0.024, 0.0 },
    { -0.032, 0.0 },
};

static const double vector_road[5][2] = {
    { 0.0, 20.0 },
    { 0.0, 19.9975 },
    { 0.0, 19.995 },
    { 0.0, 19.9925 },
    { 0.0, 19.99 },
};

#endif
