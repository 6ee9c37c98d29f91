/* Measurements that no sensor should deliver, weights that change every 20 steps, two instances. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tireid_mpc.h"
#include "tireid_mpc_params.h"

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

static tireid_mpc_real odd_number(void)
{
    const double zero = 0.0;
    const double large = (sizeof(tireid_mpc_real) > 4U) ? 1e300 : 3e38;
    const double odd[] = { zero / zero, 1.0 / zero, -1.0 / zero, 1e-42, -large, large, 0.0, 1e3 };
    return (tireid_mpc_real)odd[(int)uniform(0.0, 7.999)];
}

/* A car somewhere near the path at the limit of grip; one in eight with nonsense in it. */
static tireid_mpc_input next_input(long k)
{
    tireid_mpc_input in;
    const double v_x = uniform(5.0, 35.0);
    const double bend = uniform(-8.0, 8.0) / (v_x * v_x);
    const double turn = uniform(-8.0, 8.0) / (v_x * v_x);
    unsigned j;
    in.e_y = (tireid_mpc_real)uniform(-1.5, 1.5);
    in.e_psi = (tireid_mpc_real)uniform(-0.3, 0.3);
    in.v_y = (tireid_mpc_real)uniform(-1.5, 1.5);
    in.r = (tireid_mpc_real)uniform(-0.8, 0.8);
    for (j = 0; j <= TIREID_MPC_HORIZON; j++) {
        in.kappa[j] = (tireid_mpc_real)(bend + ((turn - bend) * j / TIREID_MPC_HORIZON));
        in.v_x[j] = (tireid_mpc_real)v_x;
    }
    if ((k % 8) == 7) {
        tireid_mpc_real *const field[] = { &in.e_y, &in.e_psi, &in.v_y, &in.r,
            &in.kappa[(unsigned)uniform(0.0, TIREID_MPC_HORIZON)],
            &in.v_x[(unsigned)uniform(0.0, TIREID_MPC_HORIZON)] };
        *field[(int)uniform(0.0, 5.999)] = odd_number();
    }
    return in;
}

static int is_finite(const tireid_mpc_input *in)
{
    double sum = fabs((double)in->e_y * 0.0) + fabs((double)in->e_psi * 0.0);
    unsigned j;
    sum += fabs((double)in->v_y * 0.0) + fabs((double)in->r * 0.0);
    for (j = 0; j <= TIREID_MPC_HORIZON; j++) {
        sum += fabs((double)in->kappa[j] * 0.0) + fabs((double)in->v_x[j] * 0.0);
    }
    return isfinite(sum);
}

/* Other weights, or with nonsense in them, which must be refused. */
static int swap(tireid_mpc_params *params, const tireid_mpc_params *start)
{
    tireid_mpc_real weights[TIREID_MPC_WEIGHTS];
    const tireid_mpc_params before = *params;
    const double share = uniform(0.5, 1.3);
    unsigned i;
    tireid_mpc_status status;
    for (i = 0; i < TIREID_MPC_WEIGHTS; i++) {
        const double own = share * uniform(0.95, 1.05);
        weights[i] = (tireid_mpc_real)(own * (double)start->weights[i]);
    }
    status = tireid_mpc_set_weights(params, weights);
    weights[(int)uniform(0.0, TIREID_MPC_WEIGHTS - 0.001)] = (tireid_mpc_real)NAN;
    if ((status != TIREID_MPC_OK)
        || (tireid_mpc_set_weights(params, weights) != TIREID_MPC_NOT_FINITE)
        || ((memcmp(&before, params, sizeof before) == 0) && (share < 0.9))) {
        printf("weights were not taken, or NaN was\n");
        return 1;
    }
    return 0;
}

/* Hard limits of the command and of the plan, and everything is a number. */
static int complaint(const tireid_mpc_state *state, const tireid_mpc_params *params, double before,
    double steering, tireid_mpc_status status)
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
    for (k = 0; k <= TIREID_MPC_HORIZON; k++) {
        for (i = 0; i < TIREID_MPC_STATES; i++) {
            if ((status <= TIREID_MPC_ITERATION_LIMIT) && !isfinite(state->x[k][i])) {
                printf("the plan is not finite\n");
                return 1;
            }
        }
        if ((status <= TIREID_MPC_ITERATION_LIMIT) && !(fabs((double)state->x[k][4]) <= angle)) {
            printf("the plan steers %g\n", (double)state->x[k][4]);
            return 1;
        }
        if ((k < TIREID_MPC_HORIZON) && !(fabs((double)state->u[k]) <= rate)) {
            printf("the plan steers at %g\n", (double)state->u[k]);
            return 1;
        }
    }
    return 0;
}

static int torture(const tireid_mpc_params *start)
{
    static tireid_mpc_state state;
    static tireid_mpc_state twin;
    static tireid_mpc_work work;
    static tireid_mpc_work own;
    tireid_mpc_params params = *start;
    unsigned long kinds[TIREID_MPC_STATUSES] = { 0 };
    unsigned long unsolved = 0; /* measurements with sense that gave no plan */
    long k;
    tireid_mpc_init(&state);
    tireid_mpc_init(&twin);
    for (k = 0; k < STEPS; k++) {
        const tireid_mpc_input in = next_input(k);
        const double before = (double)state.commands[0];
        tireid_mpc_real steering = (tireid_mpc_real)NAN;
        tireid_mpc_real same = (tireid_mpc_real)NAN;
        tireid_mpc_status status;
        if (((k % SWAP) == 0) && swap(&params, start)) {
            return 1;
        }
        if ((k % 100) == 50) {
            memset(&work, 0xA5, sizeof work); /* it means nothing between two steps */
        }
        status = tireid_mpc_step(&state, &params, &work, &in, &steering);
        kinds[status]++;
        if (is_finite(&in) == (status == TIREID_MPC_NOT_FINITE)) {
            printf("status %d of measurement %ld\n", (int)status, k);
            return 1;
        }
        if (k < TWIN) {
            (void)tireid_mpc_step(&twin, &params, &own, &in, &same);
        }
        if ((k < TWIN) && (memcmp(&state, &twin, sizeof state) != 0)) {
            printf("twins differ after %ld\n", k);
            return 1;
        }
        if (complaint(&state, &params, before, (double)steering, status)) {
            printf("after %ld, status %d\n", k, (int)status);
            return 1;
        }
        unsolved += ((status == TIREID_MPC_QP_FAILED) && ((k % 8) != 7)) ? 1UL : 0UL;
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
    static tireid_mpc_params params;
    tireid_mpc_default_params(&params);
    return torture(&params);
}
