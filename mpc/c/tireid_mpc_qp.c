/* Primal-dual interior point on the stages; a Newton step is one Riccati recursion.
 *
 * A row |v| <= 1 has two sides, each with a gap t > 0 and a multiplier l > 0: v <= 1 - t + l reg,
 * which breaks a soft row by l reg. The iterate is (t, l) alone: a Newton step gives x and u as a
 * whole, and they are the answer once all l t are small. Predictor and corrector, after Mehrotra,
 * share one factorization.
 *
 * Before it, and once it comes close, sets of active rows alone are tried, each at most a third of an
 * iteration. Where no sets are wanted, nothing is factorized for one. */
#include "tireid_mpc_qp.h"

#include "tireid_mpc_active.h"
#include "tireid_mpc_equations.h"
#include "tireid_mpc_numbers.h"
#include "tireid_mpc_riccati.h"

#define N TIREID_MPC_HORIZON
#define SIDE (N * TIREID_MPC_ROWS)     /* rows of all stages */
#define CLOSE TIREID_MPC_C(0.1)        /* mean product l t from which on the set is looked at */
#define SETTLED ((2U * N) / 5U)        /* rows that may change yet, so that the set is tried */
#define SETS_CLOSE 2U                  /* then: mostly its own is right, or far off */
#define SMALLEST_GAP TIREID_MPC_C(0.1) /* to begin with */
#define NEAR TIREID_MPC_C(10.0)        /* products l t to begin with */
#define FAR TIREID_MPC_C(1e4)          /* the same, where the first way was blocked */
#define BLOCKED TIREID_MPC_C(0.2)      /* step of the gaps that is too short */
#define KEPT TIREID_MPC_C(0.995)       /* share of the way to the nearest bound that a step goes */
#if TIREID_MPC_SINGLE
#define LEAST TIREID_MPC_C(3e-6) /* gap or multiplier, which rounding would make zero */
#else
#define LEAST TIREID_MPC_C(1e-14)
#endif

#define real tireid_mpc_real

/* Begin at the gaps of the plan, with all products l t the same. */
static void begin(tireid_mpc_work *work, real product)
{
    uint32_t side;
    uint32_t p;
    for (side = 0U; side < 2U; side++) {
        const real sign = (side == 0U) ? TIREID_MPC_C(1.0) : -TIREID_MPC_C(1.0);
        for (p = 0U; p < SIDE; p++) {
            const real gap = TIREID_MPC_C(1.0) - (sign * work->value[p]);
            const real t = (gap > SMALLEST_GAP) ? gap : SMALLEST_GAP;
            work->gap[side][p] = t;
            work->multiplier[side][p] = product / t;
            work->gap_step[side][p] = TIREID_MPC_C(0.0);
            work->multiplier_step[side][p] = TIREID_MPC_C(0.0);
        }
    }
}

/* What the rows add to the diagonal of the costs: weights of the squares of their values. */
static void weigh(tireid_mpc_work *work)
{
    uint32_t p;
    uint32_t side;
    for (side = 0U; side < 2U; side++) {
        const real *restrict t = work->gap[side];
        const real *restrict l = work->multiplier[side];
        const real *restrict reg = work->regular;
        real *restrict inverse = work->inverse[side];
        real *restrict weight = work->weight[side];
        for (p = 0U; p < SIDE; p++) {
            inverse[p] = TIREID_MPC_C(1.0) / (t[p] + (l[p] * reg[p]));
            weight[p] = l[p] * inverse[p];
        }
    }
}

/* What the rows add to the gradients, for products l t of `target` in each side. */
static void pull(tireid_mpc_work *work)
{
    const real *restrict value = work->value;
    real *restrict slope = work->slope;
    uint32_t p;
    for (p = 0U; p < SIDE; p++) {
        const real high = (work->target[0][p] * work->inverse[0][p])
            + (work->weight[0][p] * (value[p] - TIREID_MPC_C(1.0)));
        const real low = (work->target[1][p] * work->inverse[1][p])
            - (work->weight[1][p] * (value[p] + TIREID_MPC_C(1.0)));
        slope[p] = high - low;
    }
}

/* Mean of the products l t after steps along the directions. */
static real mean_product(const tireid_mpc_work *work, real primal, real dual)
{
    real sum[2] = { TIREID_MPC_C(0.0), TIREID_MPC_C(0.0) };
    uint32_t p;
    for (p = 0U; p < SIDE; p++) {
        sum[0] += (work->gap[0][p] + (primal * work->gap_step[0][p]))
            * (work->multiplier[0][p] + (dual * work->multiplier_step[0][p]));
        sum[1] += (work->gap[1][p] + (primal * work->gap_step[1][p]))
            * (work->multiplier[1][p] + (dual * work->multiplier_step[1][p]));
    }
    return (sum[0] + sum[1]) / (real)(2U * SIDE);
}

