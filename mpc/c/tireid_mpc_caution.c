/* What is not known of the forces, and what is done about it.
 *
 * The friction of the road over that of the tire is one of a few. Each tells the forces of the axles,
 * and so how their impulse goes on: p_i = (l m v_y +- I_z r)/L obeys dp_i/dt = F_i - m_i v_x r. What
 * the motion shows beyond that, over what may be wrong of force and band, makes a friction unlikely:
 * its cost is -2 ln of its likelihood, over that of the best. A friction may come at any time, so that
 * no cost is above a surprise. The plan uses the lowest friction that agrees with the data.
 *
 * Sensors may be off. Position and heading show where the car came to, so that what v_y and the yaw
 * rate tell beyond that is theirs, or that of the speed. While they contradict position and heading by
 * more than good sensors do, or jump as no car does, a force that is missed is a sensor fault before it
 * is ice: of friction nothing is concluded until they agreed for a while, and nothing is tightened.
 *
 * Along the plan the doubt of the forces, less grip at both axles for the whole horizon, moves the car
 * by the sensitivities of the plan and its feedback: by that much soft limits are tightened. */
#include "tireid_mpc_caution.h"

#include "tireid_mpc_equations.h"
#include "tireid_mpc_numbers.h"

#define N TIREID_MPC_HORIZON
#define NX TIREID_MPC_STATES
#define STEERING 4U                /* place of the angle among the states */
#define LAGGED 5U                  /* of lagged slip, where there is */
#define FOLLOWED TIREID_MPC_C(0.2) /* time in which an impulse follows the measured one [s] */
#define ALIKE TIREID_MPC_C(0.2)    /* time for which errors of the force are alike [s] */
#define SETTLED TIREID_MPC_C(0.4)  /* until what is followed tells something [s] */
#define CLIP TIREID_MPC_C(9.0)     /* square of an error over its expected size that counts */
#define EXPECTED TIREID_MPC_C(2.0) /* sum of the squares of both axles */
#define REFUTED TIREID_MPC_C(2.7)  /* cost from which on a friction begins to be: one in ten */
#define MOVES TIREID_MPC_C(0.05)   /* time in which the grip goes to another [s] */
#define SIGMAS TIREID_MPC_C(1.645) /* of half a band of 90 % */
#define LEFT TIREID_MPC_C(0.3)     /* share of a limit that is left */

#define GENTLE TIREID_MPC_C(0.3)    /* slip over the useful one up to which wheels are judged */
#define FOUND TIREID_MPC_C(0.3)     /* time in which a zero is found at first [s] */
#define LASTING TIREID_MPC_C(3.0)   /* and in the end; between them as long as it was looked for */
#define MOST_ZERO TIREID_MPC_C(0.1) /* of it [rad] */

#define SHOWN TIREID_MPC_C(0.14)       /* time in which it shows what v_y is off [s] */
#define TURNED TIREID_MPC_C(0.07)      /* and what the yaw rate is: headings are less noisy [s] */
#define ASTRAY TIREID_MPC_C(0.25)      /* m, rad: a place that is another one, of another path */
#define ACROSS TIREID_MPC_C(0.2)       /* that v_y and position of good sensors are apart [m/s] */
#define AROUND TIREID_MPC_C(0.04)      /* that yaw rate and heading are [rad/s] */
#define SWAYS TIREID_MPC_C(0.2)        /* noise from one v_y to the next of good sensors [m/s] */
#define TURNS TIREID_MPC_C(0.02)       /* and from one yaw rate [rad/s] */
#define FASTEST TIREID_MPC_C(10.0)     /* that tires change either [m/s^2, rad/s^2] */
#define MOST_DRIFT TIREID_MPC_C(1.0)   /* of the zero of v_y [m/s] */
#define MOST_TURNING TIREID_MPC_C(0.6) /* of the zero of the yaw rate [rad/s] */

#define real tireid_mpc_real

static real size_of(real x)
{
    return (x < TIREID_MPC_C(0.0)) ? -x : x;
}

