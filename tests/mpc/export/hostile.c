/* Measurements that no sensor should deliver, weights that change every 20 steps, two instances. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "@name@.h"
#include "@name@_params.h"

#ifndef STEPS
#define STEPS 3000L
#endif
#define SWAP 20  /* steps between two changes of the weights */
#define TWIN 500 /* steps that a second instance takes too */

static uint64_t seed = 88172645463325252U;

static double uniform(double low, double high)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return low + ((high - low) * ((double)(seed >> 11) / 9007199254740992.0));
}

static @name@_real odd_number(void)
{
    const double zero = 0.0;
    const double large = (sizeof(@name@_real) > 4U) ? 1e300 : 3e38;
    const double odd[] = { zero / zero, 1.0 / zero, -1.0 / zero, 1e-42, -large, large, 0.0, 1e3 };
    return (@name@_real)odd[(int)uniform(0.0, 7.999)];
}

/* A car somewhere near the path at the limit of grip; one in eight with nonsense in it. */
static @name@_input next_input(long k)
{
    @name@_input in;
    const double v_x = uniform(5.0, 35.0);
    const double bend = uniform(-8.0, 8.0) / (v_x * v_x);
    const double turn = uniform(-8.0, 8.0) / (v_x * v_x);
    unsigned j;
    in.e_y = (@name@_real)uniform(-1.5, 1.5);
    in.e_psi = (@name@_real)uniform(-0.3, 0.3);
    in.v_y = (@name@_real)uniform(-1.5, 1.5);
    in.r = (@name@_real)uniform(-0.8, 0.8);
    for (j = 0; j <= @NAME@_HORIZON; j++) {
        in.kappa[j] = (@name@_real)(bend + ((turn - bend) * j / @NAME@_HORIZON));
        in.v_x[j] = (@name@_real)v_x;
    }
    if ((k % 8) == 7) {
        @name@_real *const field[] = { &in.e_y, &in.e_psi, &in.v_y, &in.r,
            &in.kappa[(unsigned)uniform(0.0, @NAME@_HORIZON)],
            &in.v_x[(unsigned)uniform(0.0, @NAME@_HORIZON)] };
        *field[(int)uniform(0.0, 5.999)] = odd_number();
    }
    return in;
}

static int is_finite(const @name@_input *in)
{
    double sum = fabs((double)in->e_y * 0.0) + fabs((double)in->e_psi * 0.0);
    unsigned j;
    sum += fabs((double)in->v_y * 0.0) + fabs((double)in->r * 0.0);
    for (j = 0; j <= @NAME@_HORIZON; j++) {
        sum += fabs((double)in->kappa[j] * 0.0) + fabs((double)in->v_x[j] * 0.0);
    }
    return isfinite(sum);
}

/* Other weights, or with nonsense in them, which must be refused. */
static int swap(@name@_params *params, const @name@_params *start)
{
    @name@_real weights[@NAME@_WEIGHTS];
    const @name@_params before = *params;
    const double share = uniform(0.5, 1.3);
    unsigned i;
    @name@_status status;
    for (i = 0; i < @NAME@_WEIGHTS; i++) {
        const double own = share * uniform(0.95, 1.05);
        weights[i] = (@name@_real)(own * (double)start->weights[i]);
    }
    status = @name@_set_weights(params, weights);
    weights[(int)uniform(0.0, @NAME@_WEIGHTS - 0.001)] = (@name@_real)NAN;
    if ((status != @NAME@_OK)
        || (@name@_set_weights(params, weights) != @NAME@_NOT_FINITE)
        || ((memcmp(&before, params, sizeof before) == 0) && (share < 0.9))) {
        printf("weights were not taken, or NaN was\n");
        return 1;
    }
    return 0;
}

/* Hard limits of the command and of the plan, and everything is a number. */
static int complaint(const @name@_state *state, const @name@_params *params, double before,
    double steering, @name@_status status)
{
    const double angle = (double)params->max_steering * 1.000001;
    const double rate = (double)params->max_rate * 1.000001;
    unsigned i;
    unsigned k;
    if (!(fabs(steering) <= angle)) {
        printf("the angle is %g\n", steering);
        return 1;
    }
    if (!(fabs(steering - before) <= ((rate * (double)params->period) + 1e-7))) {
        printf("the angle changes by %g\n", steering - before);
        return 1;
    }
    if (state->iterations > params->max_iterations) {
        printf("%u iterations\n", (unsigned)state->iterations);
        return 1;
    }
    for (k = 0; k <= @NAME@_HORIZON; k++) {
        for (i = 0; i < @NAME@_STATES; i++) {
            if ((status <= @NAME@_ITERATION_LIMIT) && !isfinite(state->x[k][i])) {
                printf("the plan is not finite\n");
                return 1;
            }
        }
        if ((status <= @NAME@_ITERATION_LIMIT) && !(fabs((double)state->x[k][4]) <= angle)) {
            printf("the plan steers %g\n", (double)state->x[k][4]);
            return 1;
        }
        if ((k < @NAME@_HORIZON) && !(fabs((double)state->u[k]) <= rate)) {
            printf("the plan steers at %g\n", (double)state->u[k]);
            return 1;
        }
    }
    return 0;
}

static int torture(const @name@_params *start)
{
    static @name@_state state;
    static @name@_state twin;
    static @name@_work work;
    static @name@_work own;
    @name@_params params = *start;
    unsigned long kinds[@NAME@_STATUSES] = { 0 };
    unsigned long unsolved = 0; /* measurements with sense that gave no plan */
    long k;
    @name@_init(&state);
    @name@_init(&twin);
    for (k = 0; k < STEPS; k++) {
        const @name@_input in = next_input(k);
        const double before = (double)state.commands[0];
        @name@_real steering = (@name@_real)NAN;
        @name@_real same = (@name@_real)NAN;
        @name@_status status;
        if (((k % SWAP) == 0) && swap(&params, start)) {
            return 1;
        }
        if ((k % 100) == 50) {
            memset(&work, 0xA5, sizeof work); /* it means nothing between two steps */
        }
        status = @name@_step(&state, &params, &work, &in, &steering);
        kinds[status]++;
        if (is_finite(&in) == (status == @NAME@_NOT_FINITE)) {
            printf("status %d of measurement %ld\n", (int)status, k);
            return 1;
        }
        if (k < TWIN) {
            (void)@name@_step(&twin, &params, &own, &in, &same);
        }
        if ((k < TWIN) && (memcmp(&state, &twin, sizeof state) != 0)) {
            printf("twins differ after %ld\n", k);
            return 1;
        }
        if (complaint(&state, &params, before, (double)steering, status)) {
            printf("after %ld, status %d\n", k, (int)status);
            return 1;
        }
        unsolved += ((status == @NAME@_QP_FAILED) && ((k % 8) != 7)) ? 1UL : 0UL;
        if (state.faults[status] != kinds[status]) {
            printf("status %d was not counted\n", (int)status);
            return 1;
        }
    }
    printf("ok %lu limit %lu failed %lu not_finite %lu off_path %lu off_map %lu slow %lu\n"
           "unsolved %lu\n",
        kinds[0], kinds[1], kinds[2], kinds[3], kinds[4], kinds[5], kinds[6], unsolved);
    return 0;
}

int main(void)
{
    static @name@_params params;
    @name@_default_params(&params);
    return torture(&params);
}
