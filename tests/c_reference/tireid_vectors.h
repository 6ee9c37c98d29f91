/* Generated. Samples v_x, v_y, r, delta_f, delta_r [SI] and forces front, rear [N]. */
#ifndef TIREID_VECTORS_H
#define TIREID_VECTORS_H

#define VECTORS 4
#define VECTOR_TOLERANCE_DOUBLE 0.00074 /* N */
#define VECTOR_TOLERANCE_SINGLE 1.5 /* N */
#define VECTOR_NOT_NEGATIVE 14U /* a weight */

static const double vector_input[VECTORS][5] = {
    { 0.0, -0.0, -0.0, -0.05, -0.0009999999999999998 },
    { 0.0, -0.0, -0.0016011495870155296, -0.04666666666666667, -0.0007938144329896907 },
    { 0.0, -0.0, -0.002973563518743126, -0.043333333333333335, -0.0005876288659793811 },
    { 0.0, -0.0, -0.004117241795182791, -0.04000000000000001, -0.0003814432989690719 },
};

static const double vector_force[VECTORS][2] = {
    { 0.0, 0.0 },
    { 0.0, 0.0 },
    { 0.0, 0.0 },
    { 0.0, 0.0 },
};

#endif