/* Half the band of an axle's force at a slip of the tire as it was told [N]. */
static real doubt_at(const tireid_mpc_params *params, uint32_t axle, real slip)
{
    const real *doubt = params->doubt[axle];
    const real place = size_of(slip) / params->doubt_step;
    const real last = (real)(TIREID_MPC_DOUBTS - 1U);
    real found = doubt[TIREID_MPC_DOUBTS - 1U];
    if (place < last) {
        const uint32_t k = (uint32_t)place;
        found = doubt[k] + ((place - (real)k) * (doubt[k + 1U] - doubt[k]));
    }
    return found;
}

void tireid_mpc_trust(tireid_mpc_state *state)
{
    uint32_t j;
    uint32_t i;
    for (j = 0U; j < TIREID_MPC_GRIPS; j++) {
        state->cost[j] = TIREID_MPC_C(0.0);
        for (i = 0U; i < 2U; i++) {
            state->slips[j][i] = TIREID_MPC_C(0.0);
            state->impulse[j][i] = TIREID_MPC_C(0.0);
        }
    }
    state->grip = TIREID_MPC_C(1.0);
    state->zero = TIREID_MPC_C(0.0);
    state->drift = TIREID_MPC_C(0.0);
    state->turning = TIREID_MPC_C(0.0);
    state->place[0] = TIREID_MPC_C(0.0);
    state->place[1] = TIREID_MPC_C(0.0);
    state->apart[0] = TIREID_MPC_C(0.0);
    state->apart[1] = TIREID_MPC_C(0.0);
    state->stays[0] = TIREID_MPC_C(0.0);
    state->stays[1] = TIREID_MPC_C(0.0);
    state->last[0] = TIREID_MPC_C(0.0);
    state->last[1] = TIREID_MPC_C(0.0);
    state->gentle = 0U;
    state->placed = 0U;
    state->watched = 0U;
    state->doubted = 0U;
}

/* What the motion showed of one friction: squares of what it misses over what is expected, of both
 * axles; force in front that it misses [N], and the slip there [rad]. */
typedef struct {
    real squares;
    real front;
    real slip;
} sight;

/* Follow the impulses by one friction for a period. */
static sight follow(tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_input *in, real wheels, uint32_t j)
{
    const real length = params->car[2] + params->car[3];
    const real lever[2] = { params->car[3] / length, params->car[2] / length };
    const real turn[2] = { params->car[1] / length, -params->car[1] / length };
    const real r = in->r + state->turning;
    const real dt = params->period;
    sight seen = { TIREID_MPC_C(0.0), TIREID_MPC_C(0.0), TIREID_MPC_C(0.0) };
    real x[NX] = { TIREID_MPC_C(0.0) };
    real force[2];
    real slip[2];
    real lag[2];
    uint32_t i;
    x[2] = in->v_y;
    x[3] = r;
    x[STEERING] = wheels + state->zero;
    for (i = LAGGED; i < NX; i++) {
        x[i] = state->slips[j][i - LAGGED];
    }
    tireid_mpc_axles(params, x, in->v_x[0], params->grips[j], force, slip, lag);
    for (i = 0U; i < 2U; i++) {
        const real mass = params->car[0] * lever[i];
        const real shown = (mass * in->v_y) + (turn[i] * r);
        const real rate = force[i] - (mass * in->v_x[0] * r);
        const real now = (LAGGED < NX) ? state->slips[j][i] : slip[i];
        const real rolled = (dt * in->v_x[0]) / (lag[i] + (dt * in->v_x[0]));
        if (state->watched == 0U) {
            state->impulse[j][i] = shown;
            state->slips[j][i] = slip[i];
        } else {
            const real error = (shown - (state->impulse[j][i] + (dt * rate))) / FOLLOWED;
            const real expected = params->force_error[i]
                + (doubt_at(params, i, now / params->grips[j]) * (params->grips[j] / SIGMAS));
            const real square = (error / expected) * (error / expected);
            seen.squares += (square < CLIP) ? square : CLIP;
            seen.front = (i == 0U) ? error : seen.front;
            seen.slip = (i == 0U) ? now : seen.slip;
            state->impulse[j][i] += dt * (rate + error);
            state->slips[j][i] = now + (rolled * (slip[i] - now));
        }
    }
    return seen;
}

