/* Guards, delay and fall-backs of the tracker. */
#include "tireid_mpc.h"

#include <stddef.h>

#include "tireid_mpc_caution.h"
#include "tireid_mpc_equations.h"
#include "tireid_mpc_iteration.h"
#include "tireid_mpc_numbers.h"

#define N TIREID_MPC_HORIZON
#define NX TIREID_MPC_STATES
#define STEERING 4U /* place of the angle among the states */
#define LAGGED 5U   /* of lagged slip, where there is */
#define TURN 5U     /* column of the table: steering that a curvature of 1/m asks for [rad m] */
#define DRIFT 6U    /* v_y in that turn [m^2/s] */
#define NEAREST TIREID_MPC_C(0.1)    /* 1 - kappa e_y: nearer to the center of a turn is no place */
#define MOST_ANGLE TIREID_MPC_C(3.2) /* of wheels [rad] that a caller may tell */

#define real tireid_mpc_real

/* Whether the car's own numbers are: x - x is zero, and does not overflow. */
static bool is_number(const tireid_mpc_input *in)
{
    return tireid_mpc_finite(
        (in->e_y - in->e_y) + (in->e_psi - in->e_psi) + (in->v_y - in->v_y) + (in->r - in->r));
}

/* What can be said of the road before anything is computed. */
static tireid_mpc_status judge_road(const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    tireid_mpc_status status = TIREID_MPC_OK;
    bool slow = false;
    bool known = true;
    real sum = TIREID_MPC_C(0.0);
    uint32_t k;
    for (k = 0U; k <= N; k++) {
        sum += (in->kappa[k] - in->kappa[k]) + (in->v_x[k] - in->v_x[k]);
        slow = slow || (in->v_x[k] < params->min_speed);
        known = known && (in->v_x[k] <= params->max_speed)
            && tireid_mpc_within(in->kappa[k], params->max_curvature);
    }
    if (!tireid_mpc_finite(sum)) {
        status = TIREID_MPC_NOT_FINITE;
    } else if (!known) {
        status = TIREID_MPC_OFF_MAP;
    } else if (slow) {
        status = TIREID_MPC_TOO_SLOW;
    } else {
        /* a road to plan for */
    }
    return status;
}

/* What can be said of a measurement before anything is computed. */
static tireid_mpc_status judge(const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    tireid_mpc_status status = judge_road(params, in);
    if ((status == TIREID_MPC_NOT_FINITE) || !is_number(in)) {
        status = TIREID_MPC_NOT_FINITE;
    } else if (!tireid_mpc_within(in->e_y, params->widest_e_y)
        || !tireid_mpc_within(in->e_psi, params->widest_e_psi)) {
        status = TIREID_MPC_OFF_PATH;
    } else if ((status == TIREID_MPC_OFF_MAP) || !tireid_mpc_within(in->v_y, params->max_v_y)
        || !tireid_mpc_within(in->r, params->max_yaw_rate)) {
        status = TIREID_MPC_OFF_MAP;
    } else if ((TIREID_MPC_C(1.0) - (in->kappa[0] * in->e_y)) < NEAREST) {
        status = TIREID_MPC_OFF_PATH;
    } else {
        /* a car to plan for, or too slow */
    }
    return status;
}

/* The car as it is measured, with the lagged slip that was predicted for now. */
static void take_measurement(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *in, real *x)
{
    uint32_t i;
    x[0] = in->e_y;
    x[1] = in->e_psi + (state->drift / in->v_x[0]); /* v_y stays: tires were learnt with it */
    x[2] = in->v_y;
    x[3] = in->r + state->turning;
    x[STEERING] = state->commands[0] + state->zero;
    for (i = LAGGED; i < NX; i++) {
        x[i] = state->lagged[i - LAGGED];
    }
    if ((LAGGED < NX) && (state->started == 0U)) {
        tireid_mpc_linearize_end(
            params, params->cost_end, x, in->kappa[0], in->v_x[0], &work->stage[N]);
        for (i = LAGGED; i < NX; i++) {
            x[i] = work->stage[N].slip[i - LAGGED];
        }
    }
}

/* Lead x from a measurement to `until` [s] later; `reach` is when the last command ends to act. */
static void lead(const tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_input *in, real reach, real until, real *x)
{
    real now = TIREID_MPC_C(0.0);
    uint32_t j;
    uint32_t i;
    for (j = TIREID_MPC_COMMANDS; j-- > 0U;) {
        const real ends = reach - ((real)j * params->period);
        const real stop = ((ends < until) && (j > 0U)) ? ends : until;
        if (stop > now) {
            real next[NX];
            x[STEERING] = state->commands[j] + state->zero;
            tireid_mpc_predict(params, x, in->kappa[0], in->v_x[0], stop - now, state->grip, next);
            for (i = 0U; i < NX; i++) {
                x[i] = next[i];
            }
            now = stop;
        }
    }
}

/* Whether there is a plan, new or young enough. */
static bool follows_plan(const tireid_mpc_state *state, const tireid_mpc_params *params)
{
    return (state->planned != 0U) && (((real)state->age * params->period) <= params->hold_time);
}

