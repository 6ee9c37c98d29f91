/* Lateral tire forces, front and rear, identified sample by sample, as a component in C99.
 *
 * tireid_config.h says of which car and by which method, and holds numbers and structures.
 * Axes: x forward, y left, z up. Steering, yaw rate, slip and lateral force are positive to the
 * left; slip angle alpha = delta - atan2(v_y +- l r, v_x), so that F_y = +C alpha.
 *
 * One step each TIREID_SAMPLE_TIME. The caller owns the state, which holds no pointer and may be
 * copied with memcpy. Instances share nothing; calls on different states may run at the same time.
 */
#ifndef TIREID_H
#define TIREID_H

#include <stdbool.h>
#include <stdint.h>

#include "tireid_config.h"

#if defined(__FAST_MATH__)
#error "-ffast-math and -Ofast delete the guards against NaN: compile without them"
#elif defined(__FINITE_MATH_ONLY__)
#if __FINITE_MATH_ONLY__ > 0
#error "-ffinite-math-only deletes the guards against NaN: compile without it"
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Samples in a row that are refused after which no force is output any more. */
#define TIREID_STALE_SAMPLES ((uint32_t)((TIREID_STALE_TIME / TIREID_SAMPLE_TIME) + 0.5))

typedef enum {
    TIREID_OK = 0,          /* the step was taken */
    TIREID_REST = 1,        /* slower than TIREID_MIN_SPEED: forces are zero, weights hold */
    TIREID_IMPLAUSIBLE = 2, /* a sample no car can be in: nothing is learnt from it; a fault */
    TIREID_BAD_INPUT = 3,  /* not finite or beyond the limits: refused, but time goes on; a fault */
    TIREID_BAD_RESULT = 4, /* not finite or beyond the limits: refused, but time goes on; a fault */
    TIREID_BAD_CALL = 5,   /* a null pointer: nothing was done */
    TIREID_STALE = 6       /* refused for TIREID_STALE_TIME or longer: forces are zero; a fault */
} tireid_status;

/* Limits of what is accepted; see tireid_default_params. */
typedef struct {
    tireid_real max_speed;    /* |v_x|, |v_y| [m/s] */
    tireid_real max_yaw_rate; /* |r| [rad/s] */
    tireid_real max_steering; /* |delta_f|, |delta_r| [rad] */
    tireid_real max_force;    /* |axle force| [N] */
} tireid_params;

typedef struct {
    tireid_values values;
    tireid_output output;
    uint32_t faults;  /* steps that were refused or implausible, since tireid_init */
    uint32_t missed;  /* steps in a row that were refused */
    uint32_t started; /* 0 until the first sample */
    uint32_t adapts;  /* 0: frozen, weights hold their values */
} tireid_state;

/* Limits that no car of this size reaches. */
tireid_status tireid_default_params(tireid_params *params);

/* Begin: weights and everything else as exported, adaptation on. */
tireid_status tireid_init(tireid_state *state);

/* Begin anew with the weights, the mode and the number of faults kept. */
tireid_status tireid_reset(tireid_state *state);

/* Take one sample. */
tireid_status tireid_step(
    tireid_state *state, const tireid_params *params, const tireid_input *input);

/* Outputs of the last step that was taken. */
tireid_status tireid_get_output(const tireid_state *state, tireid_output *output);

/* Lateral axle forces [N], front and rear, of the last step that was taken. */
tireid_status tireid_get_forces(const tireid_state *state, tireid_real force[2]);

#if TIREID_LEARNS
/* Weights now; to store them, and to begin with them another day. */
tireid_status tireid_get_weights(const tireid_state *state, tireid_weights *weights);

/* Go on with these weights; refused with TIREID_BAD_INPUT, and nothing changed, where one is not
 * finite or beyond the limits of what is learnt, or a covariance, an error or a time among them is
 * negative. */
tireid_status tireid_set_weights(tireid_state *state, const tireid_weights *weights);

/* true: learn (as after tireid_init). false: frozen, weights hold their values. */
tireid_status tireid_set_adaptation(tireid_state *state, bool adapts);
#endif

const char *tireid_version(void);

#ifdef __cplusplus
}
#endif

#endif
