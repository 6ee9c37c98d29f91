/* The identified tire, for the prediction of the tracker. */
#include "tireid_handover.h"

#include <math.h>
#include <stddef.h>

#include "tireid_handover_tables.h"

#define real tireid_mpc_real
#define WEIGHTS TIREID_MPC_WEIGHTS
#define UNITS TIREID_HANDOVER_UNITS
#define MAX_FORCE ((real)TIREID_HANDOVER_MAX_FORCE) /* of an axle [N] */

#if TIREID_HANDOVER_CURVES
#define AXLE (4U + (2U * UNITS)) /* weights of an axle: load, its rise, give, lag; scales, units */
#define SWAY ((real)TIREID_HANDOVER_SWAY) /* g over the square of the roll's frequency [m] */
#define LEAST_SLOPE ((real)0.1)           /* of a force curve at zero [static loads a rad] */
#define MAX_SLIP ((real)0.5)              /* up to which a flat curve is looked for [rad] */
#define STEPS 250U
#define FLAT ((real)0.05)       /* of the slope at zero: there the peak is reached */
#define LEAST_RISE ((real)0.04) /* of the slope at zero, beyond the slip that is of use */

/* What an axle has beside its curve: compliance [m per load], share of the sway of the body, and
 * what sensors are off by: steering in front [rad], v_y at the rear [m/s]. */
static void beside(const tireid_weights *learnt, uint32_t i, real own[3])
{
#if TIREID_TELLS_V_Y
    own[0] = (real)learnt->own[i];
    own[1] = (real)TIREID_HANDOVER_SWAY_SHARE;
    own[2] = (i == 0U) ? (real)learnt->sensors[TIREID_HANDOVER_STEERING] : (real)0.0;
#else
    own[0] = (real)learnt->own[i][0];
    own[1] = (real)learnt->own[i][1];
    own[2] = (real)learnt->own[i][2];
#endif
}

/* Weights of the prediction: offsets, give and units; loads, scales and the shortest lag stay. */
static bool convert(const tireid_weights *learnt, real w[WEIGHTS])
{
    bool is_tire = true;
    uint32_t i;
    uint32_t j;
    for (i = 0U; i < 2U; i++) {
        real *axle = &w[4U + (i * AXLE)];
        real own[3];
        real slope = (real)0.0;
        real most = (real)0.0;
        beside(learnt, i, own);
        w[2U * i] = own[2];
        axle[2] = own[0] + (SWAY * own[1]);
        for (j = 0U; j < UNITS; j++) {
            const real weight = (real)learnt->W[i][j];
            slope += weight * axle[4U + j];
            most += (weight < (real)0.0) ? -weight : weight;
            axle[4U + UNITS + j] = weight;
        }
        is_tire = is_tire && ((most * axle[0]) <= MAX_FORCE) && (slope >= LEAST_SLOPE)
            && (axle[2] >= (real)0.0) && ((axle[2] - axle[2]) <= (real)0.0)
            && ((own[2] - own[2]) <= (real)0.0);
    }
    return is_tire;
}

/* Slope of an axle's force at a slip [N/rad]. */
static real slope_at(const real w[WEIGHTS], uint32_t i, real slip)
{
    const real *axle = &w[4U + (i * AXLE)];
    real slope = (real)0.0;
    uint32_t j;
    for (j = 0U; j < UNITS; j++) {
        const real scale = axle[4U + j];
        const real t = (real)tanh((double)(scale * slip));
        slope += (axle[4U + UNITS + j] * scale) * ((real)1.0 - (t * t));
    }
    return axle[0] * slope;
}

/* Slip that is of use: up to where the force of the axle hardly grows any more. */
static real useful_slip(const real w[WEIGHTS], uint32_t i, real first)
{
    const real least = FLAT * first;
    real slip = max_slip[i];
    uint32_t k;
    for (k = STEPS; k > 0U; k--) {
        const real at = MAX_SLIP * ((real)k / (real)STEPS);
        if ((at < slip) && (slope_at(w, i, at) < least)) {
            slip = at;
        }
    }
    return slip;
}

/* How far the curves of the tire are believed, and how they go on. */
static void believe(tireid_mpc_params *params)
{
    uint32_t i;
    for (i = 0U; i < 2U; i++) {
        const real first = slope_at(params->weights, i, (real)0.0);
        const real slip = useful_slip(params->weights, i, first);
        const real least = LEAST_RISE * first;
        real rise = slope_at(params->weights, i, slip);
        rise = (rise > least) ? rise : least;
        params->max_slip[i] = slip;
        params->rise[i] = (rise > (real)0.0) ? rise : (real)0.0;
    }
}
#else
#define INPUTS TIREID_HANDOVER_INPUTS
#define FORCE_UNIT ((real)TIREID_HANDOVER_FORCE_UNIT) /* of the weights [N] */

/* Weights of the prediction: stiffness, W and V by columns, in N and SI. */
static bool convert(const tireid_weights *learnt, real w[WEIGHTS])
{
    bool is_tire = true;
    uint32_t i;
    uint32_t j;
    uint32_t k;
    for (i = 0U; i < 2U; i++) {
        real most = (real)0.0;
        w[i] = stiffness[i];
        for (j = 0U; j < UNITS; j++) {
            const real force = FORCE_UNIT * (real)learnt->W[i][j];
            w[2U + (2U * j) + i] = force;
            most += (force < (real)0.0) ? -force : force;
        }
        is_tire = is_tire && (most <= MAX_FORCE); /* which NaN is not */
    }
    for (k = 0U; k < INPUTS; k++) {
        for (j = 0U; j < UNITS; j++) {
            const real v = (real)learnt->V[j][k] / scale[k];
            w[2U + (2U * UNITS) + (k * UNITS) + j] = v;
            is_tire = is_tire && ((v - v) <= (real)0.0);
        }
    }
    return is_tire;
}
#endif

static bool is_share(real share)
{
    return (share >= (real)0.0) && (share <= (real)1.0);
}

bool tireid_handover(const tireid_weights *learnt, tireid_mpc_params *params, real share)
{
    bool taken = false;
    if ((learnt != NULL) && (params != NULL) && is_share(share)) {
        real w[WEIGHTS];
        uint32_t i;
        for (i = 0U; i < WEIGHTS; i++) {
            w[i] = params->weights[i]; /* how sensors are mounted is not learnt: it stays */
        }
        taken = convert(learnt, w);
        if (taken) {
            for (i = 0U; i < WEIGHTS; i++) {
                const real moved = params->weights[i] + (share * (w[i] - params->weights[i]));
                params->weights[i] = (share < (real)1.0) ? moved : w[i];
            }
#if TIREID_HANDOVER_CURVES
            believe(params);
#endif
        }
    }
    return taken;
}