/* Share of the way to a zero that a step goes: what tells it is averaged from the first of it on, as of
 * what stays. `told` counts the steps that did. */
static real share_of(const tireid_mpc_params *params, uint32_t *told)
{
    const real time = (real)*told * params->period;
    const real most = (time < LASTING) ? time : LASTING;
    *told += (*told < UINT32_MAX) ? 1U : 0U;
    return params->period / ((most > FOUND) ? most : FOUND);
}

/* Angle [rad] by which wheels are off what is commanded: where slip is small, friction makes little of
 * the force that is missed in front. */
static void find_zero(
    tireid_mpc_state *state, const tireid_mpc_params *params, const sight *seen, real grip)
{
    if (size_of(seen->slip) < (GENTLE * (grip * params->max_slip[0]))) {
        const real moved = (seen->front / params->stiffness) * share_of(params, &state->gentle);
        state->zero = tireid_mpc_clipped(state->zero + moved, MOST_ZERO);
    }
}

/* How e_y and e_psi move [m/s, rad/s] by heading, v_y and yaw rate as they are measured. */
static void move_of(const tireid_mpc_input *in, real moves[2])
{
    const real square = in->e_psi * in->e_psi;
    const real cosine =
        TIREID_MPC_C(1.0) - (square * (TIREID_MPC_C(0.5) - (square / TIREID_MPC_C(24.0))));
    const real bent = TIREID_MPC_C(1.0) - (square / TIREID_MPC_C(20.0));
    const real sine = in->e_psi * (TIREID_MPC_C(1.0) - ((square / TIREID_MPC_C(6.0)) * bent));
    const real along = (in->v_x[0] * cosine) - (in->v_y * sine);
    moves[0] = (in->v_x[0] * sine) + (in->v_y * cosine);
    moves[1] = in->r - ((in->kappa[0] * along) / (TIREID_MPC_C(1.0) - (in->kappa[0] * in->e_y)));
}

/* Find how the car drifts and turns beyond what heading, v_y and yaw rate tell, by an observer of the place
 * with double poles at -1 / SHOWN and -1 / TURNED. What of it stays is learnt slowly, at most as fast as
 * good sensors are apart; what is beyond both is a sensor that fails now, and is taken off at once. */
static void find_drift(
    tireid_mpc_state *state, const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    const real half = TIREID_MPC_C(0.5) * params->period;
    const real share = share_of(params, &state->placed);
    const real gain[2] = { params->period / SHOWN, params->period / TURNED };
    const real rate[2] = { TIREID_MPC_C(1.0) / SHOWN, TIREID_MPC_C(1.0) / TURNED };
    const real shown[2] = { in->e_y, in->e_psi };
    const real good[2] = { ACROSS, AROUND };
    const real most[2] = { MOST_DRIFT, MOST_TURNING };
    real *const zeros[2] = { &state->drift, &state->turning };
    real moves[2];
    uint32_t i;
    move_of(in, moves);
    for (i = 0U; i < 2U; i++) {
        const real way = half * (moves[i] + state->apart[i]);
        const real error = shown[i] - (state->place[i] + way);
        real small;
        if ((state->watched == 0U) || !tireid_mpc_within(error, ASTRAY)) {
            state->place[i] = shown[i] + way;
        } else {
            state->place[i] += (TIREID_MPC_C(2.0) * way) + (TIREID_MPC_C(2.0) * (gain[i] * error));
            state->apart[i] =
                tireid_mpc_clipped(state->apart[i] + ((gain[i] * rate[i]) * error), most[i]);
        }
        small = tireid_mpc_clipped(state->apart[i] - state->stays[i], good[i]);
        state->stays[i] += share * small;
        *zeros[i] = state->apart[i] - small;
    }
}

