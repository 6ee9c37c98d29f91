/* Between the equations, the tables and the guards: not for users. */
#ifndef TIREID_EQUATIONS_H
#define TIREID_EQUATIONS_H

#include "tireid.h"

#if TIREID_SINGLE
#define TIREID_C(x) x##F
#else
#define TIREID_C(x) x
#endif

#ifdef __cplusplus
extern "C" {
#endif

#if TIREID_RULES
/* Numbers of the weights that must be right to be taken over: which, and from which one on. */
typedef enum {
    TIREID_NOT_NEGATIVE, /* `order` numbers */
    TIREID_FACTORS,      /* U D U' of a covariance: its upper triangle by rows, D on the diagonal */
    TIREID_TRIANGLE,     /* upper triangle of a covariance, by rows */
    TIREID_MATRIX        /* a whole covariance */
} tireid_kind;

typedef struct {
    tireid_kind kind;
    uint32_t first;
    uint32_t order; /* rows of the matrix */
} tireid_rule;
#endif

#if TIREID_RANGES
/* What `order` numbers of the weights must keep to be taken over: low <= sum of shares of them
 * <= high. */
typedef struct {
    tireid_real low;
    tireid_real high;
    uint32_t first;
    uint32_t order;
    uint32_t shares; /* the first of them */
} tireid_range;
#endif

/* The parts of carried values, each by its own pointer: what small processors read lies within 1 kB
 * of one. */
#if TIREID_LEARNS
#define TIREID_NOW const tireid_weights *known, const tireid_signals *now
#define TIREID_NEXT tireid_weights *learnt, tireid_signals *next
#define TIREID_PARTS(values) &(values)->weights, &(values)->signals
#else
#define TIREID_NOW const tireid_signals *now
#define TIREID_NEXT tireid_signals *next
#define TIREID_PARTS(values) &(values)->signals
#endif

#if TIREID_DECIDES
/* Where the equations of a driving car hold. */
bool tireid_drives(const tireid_input *in);

/* One step at rest, and with a sample that no car can be in. Returns as the next one. */
tireid_real tireid_elsewhere(TIREID_NOW, const tireid_input *in, TIREID_NEXT, tireid_output *out);
#endif

/* One step from now to next, which are not the same. Returns the sum of all numbers that it tells,
 * which is finite only where all of them are; zero where TIREID_SUMS is not set. */
tireid_real tireid_driving(TIREID_NOW, const tireid_input *in, TIREID_NEXT, tireid_output *out);

#ifdef __cplusplus
}
#endif

#endif
