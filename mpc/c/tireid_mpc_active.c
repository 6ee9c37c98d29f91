/* Primal-dual active set on the stages; a set is solved by one Riccati recursion.
 *
 * Rows that are active hold as equations: of the input or of the angle behind it, so that the stage has
 * no choice left and is eliminated; soft ones as the quadratics 1/2 s^2 / regular. The next set is
 * what this solution says: rows that it breaks come in, rows that hold it back from less cost go.
 * Where nothing changes all conditions of optimality hold (Hintermueller, Ito and Kunisch, SIAM J. Optim.
 * 13, 2002). Where a set asks for no fewer changes than one before, so that sets may come again and again,
 * the first stage alone changes, until they are fewer (Judice and Pires, Computers & Operations Research
 * 21, 1994). Behind the last stage that changed the recursion stays as it is. */
#include "tireid_mpc_active.h"

#include "tireid_mpc_equations.h"
#include "tireid_mpc_numbers.h"
#include "tireid_mpc_riccati.h"

#define N TIREID_MPC_HORIZON
#define ROWS TIREID_MPC_ROWS
#define RATE 0U              /* place of the rate among the rows of a stage */
#define ANGLE 1U             /* of the angle; then soft ones */
#define FEW_PRESSED (N / 6U) /* stages, so few that the limits of the way are those to begin with */

#define real tireid_mpc_real

/* The side of a row that a value is beyond: 1, -1, or 0 within. */
static int32_t side_of(real value, real limit)
{
    return ((value > limit) ? 1 : 0) - ((value < -limit) ? 1 : 0);
}

/* Take the active rows of stage k into the program; of angle and rate one alone can be held. */
static void apply(tireid_mpc_work *work, uint32_t k)
{
    const uint32_t p = k * ROWS;
    uint32_t i;
    if (work->active[p + ANGLE] != 0) {
        work->active[p + RATE] = 0;
    }
    work->held[k] = TIREID_MPC_FREE;
    for (i = RATE; i <= ANGLE; i++) {
        work->weight[0][p + i] = TIREID_MPC_C(0.0);
        work->weight[1][p + i] = TIREID_MPC_C(0.0);
        work->slope[p + i] = TIREID_MPC_C(0.0);
        if (work->active[p + i] != 0) {
            work->held[k] = (i == RATE) ? TIREID_MPC_RATE : TIREID_MPC_ANGLE;
            work->held_to[k] =
                ((real)work->active[p + i] - work->value[p + i]) / work->scale[p + i];
        }
    }
    for (i = ANGLE + 1U; i < ROWS; i++) {
        const bool active = work->active[p + i] != 0;
        const real weight = active ? (TIREID_MPC_C(1.0) / work->regular[p + i]) : TIREID_MPC_C(0.0);
        work->weight[0][p + i] = weight;
        work->weight[1][p + i] = TIREID_MPC_C(0.0);
        work->slope[p + i] = weight * (work->value[p + i] - (real)work->active[p + i]);
    }
}

/* Whether the way is steered as fast as can be in many stages in which the plan is not. */
static bool is_thrown(const tireid_mpc_work *work, real most, const real *plan, uint32_t stages)
{
    uint32_t pressed = 0U;
    uint32_t k;
    for (k = 0U; k < stages; k++) {
        const bool here = !tireid_mpc_within(work->u[k], most);
        pressed += (here && tireid_mpc_within(plan[k], most)) ? 1U : 0U;
    }
    return pressed > FEW_PRESSED;
}

void tireid_mpc_begin_set(
    tireid_mpc_work *work, const tireid_mpc_params *params, const real *plan, uint32_t stages)
{
    const real limit = TIREID_MPC_C(1.0) - params->tolerance;
    const bool thrown = is_thrown(work, params->max_rate * limit, plan, stages);
    uint32_t k;
    uint32_t i;
    for (k = 0U; k < stages; k++) {
        const uint32_t p = k * ROWS;
        for (i = 0U; i < ROWS; i++) {
            work->active[p + i] = thrown ? 0 : side_of(work->value[p + i], limit);
        }
        if (thrown) {
            work->active[p + RATE] = side_of(plan[k] * work->scale[p + RATE], limit);
        }
    }
}