/* A number of the fall-back's table at a speed, between its rows; that of the ends beyond them. */
static real at_speed(const tireid_mpc_params *params, uint32_t column, real v_x)
{
    const real *speeds = params->speeds;
    real found = params->gains[0][column];
    uint32_t k;
    for (k = 1U; k < TIREID_MPC_SPEEDS; k++) {
        if (v_x > speeds[k - 1U]) {
            const real width = speeds[k] - speeds[k - 1U];
            const real way = v_x - speeds[k - 1U];
            const real share = (way < width) ? (way / width) : TIREID_MPC_C(1.0);
            const real row = params->gains[k][column];
            found = params->gains[k - 1U][column] + (share * (row - params->gains[k - 1U][column]));
        }
    }
    return found;
}

/* Angle [rad] at which the wheels are when a measurement is taken. */
static real wheels(const tireid_mpc_state *state, const tireid_mpc_params *params)
{
    const real behind = params->delay / params->period;
    uint32_t j = 0U;
    while ((j < (TIREID_MPC_COMMANDS - 1U)) && ((real)j < behind)) {
        j++;
    }
    return state->commands[(j > 0U) ? (j - 1U) : 0U];
}

/* x, not beyond +-limit; `missing` where it is no number. */
static real known(real x, real limit, real missing)
{
    return tireid_mpc_finite(x) ? tireid_mpc_clipped(x, limit) : missing;
}

/* Steering [rad] that brings the car back to its path without a plan: feedback of what it is off the
 * steady turn on the path, by gains of its speed. What is not a number is taken as in that turn;
 * without heading or yaw rate the turn alone is steered; without curvature or speed wheels stay. */
static real track(
    const tireid_mpc_state *state, const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    real wanted = state->commands[0];
    if (tireid_mpc_finite(in->kappa[0]) && tireid_mpc_finite(in->v_x[0])) {
        const real kappa = tireid_mpc_clipped(in->kappa[0], params->max_curvature);
        const real v_x = tireid_mpc_clipped(in->v_x[0], params->max_speed);
        const real turn = kappa * at_speed(params, TURN, v_x);
        const real v_y = kappa * at_speed(params, DRIFT, v_x);
        const real forward = (v_x > params->min_speed) ? v_x : params->min_speed;
        const real e_psi = in->e_psi + (v_y / forward);
        const real r = in->r - (kappa * v_x);
        wanted = turn;
        if (tireid_mpc_finite(e_psi) && tireid_mpc_finite(r)) {
            wanted -=
                (at_speed(params, 0U, v_x) * known(in->e_y, params->max_e_y, TIREID_MPC_C(0.0)))
                + (at_speed(params, 1U, v_x) * tireid_mpc_clipped(e_psi, params->widest_e_psi))
                + (at_speed(params, 2U, v_x) * (known(in->v_y, params->max_v_y, v_y) - v_y))
                + (at_speed(params, 3U, v_x) * tireid_mpc_clipped(r, params->max_yaw_rate))
                + (at_speed(params, 4U, v_x) * (wheels(state, params) - turn));
        }
    }
    return tireid_mpc_finite(wanted) ? wanted : state->commands[0];
}

/* Steering [rad] of the plan, or else of damped tracking, within the hard limits. */
static real next_steering(
    const tireid_mpc_state *state, const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    const real last = state->commands[0];
    const real most = params->period * params->max_rate;
    const real wanted = follows_plan(state, params) ? (last + (params->period * state->u[0]))
                                                    : track(state, params, in);
    const real next =
        tireid_mpc_clipped(last + tireid_mpc_clipped(wanted - last, most), params->max_steering);
    return tireid_mpc_finite(next) ? next : last;
}

static void remember(tireid_mpc_state *state, real steering)
{
    uint32_t j;
    for (j = TIREID_MPC_COMMANDS - 1U; j > 0U; j--) {
        state->commands[j] = state->commands[j - 1U];
    }
    state->commands[0] = steering;
}

static void count(tireid_mpc_state *state, tireid_mpc_status status)
{
    state->faults[status] += (state->faults[status] < UINT32_MAX) ? 1U : 0U;
}

/* The wheels at an angle, and no plan. */
static void begin_at(tireid_mpc_state *state, real steering)
{
    uint32_t i;
    tireid_mpc_clear(state);
    for (i = 0U; i < TIREID_MPC_COMMANDS; i++) {
        state->commands[i] = steering;
    }
    state->lagged[0] = TIREID_MPC_C(0.0);
    state->lagged[1] = TIREID_MPC_C(0.0);
    tireid_mpc_trust(state);
    state->iterations = 0U;
    state->age = 0U;
    state->planned = 0U;
    state->shifted = 0U;
    state->started = 0U;
}

tireid_mpc_status tireid_mpc_init(tireid_mpc_state *state)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if (state != NULL) {
        uint32_t i;
        begin_at(state, TIREID_MPC_C(0.0));
        for (i = 0U; i < TIREID_MPC_STATUSES; i++) {
            state->faults[i] = 0U;
        }
        status = TIREID_MPC_OK;
    }
    return status;
}