/* A direction: the longest steps, at most 1, that keep gaps and multipliers positive; their
 * mean product after these steps; how negative a gap would be after the whole step, or a multiplier
 * in parts of the largest. */
typedef struct {
    real primal;
    real dual;
    real product;
    real negative;
    real largest;
} outlook;

static outlook direct(tireid_mpc_work *work)
{
    outlook seen;
    real most[2] = { TIREID_MPC_C(1.0), TIREID_MPC_C(1.0) }; /* largest fall, in parts */
    real least[2] = { TIREID_MPC_C(0.0), TIREID_MPC_C(0.0) };
    real largest = TIREID_MPC_C(1.0); /* multiplier */
    uint32_t p;
    uint32_t side;
    for (side = 0U; side < 2U; side++) {
        const real sign = (side == 0U) ? TIREID_MPC_C(1.0) : -TIREID_MPC_C(1.0);
        const real *restrict t = work->gap[side];
        const real *restrict l = work->multiplier[side];
        const real *restrict weight = work->weight[side];
        const real *restrict inverse = work->inverse[side];
        const real *restrict target = work->target[side];
        const real *restrict reg = work->regular;
        const real *restrict reached = work->reached;
        real *restrict dt = work->gap_step[side];
        real *restrict dl = work->multiplier_step[side];
        real most_t = most[0];
        real most_l = most[1];
        real least_t = least[0];
        real least_l = least[1];
        for (p = 0U; p < SIDE; p++) {
            const real beyond = (sign * reached[p]) - TIREID_MPC_C(1.0);
            const real next = (weight[p] * beyond) + (target[p] * inverse[p]);
            const real fall_l = TIREID_MPC_C(1.0) - (next / l[p]);
            const real next_t = (next * reg[p]) - beyond;
            const real fall_t = TIREID_MPC_C(1.0) - (next_t / t[p]);
            dl[p] = next - l[p];
            dt[p] = next_t - t[p];
            most_l = (fall_l > most_l) ? fall_l : most_l;
            most_t = (fall_t > most_t) ? fall_t : most_t;
            least_l = (next < least_l) ? next : least_l;
            largest = (next > largest) ? next : largest;
            least_t = (next_t < least_t) ? next_t : least_t;
        }
        most[0] = most_t;
        most[1] = most_l;
        least[0] = least_t;
        least[1] = least_l;
    }
    seen.primal = TIREID_MPC_C(1.0) / most[0];
    seen.dual = TIREID_MPC_C(1.0) / most[1];
    seen.product = mean_product(work, seen.primal, seen.dual);
    least[1] /= largest;
    seen.negative = (least[0] < least[1]) ? -least[0] : -least[1];
    seen.largest = largest;
    return seen;
}

static real shortened(real step)
{
    return (step < TIREID_MPC_C(1.0)) ? (KEPT * step) : step;
}

static real at_least(real x, real least)
{
    return (x > least) ? x : least;
}

static void go(tireid_mpc_work *work, real primal, real dual)
{
    uint32_t side;
    uint32_t p;
    for (side = 0U; side < 2U; side++) {
        real *restrict t = work->gap[side];
        real *restrict l = work->multiplier[side];
        for (p = 0U; p < SIDE; p++) {
            t[p] = at_least(t[p] + (primal * work->gap_step[side][p]), LEAST);
            l[p] = at_least(l[p] + (dual * work->multiplier_step[side][p]), LEAST);
        }
    }
}

/* Products l t to aim at: none, or `center` with what the direction itself would change. */
static void aim(tireid_mpc_work *work, real center, real share)
{
    uint32_t side;
    uint32_t p;
    for (side = 0U; side < 2U; side++) {
        for (p = 0U; p < SIDE; p++) {
            work->target[side][p] = ((work->gap[side][p] * work->multiplier[side][p]) + center)
                - (share * (work->gap_step[side][p] * work->multiplier_step[side][p]));
        }
    }
}

static bool is_solved(const outlook *seen, const tireid_mpc_params *params)
{
    return (seen->product <= (params->tolerance * seen->largest))
        && (seen->negative <= params->tolerance);
}

