/* One real-time iteration: linearize along the plan, solve, take the whole step. */
#include "tireid_mpc_iteration.h"

#include <stddef.h>

#include "tireid_mpc_caution.h"
#include "tireid_mpc_equations.h"
#include "tireid_mpc_numbers.h"
#include "tireid_mpc_qp.h"

#define N TIREID_MPC_HORIZON
#define NX TIREID_MPC_STATES
#define STEERING 4U                    /* place of the angle among the states */
#define FRESH ((N + 2U) / 3U)          /* stages linearized anew where the others are prepared */
#define NEARLY_TURN TIREID_MPC_C(0.1)  /* lateral acceleration of a road [m/s^2] that is the same */
#define NEARLY_SPEED TIREID_MPC_C(0.1) /* [m/s] */

#define real tireid_mpc_real

void tireid_mpc_clear(tireid_mpc_state *state)
{
    uint32_t k;
    uint32_t i;
    for (k = 0U; k <= N; k++) {
        for (i = 0U; i < NX; i++) {
            state->x[k][i] = TIREID_MPC_C(0.0);
        }
    }
    for (k = 0U; k < N; k++) {
        state->u[k] = TIREID_MPC_C(0.0);
        for (i = 0U; i < NX; i++) {
            state->feedback[k][i] = TIREID_MPC_C(0.0);
        }
    }
    state->guessed = 1U;
    state->prepared = 0U;
}

bool tireid_mpc_on_map(const tireid_mpc_params *params, const real *x)
{
    return tireid_mpc_within(x[0], params->widest_e_y)
        && tireid_mpc_within(x[1], params->widest_e_psi) && tireid_mpc_within(x[2], params->max_v_y)
        && tireid_mpc_within(x[3], params->max_yaw_rate);
}

void tireid_mpc_shift(tireid_mpc_state *state, const tireid_mpc_params *params)
{
    const real told = params->period / params->stage_time;
    const real share =
        ((told >= TIREID_MPC_C(0.0)) && (told <= TIREID_MPC_C(1.0))) ? told : TIREID_MPC_C(1.0);
    uint32_t k;
    uint32_t i;
    for (k = 0U; k < N; k++) {
        for (i = 0U; i < NX; i++) {
            state->x[k][i] += share * (state->x[k + 1U][i] - state->x[k][i]);
        }
        if (k < (N - 1U)) {
            const real *ahead = state->feedback[k + 1U];
            for (i = 0U; i < NX; i++) {
                state->feedback[k][i] += share * (ahead[i] - state->feedback[k][i]);
            }
            state->u[k] += share * (state->u[k + 1U] - state->u[k]);
        }
    }
}

void tireid_mpc_guess(tireid_mpc_state *state, const tireid_mpc_params *params, const real *x,
    const real *kappa, const real *v_x)
{
    const real length = params->car[2] + params->car[3];
    real left = TIREID_MPC_C(1.0); /* share of the way to the path that is left */
    bool finite = true;
    uint32_t k;
    uint32_t i;
    for (k = 0U; k <= N; k++) {
        const uint32_t at = (k < N) ? k : (N - 1U);
        const real angle = tireid_mpc_clipped(kappa[at] * length, params->max_steering);
        real rest[NX] = { TIREID_MPC_C(0.0) };
        rest[3] = kappa[at] * v_x[at];
        rest[STEERING] = angle;
        for (i = 0U; i < NX; i++) {
            state->x[k][i] = rest[i] + (left * (x[i] - rest[i]));
        }
        finite = tireid_mpc_carriable(state->x[k], NX) && finite;
        left *= TIREID_MPC_C(1.0) - (params->stage_time / (params->stage_time + TIREID_MPC_C(0.5)));
    }
    for (k = 0U; k < N; k++) {
        const real u = (state->x[k + 1U][STEERING] - state->x[k][STEERING]) / params->stage_time;
        state->u[k] = tireid_mpc_clipped(u, params->max_rate);
        for (i = 0U; i < NX; i++) {
            state->feedback[k][i] = TIREID_MPC_C(0.0);
        }
    }
    state->guessed = 1U;
    state->prepared = 0U;
    if (!finite || !tireid_mpc_carriable(state->u, N)) {
        tireid_mpc_clear(state);
    }
}