tireid_mpc_status tireid_mpc_reset(
    tireid_mpc_state *state, const tireid_mpc_params *params, real steering)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((state != NULL) && (params != NULL) && tireid_mpc_within(steering, params->max_steering)) {
        begin_at(state, steering);
        status = TIREID_MPC_OK;
    }
    return status;
}

/* Whether the plan stays where the prediction holds, and may be linearized at. */
static bool is_sound(const tireid_mpc_state *state, const tireid_mpc_params *params)
{
    bool sound = true;
    uint32_t k;
    for (k = 1U; k <= N; k++) {
        sound = sound && tireid_mpc_on_map(params, state->x[k]);
    }
    return sound;
}

/* Make the plan new from where the car is when its command acts. */
static tireid_mpc_status plan_from(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *in, const real *x)
{
    tireid_mpc_status status;
    uint32_t i;
    if (!follows_plan(state, params) || !is_sound(state, params)) {
        tireid_mpc_guess(state, params, x, &in->kappa[1], &in->v_x[1]);
        state->planned = 0U;
    }
    status = tireid_mpc_solve(state, params, work, x, &in->kappa[1], &in->v_x[1]);
    for (i = 1U; (i < params->linearizations) && (status <= TIREID_MPC_ITERATION_LIMIT); i++) {
        status = tireid_mpc_solve(state, params, work, x, &in->kappa[1], &in->v_x[1]);
    }
    if ((status == TIREID_MPC_OK) || (status == TIREID_MPC_ITERATION_LIMIT)) {
        state->planned = 1U;
        state->age = 0U;
    }
    return status;
}

/* Make the plan new from a measurement, `now`; without one the plan stays, if there is one. */
static tireid_mpc_status plan(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *in, const real *now)
{
    const real ahead = params->delay - (TIREID_MPC_C(0.5) * params->period);
    real x[NX];
    tireid_mpc_status status = TIREID_MPC_QP_FAILED;
    uint32_t i;
    for (i = 0U; i < NX; i++) {
        x[i] = now[i];
    }
    lead(state, params, in, params->delay, ahead, x);
    x[STEERING] = state->commands[0] + state->zero;
    if (tireid_mpc_carriable(x, NX)) {
        status = plan_from(state, params, work, in, x);
    }
    return status;
}

/* Move the plan to where the next step begins, where it is not there. */
static void shift_once(tireid_mpc_state *state, const tireid_mpc_params *params)
{
    if ((state->planned != 0U) && (state->shifted == 0U)) {
        tireid_mpc_shift(state, params);
    }
    state->shifted = 1U;
}

tireid_mpc_status tireid_mpc_prepare(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *expected)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((state != NULL) && (params != NULL) && (work != NULL) && (expected != NULL)) {
        status = judge_road(params, expected);
        shift_once(state, params);
        state->prepared = 0U;
        if ((status == TIREID_MPC_OK) && (state->planned != 0U) && is_sound(state, params)
            && !(params->caution > TIREID_MPC_C(0.0))) { /* which a measurement may change */
            tireid_mpc_prepare_from(
                state, params, work, state->x[0], &expected->kappa[1], &expected->v_x[1]);
        }
    }
    return status;
}

tireid_mpc_status tireid_mpc_step(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *input, real *steering)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((state != NULL) && (params != NULL) && (work != NULL) && (input != NULL)
        && (steering != NULL)) {
        real x[NX];
        uint32_t i;
        status = judge(params, input);
        state->iterations = 0U;
        state->age += (state->age < UINT32_MAX) ? 1U : 0U;
        shift_once(state, params);
        state->shifted = 0U;
        tireid_mpc_watch(state, params, input, wheels(state, params), status == TIREID_MPC_OK);
        if (status == TIREID_MPC_OK) {
            take_measurement(state, params, work, input, x);
            status = plan(state, params, work, input, x);
        }
        remember(state, next_steering(state, params, input));
        if ((LAGGED < NX) && (status <= TIREID_MPC_QP_FAILED)) {
            lead(state, params, input, params->delay + params->period, params->period, x);
            state->started = tireid_mpc_carriable(x, NX) ? 1U : 0U; /* 0: slip begins anew */
            for (i = LAGGED; i < NX; i++) {
                state->lagged[i - LAGGED] = (state->started != 0U) ? x[i] : TIREID_MPC_C(0.0);
            }
        }
        state->prepared = 0U;
        count(state, status);
        *steering = state->commands[0];
    }
    return status;
}

tireid_mpc_status tireid_mpc_late(tireid_mpc_state *state, real steering)
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((state != NULL) && tireid_mpc_within(steering, MOST_ANGLE)) {
        state->commands[0] = steering;
        count(state, TIREID_MPC_LATE);
        status = TIREID_MPC_OK;
    }
    return status;
}

const char *tireid_mpc_version(void)
{
    return TIREID_MPC_VERSION;
}
