/* The numbers of the export, and guards for others. */
#include "tireid_mpc_params.h"

#include <stddef.h>

#include "tireid_mpc_tables.h"

#define LARGEST R(1e12)   /* of a number that is accepted: equations do not overflow */
#define SMALLEST R(1e-12) /* of one that must be positive */

/* Whether x is a number that a car has use for; NaN is not. */
static bool is_told(tireid_mpc_real x)
{
    return (x <= LARGEST) && (x >= -LARGEST);
}

static bool are_told(const tireid_mpc_real *x, uint32_t n)
{
    bool told = true;
    uint32_t i;
    for (i = 0U; i < n; i++) {
        told = told && is_told(x[i]);
    }
    return told;
}

static bool are_positive(const tireid_mpc_real *const x[], uint32_t n)
{
    bool positive = true;
    uint32_t i;
    for (i = 0U; i < n; i++) {
        positive = positive && (*x[i] >= SMALLEST) && is_told(*x[i]);
    }
    return positive;
}

/* Whether what is not known of the tire can be feared: a share, frictions that fall from 1. */
static bool is_caution(const tireid_mpc_params *params)
{
    bool caution = is_told(params->caution) && (params->caution >= R(0.0))
        && (params->caution <= R(1.0)) && (params->grips[0] <= R(1.0));
    uint32_t k;
    for (k = 0U; k < TIREID_MPC_GRIPS; k++) {
        caution = caution && is_told(params->grips[k]) && (params->grips[k] >= R(0.01))
            && ((k == 0U) || (params->grips[k] <= params->grips[k - 1U]));
    }
    return caution;
}

/* Whether the fall-back's table can be read: rising speeds, gains that are numbers. */
static bool is_table(const tireid_mpc_params *params)
{
    bool table = params->speeds[0] > R(0.0);
    uint32_t k;
    for (k = 0U; k < TIREID_MPC_SPEEDS; k++) {
        table = table && are_told(params->gains[k], TIREID_MPC_GAINS)
            && ((k == 0U) || (params->speeds[k] > params->speeds[k - 1U]));
    }
    return table && are_told(params->speeds, TIREID_MPC_SPEEDS);
}

static bool are_not_negative(const tireid_mpc_real *x, uint32_t n)
{
    bool not_negative = are_told(x, n);
    uint32_t i;
    for (i = 0U; i < n; i++) {
        not_negative = not_negative && (x[i] >= R(0.0));
    }
    return not_negative;
}

tireid_mpc_status tireid_mpc_default_params(tireid_mpc_params *params)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if (params != NULL) {
        *params = tireid_mpc_exported;
        status = TIREID_MPC_OK;
    }
    return status;
}

bool tireid_mpc_accepts(const tireid_mpc_params *params)
{
    bool accepted = false;
    if (params != NULL) {
        const tireid_mpc_real *const positive[] = { &params->car[0], &params->car[1],
            &params->car[2], &params->car[3], &params->cost_rate, &params->stage_time,
            &params->period, &params->max_steering, &params->max_rate, &params->max_e_y,
            &params->max_slip[0], &params->max_slip[1], &params->soft_e_y, &params->soft_slip,
            &params->widest_e_y, &params->widest_e_psi, &params->max_v_y, &params->max_yaw_rate,
            &params->min_speed, &params->max_speed, &params->max_curvature, &params->tolerance,
            &params->surprise, &params->stiffness, &params->doubt_step, &params->force_error[0],
            &params->force_error[1] };
        accepted = are_positive(positive, (uint32_t)(sizeof positive / sizeof positive[0]))
            && are_told(params->weights, TIREID_MPC_WEIGHTS) && are_not_negative(params->rise, 2U)
            && are_not_negative(params->cost, TIREID_MPC_ERRORS) && is_caution(params)
            && are_not_negative(params->prior, TIREID_MPC_GRIPS)
            && are_not_negative(params->doubt[0], TIREID_MPC_DOUBTS)
            && are_not_negative(params->doubt[1], TIREID_MPC_DOUBTS)
            && are_not_negative(params->cost_end, TIREID_MPC_ERRORS) && is_table(params)
            && are_not_negative(&params->hold_time, 1U) && are_not_negative(&params->delay, 1U)
            && (params->delay <= (R(TIREID_MPC_COMMANDS - 1U) * params->period))
            && (params->period <= params->stage_time) && (params->max_iterations > 0U);
    }
    return accepted;
}

tireid_mpc_status tireid_mpc_set_weights(
    tireid_mpc_params *params, const tireid_mpc_real weights[TIREID_MPC_WEIGHTS])
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((params != NULL) && (weights != NULL)) {
        status = TIREID_MPC_NOT_FINITE;
        if (are_told(weights, TIREID_MPC_WEIGHTS)) {
            uint32_t i;
            for (i = 0U; i < TIREID_MPC_WEIGHTS; i++) {
                params->weights[i] = weights[i];
            }
            status = TIREID_MPC_OK;
        }
    }
    return status;
}