/* Input of the plan, fed back what the car is off it, within the hard limits. */
static real fed_back(
    const tireid_mpc_state *state, const tireid_mpc_params *params, uint32_t k, const real *x)
{
    const real dt = params->stage_time;
    real u = state->u[k];
    real wanted;
    uint32_t i;
    for (i = 0U; i < NX; i++) {
        u += state->feedback[k][i] * (x[i] - state->x[k][i]);
    }
    wanted = x[STEERING] + (dt * tireid_mpc_clipped(u, params->max_rate));
    u = (tireid_mpc_clipped(wanted, params->max_steering) - x[STEERING]) / dt;
    return tireid_mpc_clipped(u, params->max_rate);
}

/* Linearize the first stages along the way that the prediction takes from x0 under the plan and its
 * feedback, which answers most of what the car is off the plan before anything is solved. A guess, and
 * what leaves the map, is gone on with along the plan itself; behind the first stages all stays. */
static void linearize(const tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const real *x0, uint32_t stages)
{
    bool rolls;
    uint32_t k;
    uint32_t i;
    for (i = 0U; i < NX; i++) {
        work->x[0][i] = x0[i];
    }
    work->x[0][STEERING] = tireid_mpc_clipped(x0[STEERING], params->max_steering);
    for (k = 0U; k < stages; k++) {
        real *x = work->x[k];
        real *next = work->x[k + 1U];
        tireid_mpc_stage *stage = &work->stage[k];
        work->u[k] = fed_back(state, params, k, x);
        tireid_mpc_linearize(
            params, params->cost, x, work->u[k], work->kappa[k], work->v_x[k], state->grip, stage);
        rolls = (state->guessed == 0U) && tireid_mpc_on_map(params, stage->c);
        for (i = 0U; i < NX; i++) {
            if ((k + 1U) < stages) {
                next[i] = rolls ? stage->c[i] : state->x[k + 1U][i];
            } else if (stages == N) {
                next[i] = stage->c[i];
            } else {
                /* as it was */
            }
            stage->c[i] -= next[i];
        }
    }
    if (stages == N) {
        tireid_mpc_linearize_end(params, params->cost_end, work->x[N], work->kappa[N - 1U],
            work->v_x[N - 1U], &work->stage[N]);
    }
}

/* Ends of the rows of a stage, of which caution leaves a share of the soft ones, and what goes with them:
 * 1 / limit, and how soft they are. */
static void limit_rows(
    const tireid_mpc_params *params, real grip, const real *left, real *scale, real *regular)
{
    scale[0] = TIREID_MPC_C(1.0) / params->max_rate;
    scale[1] = TIREID_MPC_C(1.0) / params->max_steering;
    scale[2] = TIREID_MPC_C(1.0) / (params->max_e_y * left[0]);
    scale[3] = TIREID_MPC_C(1.0) / (params->max_slip[0] * (grip * left[1]));
    scale[4] = TIREID_MPC_C(1.0) / (params->max_slip[1] * (grip * left[2]));
    regular[0] = TIREID_MPC_C(0.0);
    regular[1] = TIREID_MPC_C(0.0);
    regular[2] = (scale[2] * scale[2]) / params->soft_e_y;
    regular[3] = (scale[3] * scale[3]) / params->soft_slip;
    regular[4] = (scale[4] * scale[4]) / params->soft_slip;
}

/* Values of the rows of the first stages at the plan, in parts of their limits. */
static void measure_rows(const tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, uint32_t stages)
{
    const bool cautious = params->caution > TIREID_MPC_C(0.0);
    const real whole[3] = { TIREID_MPC_C(1.0), TIREID_MPC_C(1.0), TIREID_MPC_C(1.0) };
    real scale[TIREID_MPC_ROWS];
    real regular[TIREID_MPC_ROWS];
    uint32_t k;
    uint32_t i;
    limit_rows(params, state->grip, whole, scale, regular);
    for (k = 0U; k < stages; k++) {
        const tireid_mpc_stage *next = &work->stage[k + 1U];
        const real *x = work->x[k + 1U];
        const real at[TIREID_MPC_ROWS] = { work->u[k], x[STEERING], x[0], next->slip[0],
            next->slip[1] };
        const uint32_t p = k * TIREID_MPC_ROWS;
        if (cautious) {
            limit_rows(params, state->grip, work->left[k], scale, regular);
        }
        for (i = 0U; i < TIREID_MPC_ROWS; i++) {
            work->scale[p + i] = scale[i];
            work->value[p + i] = scale[i] * at[i];
            work->regular[p + i] = regular[i];
        }
    }
}