/* Hard rows of stage k that are active next; so far they are those that are reached. */
static void choose_held(tireid_mpc_work *work, uint32_t k, real tolerance)
{
    const uint32_t p = k * ROWS;
    int32_t *next = &work->next[p];
    if (work->held[k] != TIREID_MPC_FREE) {
        const uint32_t i = (work->held[k] == TIREID_MPC_RATE) ? RATE : ANGLE;
        const real outward = -(real)work->active[p + i] * tireid_mpc_pull(work, k);
        next[i] = (outward < -tolerance) ? 0 : work->active[p + i];
    }
    if ((next[RATE] != 0) && (next[ANGLE] != 0)) {
        const bool turns = (work->held[k] == TIREID_MPC_RATE) && (next[RATE] == next[ANGLE]);
        next[turns ? RATE : ANGLE] = 0;
    }
}

/* Count of the rows that the solution of this set says to change; `next` is the set behind that. */
static uint32_t choose(tireid_mpc_work *work, real tolerance)
{
    const real limit[2] = { TIREID_MPC_C(1.0) + tolerance, TIREID_MPC_C(1.0) - tolerance };
    uint32_t changes = 0U;
    uint32_t k;
    uint32_t p;
    for (p = 0U; p < (N * ROWS); p++) {
        work->next[p] = side_of(work->reached[p], (work->active[p] == 0) ? limit[0] : limit[1]);
    }
    for (k = 0U; k < N; k++) {
        choose_held(work, k, tolerance);
    }
    for (p = 0U; p < (N * ROWS); p++) {
        changes += (work->next[p] != work->active[p]) ? 1U : 0U;
    }
    return changes;
}

/* Change the set in all stages, or in the first that changes; the last stage that did. */
static uint32_t change(tireid_mpc_work *work, bool first_only)
{
    uint32_t last = N;
    uint32_t k;
    uint32_t i;
    for (k = 0U; (k < N) && (!first_only || (last == N)); k++) {
        for (i = k * ROWS; i < ((k + 1U) * ROWS); i++) {
            last = (work->next[i] != work->active[i]) ? k : last;
            work->active[i] = work->next[i];
        }
    }
    return last;
}

bool tireid_mpc_prepare_set(tireid_mpc_work *work, real R, uint32_t last)
{
    bool convex;
    uint32_t k;
    for (k = 0U; k <= last; k++) {
        apply(work, k);
    }
    convex = tireid_mpc_factorize(work, R, last);
    if (convex) {
        tireid_mpc_backward(work, R, last);
    }
    return convex;
}

tireid_mpc_status tireid_mpc_active_set(
    tireid_mpc_work *work, const tireid_mpc_params *params, uint32_t most)
{
    tireid_mpc_status status = TIREID_MPC_ITERATION_LIMIT;
    const uint32_t left = params->max_iterations - work->iterations;
    const uint32_t tries = (left < most) ? left : most;
    uint32_t fewest = UINT32_MAX;
    uint32_t tried = 0U;
    while ((status == TIREID_MPC_ITERATION_LIMIT) && (tried < tries)) {
        uint32_t changes;
        work->iterations++;
        tried++;
        tireid_mpc_forward(work);
        changes = choose(work, params->tolerance);
        if (changes == 0U) {
            status = TIREID_MPC_OK;
        } else if ((tried < tries)
            && !tireid_mpc_prepare_set(work, params->cost_rate, change(work, changes >= fewest))) {
            status = TIREID_MPC_QP_FAILED;
        } else {
            fewest = (changes < fewest) ? changes : fewest;
        }
    }
    return status;
}