/* Whether sensors contradict each other: what is apart is more than that of good ones, or one of them
 * moves as no tire moves a car. */
static bool contradicted(
    tireid_mpc_state *state, const tireid_mpc_params *params, const tireid_mpc_input *in)
{
    const real most = FASTEST * params->period;
    const bool follows = (state->watched == 0U)
        || (tireid_mpc_within(in->v_y - state->last[0], SWAYS + most)
            && tireid_mpc_within(in->r - state->last[1], TURNS + most));
    state->last[0] = in->v_y;
    state->last[1] = in->r;
    return !follows || !tireid_mpc_within(state->apart[0], ACROSS)
        || !tireid_mpc_within(state->apart[1], AROUND);
}

/* Whether what is followed tells something: sensors agree, and did for a while. */
static bool settled(const tireid_mpc_state *state, const tireid_mpc_params *params)
{
    return ((real)state->watched * params->period) > SETTLED;
}

/* Place of the friction that is held for the most likely one. */
static uint32_t best_of(const tireid_mpc_state *state)
{
    uint32_t best = 0U;
    uint32_t j;
    for (j = 1U; j < TIREID_MPC_GRIPS; j++) {
        best = (state->cost[j] < state->cost[best]) ? j : best;
    }
    return best;
}

/* Lowest friction that agrees with the data: from the best one down, with a part of the next one. */
static real least_grip(const tireid_mpc_state *state, const tireid_mpc_params *params)
{
    const real width = params->surprise - REFUTED;
    const uint32_t best = best_of(state);
    real share = TIREID_MPC_C(1.0);
    real grip = params->grips[best];
    uint32_t j;
    for (j = best + 1U; j < TIREID_MPC_GRIPS; j++) {
        const real left = (params->surprise - state->cost[j]) / width;
        share *= (left < TIREID_MPC_C(1.0)) ? left : TIREID_MPC_C(1.0);
        grip += share * (params->grips[j] - params->grips[j - 1U]);
    }
    return grip;
}

/* What is missed by each friction changes what it is held for; little does where none explains it. */
static void judge_grips(tireid_mpc_state *state, const tireid_mpc_params *params, const sight *seen)
{
    real fit = seen[0].squares;
    real counts;
    real least;
    uint32_t j;
    for (j = 1U; j < TIREID_MPC_GRIPS; j++) {
        fit = (seen[j].squares < fit) ? seen[j].squares : fit;
    }
    counts = (params->period / ALIKE) * (EXPECTED / (EXPECTED + fit));
    for (j = 0U; j < TIREID_MPC_GRIPS; j++) {
        state->cost[j] += counts * seen[j].squares;
    }
    least = state->cost[best_of(state)];
    for (j = 0U; j < TIREID_MPC_GRIPS; j++) {
        const real cost = state->cost[j] - least;
        state->cost[j] = (cost < params->surprise) ? cost : params->surprise;
    }
}