/* Whether the step leads to a plan that may be carried. */
static bool is_plan(const tireid_mpc_work *work)
{
    bool plan = tireid_mpc_carriable(work->x[0], NX) && tireid_mpc_carriable(work->du, N);
    uint32_t k;
    for (k = 0U; k < N; k++) {
        plan = plan && tireid_mpc_carriable(work->x[k + 1U], NX)
            && tireid_mpc_carriable(work->dx[k + 1U], NX)
            && tireid_mpc_carriable(work->feedback[k], NX);
    }
    return plan;
}

/* Feedback of stage k; under caution as if no bound held it: what a doubt does is answered by the next plans,
 * which leave the bounds where they have to. */
static real law(
    const tireid_mpc_params *params, const tireid_mpc_work *work, uint32_t k, uint32_t i)
{
    const bool cautious = params->caution > TIREID_MPC_C(0.0);
    return cautious ? -(work->L[k][i] * work->per_lambda[k]) : work->feedback[k][i];
}

/* Take the step, and keep the hard limits to the last bit. */
static void take(
    tireid_mpc_state *state, const tireid_mpc_params *params, const tireid_mpc_work *work)
{
    uint32_t k;
    uint32_t i;
    state->guessed = 0U;
    for (i = 0U; i < NX; i++) {
        state->x[0][i] = work->x[0][i];
    }
    for (k = 0U; k < N; k++) {
        const real before = state->x[k][STEERING];
        const real u = tireid_mpc_clipped(work->u[k] + work->du[k], params->max_rate);
        const real wanted = before + (params->stage_time * u);
        const real after = tireid_mpc_clipped(wanted, params->max_steering);
        for (i = 0U; i < NX; i++) {
            state->x[k + 1U][i] = work->x[k + 1U][i] + work->dx[k + 1U][i];
            state->feedback[k][i] = law(params, work, k, i);
        }
        state->x[k + 1U][STEERING] = after;
        state->u[k] = tireid_mpc_clipped((after - before) / params->stage_time, params->max_rate);
    }
}

/* All of a solution that does not ask for more than x0, of the first stages. */
static void prepare_stages(const tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const real *x0, const real *kappa, const real *v_x, uint32_t stages)
{
    uint32_t k;
    for (k = 0U; k < stages; k++) {
        work->kappa[k] = kappa[k];
        work->v_x[k] = v_x[k];
    }
    linearize(state, params, work, x0, stages);
    if (params->caution > TIREID_MPC_C(0.0)) {
        tireid_mpc_tighten(state, params, work);
    }
    measure_rows(state, params, work, stages);
    tireid_mpc_prepare_qp(work, params, state->u, stages);
}

void tireid_mpc_prepare_from(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const real *x0, const real *kappa, const real *v_x)
{
    prepare_stages(state, params, work, x0, kappa, v_x, N);
    state->prepared = 1U;
}

/* Whether what is prepared is of a road that asks for nearly the same lateral acceleration. */
static bool is_prepared(
    const tireid_mpc_state *state, const tireid_mpc_work *work, const real *kappa, const real *v_x)
{
    bool same = state->prepared != 0U;
    uint32_t k;
    for (k = 0U; same && (k < N); k++) {
        const real faster = v_x[k] - work->v_x[k];
        const real turn = (kappa[k] - work->kappa[k]) * v_x[k] * v_x[k];
        same = tireid_mpc_within(turn, NEARLY_TURN) && tireid_mpc_within(faster, NEARLY_SPEED);
    }
    return same;
}

tireid_mpc_status tireid_mpc_solve(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const real x0[NX], const real kappa[N], const real v_x[N])
{
    tireid_mpc_status status = TIREID_MPC_BAD_CALL;
    if ((state != NULL) && (params != NULL) && (work != NULL) && (x0 != NULL) && (kappa != NULL)
        && (v_x != NULL)) {
        const bool prepared = is_prepared(state, work, kappa, v_x);
        uint32_t i;
        prepare_stages(state, params, work, x0, kappa, v_x, prepared ? FRESH : N);
        state->prepared = 0U;
        for (i = 0U; i < NX; i++) {
            work->dx[0][i] = TIREID_MPC_C(0.0);
        }
        status = tireid_mpc_qp(work, params);
        state->iterations = work->iterations;
        if ((status != TIREID_MPC_QP_FAILED) && !is_plan(work)) {
            status = TIREID_MPC_QP_FAILED;
        }
        if (status != TIREID_MPC_QP_FAILED) {
            take(state, params, work);
        }
    }
    return status;
}