/* One Newton step with predictor and corrector; true once the answer is good enough. */
static bool improve(tireid_mpc_work *work, const tireid_mpc_params *params, real mu, outlook *seen)
{
    const real R = params->cost_rate;
    bool solved;
    aim(work, TIREID_MPC_C(0.0), TIREID_MPC_C(0.0));
    pull(work);
    tireid_mpc_backward(work, R, N - 1U);
    tireid_mpc_forward(work);
    *seen = direct(work);
    solved = is_solved(seen, params);
    if (!solved) {
        const real share = seen->product / mu;
        aim(work, mu * share * share * share, TIREID_MPC_C(1.0));
        pull(work);
        tireid_mpc_backward(work, R, N - 1U);
        tireid_mpc_forward(work);
        *seen = direct(work);
        solved = is_solved(seen, params);
    }
    return solved;
}

/* Find the rows that are at their limits by now; the count of those that were not before, or were. */
static uint32_t find_set(tireid_mpc_work *work)
{
    uint32_t changes = 0U;
    uint32_t p;
    for (p = 0U; p < SIDE; p++) {
        const int32_t high = (work->multiplier[0][p] > work->gap[0][p]) ? 1 : 0;
        const int32_t low = (work->multiplier[1][p] > work->gap[1][p]) ? 1 : 0;
        changes += (work->active[p] != (high - low)) ? 1U : 0U;
        work->active[p] = high - low;
    }
    return changes;
}

/* Give every stage its choice back, where a set was not the answer. */
static void let_all_go(tireid_mpc_work *work)
{
    uint32_t k;
    for (k = 0U; k < N; k++) {
        work->held[k] = TIREID_MPC_FREE;
    }
}

/* Take the shortened step; once the set of active rows hardly changes any more, try it. */
static tireid_mpc_status advance(
    tireid_mpc_work *work, const tireid_mpc_params *params, const outlook *seen, real *mu)
{
    tireid_mpc_status status = TIREID_MPC_ITERATION_LIMIT;
    go(work, shortened(seen->primal), shortened(seen->dual));
    *mu = mean_product(work, TIREID_MPC_C(0.0), TIREID_MPC_C(0.0));
    if ((params->max_active_sets > 0U) && (*mu <= CLOSE) && (find_set(work) <= SETTLED)) {
        if (tireid_mpc_prepare_set(work, params->cost_rate, N - 1U)) {
            status = tireid_mpc_active_set(work, params, SETS_CLOSE);
        }
        if (status == TIREID_MPC_ITERATION_LIMIT) {
            let_all_go(work);
        }
    }
    return status;
}

static tireid_mpc_status interior_point(tireid_mpc_work *work, const tireid_mpc_params *params)
{
    tireid_mpc_status status = TIREID_MPC_ITERATION_LIMIT;
    real mu = NEAR; /* mean of the products l t */
    bool near = true;
    begin(work, mu);
    while ((status == TIREID_MPC_ITERATION_LIMIT) && (work->iterations < params->max_iterations)) {
        outlook seen;
        work->iterations++;
        weigh(work);
        if (!tireid_mpc_factorize(work, params->cost_rate, N - 1U)) {
            status = TIREID_MPC_QP_FAILED;
        } else if (improve(work, params, mu, &seen)) {
            (void)find_set(work);
            status = TIREID_MPC_OK;
        } else if (!tireid_mpc_finite(seen.product)) {
            status = TIREID_MPC_QP_FAILED; /* and will be after every other step */
        } else if (near && (seen.primal < BLOCKED)) {
            near = false;
            mu = FAR;
            begin(work, mu);
        } else {
            status = advance(work, params, &seen, &mu);
        }
    }
    return status;
}

void tireid_mpc_prepare_qp(
    tireid_mpc_work *work, const tireid_mpc_params *params, const real *plan, uint32_t stages)
{
    tireid_mpc_begin_set(work, params, plan, stages);
    work->ready = (params->max_active_sets > 0U) && ((stages == N) || work->ready)
        && tireid_mpc_prepare_set(work, params->cost_rate, stages - 1U);
}

tireid_mpc_status tireid_mpc_qp(tireid_mpc_work *work, const tireid_mpc_params *params)
{
    tireid_mpc_status status = TIREID_MPC_ITERATION_LIMIT;
    work->iterations = 0U;
    if (work->ready) {
        status = tireid_mpc_active_set(work, params, params->max_active_sets);
    }
    if (status == TIREID_MPC_ITERATION_LIMIT) {
        let_all_go(work);
        status = interior_point(work, params);
    }
    return status;
}