void tireid_mpc_watch(tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_input *in, real wheels, bool fit)
{
    if (!(params->caution > TIREID_MPC_C(0.0))) {
        state->grip = TIREID_MPC_C(1.0);
        state->zero = TIREID_MPC_C(0.0);
        state->drift = TIREID_MPC_C(0.0);
        state->turning = TIREID_MPC_C(0.0);
    } else if (!fit) {
        state->watched = 0U;
    } else {
        sight seen[TIREID_MPC_GRIPS];
        real feared;
        uint32_t best;
        uint32_t j;
        bool faulty;
        find_drift(state, params, in);
        faulty = contradicted(state, params, in);
        for (j = 0U; j < TIREID_MPC_GRIPS; j++) {
            if (faulty || (state->doubted == 0U)) {
                state->cost[j] = params->prior[j];
            }
            seen[j] = follow(state, params, in, wheels, j);
        }
        state->watched = faulty ? 0U : state->watched;
        if (settled(state, params)) {
            judge_grips(state, params, seen);
            best = best_of(state);
            find_zero(state, params, &seen[best], params->grips[best]);
        }
        feared = params->caution * (TIREID_MPC_C(1.0) - least_grip(state, params));
        if (state->doubted == 0U) {
            state->grip = TIREID_MPC_C(1.0) - feared;
        }
        state->grip += (params->period / (params->period + MOVES))
            * ((TIREID_MPC_C(1.0) - feared) - state->grip);
        state->watched += (state->watched < UINT32_MAX) ? 1U : 0U;
        state->doubted = 1U;
        if (!tireid_mpc_within(state->grip, TIREID_MPC_C(1.0))
            || !tireid_mpc_carriable(state->place, 2U) || !tireid_mpc_carriable(state->apart, 2U)
            || !tireid_mpc_carriable(state->cost, TIREID_MPC_GRIPS)
            || !tireid_mpc_carriable(state->impulse[0], 2U * TIREID_MPC_GRIPS)
            || !tireid_mpc_carriable(state->slips[0], 2U * TIREID_MPC_GRIPS)) {
            tireid_mpc_trust(state);
        }
    }
}

/* Move what is off the plan through a stage, with its feedback, and add what a force does. */
static void pass(const tireid_mpc_stage *stage, const real *feedback, const real *push, real *d)
{
    real next[NX];
    real u = TIREID_MPC_C(0.0);
    uint32_t i;
    uint32_t j;
    for (j = 0U; j < NX; j++) {
        u += feedback[j] * d[j];
    }
    for (i = 0U; i < NX; i++) {
        next[i] = stage->B[i] * u;
    }
    for (j = 0U; j < NX; j++) {
        for (i = 0U; i < NX; i++) {
            next[i] += stage->A[i + (NX * j)] * d[j];
        }
    }
    for (i = 0U; i < NX; i++) {
        d[i] = next[i];
    }
    d[2] += push[0];
    d[3] += push[1];
}

static real left_of(real margin, real limit)
{
    const real share = TIREID_MPC_C(1.0) - (margin / limit);
    return (share > LEFT) ? share : LEFT;
}

void tireid_mpc_tighten(
    const tireid_mpc_state *state, const tireid_mpc_params *params, tireid_mpc_work *work)
{
    const real dt = params->stage_time;
    const bool cautious = (params->caution > TIREID_MPC_C(0.0)) && settled(state, params);
    real d[2][NX] = { { TIREID_MPC_C(0.0) } }; /* by the front and by the rear axle */
    uint32_t k;
    uint32_t axle;
    uint32_t i;
    for (k = 0U; k < N; k++) {
        real margin[3] = { TIREID_MPC_C(0.0), TIREID_MPC_C(0.0), TIREID_MPC_C(0.0) };
        for (axle = 0U; cautious && (axle < 2U); axle++) {
            const tireid_mpc_stage *stage = &work->stage[k];
            const real *ahead = work->stage[k + 1U].slip_x;
            const real slip = stage->slip[axle];
            const real half =
                params->caution * (state->grip * doubt_at(params, axle, slip / state->grip));
            const real less = (slip > TIREID_MPC_C(0.0)) ? -half : half;
            const real arm = (axle == 0U) ? params->car[2] : -params->car[3];
            const real push[2] = { (dt * less) / params->car[0],
                (dt * (arm * less)) / params->car[1] };
            pass(stage, state->feedback[k], push, d[axle]);
            margin[0] += size_of(d[axle][0]);
            for (i = 0U; i < 2U; i++) {
                real moved = TIREID_MPC_C(0.0);
                uint32_t j;
                for (j = 2U; j <= STEERING; j++) {
                    moved += ahead[i + (2U * j)] * d[axle][j];
                }
                margin[1U + i] += size_of(moved);
            }
        }
        work->left[k][0] = left_of(margin[0], params->max_e_y);
        for (i = 0U; i < 2U; i++) {
            work->left[k][1U + i] = left_of(margin[1U + i], state->grip * params->max_slip[i]);
        }
    }
}
