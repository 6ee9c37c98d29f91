/* Self-test: steering against vectors that were computed elsewhere, guards, weights. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tireid_mpc.h"
#include "tireid_mpc_params.h"
#include "tireid_mpc_vectors.h"

#if TIREID_MPC_SINGLE
#define TOLERANCE VECTOR_TOLERANCE_SINGLE /* rad */
#else
#define TOLERANCE VECTOR_TOLERANCE_DOUBLE /* rad */
#endif

static int failures = 0;
static tireid_mpc_work work;

static void check(int holds, const char *rule)
{
    if (!holds) {
        printf("FAILED: %s\n", rule);
        failures++;
    }
}

static tireid_mpc_input vector(unsigned k)
{
    tireid_mpc_input input;
    unsigned j;
    input.e_y = (tireid_mpc_real)vector_input[k][0];
    input.e_psi = (tireid_mpc_real)vector_input[k][1];
    input.v_y = (tireid_mpc_real)vector_input[k][2];
    input.r = (tireid_mpc_real)vector_input[k][3];
    for (j = 0; j <= TIREID_MPC_HORIZON; j++) {
        const unsigned at = (j == 0) ? k : (k + VECTOR_OFFSET + (VECTOR_STRIDE * (j - 1)));
        input.kappa[j] = (tireid_mpc_real)vector_road[at][0];
        input.v_x[j] = (tireid_mpc_real)vector_road[at][1];
    }
    return input;
}

/* Take the vectors; return the largest difference of the steering [rad]. */
static double drive(tireid_mpc_state *state, const tireid_mpc_params *params)
{
    double worst = 0.0;
    unsigned k;
    for (k = 0; k < VECTORS; k++) {
        const tireid_mpc_input input = vector(k);
        const double before = (double)state->commands[0];
        tireid_mpc_real steering;
        const tireid_mpc_status status = tireid_mpc_step(state, params, &work, &input, &steering);
        const double difference = fabs((double)steering - vector_output[k][0]);
        worst = (difference <= worst) ? worst : difference;
        check((double)status == vector_output[k][1], "the status is that of the vector");
        check(fabs((double)steering) <= (double)params->max_steering, "the angle is kept");
        check(fabs((double)steering - before)
                <= (1.000001 * (double)(params->max_rate * params->period)),
            "the rate is kept");
    }
    return worst;
}

/* Whether a step has a status, and steers within the limits. */
static void refuse(tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_input *input, tireid_mpc_status wanted, const char *rule)
{
    const double most = 1.000001 * (double)(params->max_rate * params->period);
    const double before = (double)state->commands[0];
    const uint32_t faults = state->faults[wanted];
    tireid_mpc_real steering;
    const tireid_mpc_status status = tireid_mpc_step(state, params, &work, input, &steering);
    check(status == wanted, rule);
    check(state->faults[wanted] == (faults + 1U), "what is refused is counted");
    check(fabs((double)steering - before) <= most, "what is refused is steered through");
}

static void test_guards(tireid_mpc_state *state, const tireid_mpc_params *params)
{
    const tireid_mpc_real zero = 0;
    const tireid_mpc_real nan = zero / zero;
    const tireid_mpc_input good = vector(VECTORS - 1);
    tireid_mpc_input input = good;
    tireid_mpc_real steering;
    input.v_y = nan;
    refuse(state, params, &input, TIREID_MPC_NOT_FINITE, "NaN is refused");
    input = good;
    input.kappa[TIREID_MPC_HORIZON] = (tireid_mpc_real)1.0 / zero;
    refuse(state, params, &input, TIREID_MPC_NOT_FINITE, "an infinite curvature is refused");
    input = good;
    input.e_y = params->widest_e_y * 2;
    refuse(state, params, &input, TIREID_MPC_OFF_PATH, "a car off the path is known");
    input = good;
    input.r = params->max_yaw_rate * -2;
    refuse(state, params, &input, TIREID_MPC_OFF_MAP, "a car that spins is known");
    input = good;
    input.v_x[1] = params->min_speed / 2;
    refuse(state, params, &input, TIREID_MPC_TOO_SLOW, "a slow car is known");
    check(
        tireid_mpc_late(state, state->commands[1]) == TIREID_MPC_OK, "a late command is accepted");
    check(tireid_mpc_late(state, nan) == TIREID_MPC_BAD_CALL, "NaN was not steered");
    check(tireid_mpc_reset(state, params, 2 * params->max_steering) == TIREID_MPC_BAD_CALL,
        "wheels beyond their limit");
    check(tireid_mpc_reset(state, NULL, 0) == TIREID_MPC_BAD_CALL, "null limits");
    check(tireid_mpc_step(NULL, params, &work, &good, &steering) == TIREID_MPC_BAD_CALL,
        "null state");
    check(tireid_mpc_step(state, NULL, &work, &good, &steering) == TIREID_MPC_BAD_CALL,
        "null params");
    check(
        tireid_mpc_step(state, params, NULL, &good, &steering) == TIREID_MPC_BAD_CALL, "null work");
    check(tireid_mpc_step(state, params, &work, NULL, &steering) == TIREID_MPC_BAD_CALL,
        "null input");
    check(
        tireid_mpc_step(state, params, &work, &good, NULL) == TIREID_MPC_BAD_CALL, "null steering");
}

static void test_params(const tireid_mpc_params *params)
{
    static tireid_mpc_state state;
    const tireid_mpc_real zero = 0;
    tireid_mpc_params other = *params;
    tireid_mpc_real weights[TIREID_MPC_WEIGHTS];
    unsigned i;
    check(tireid_mpc_accepts(params), "what was exported is accepted");
    (void)memcpy(weights, params->weights, sizeof weights);
    for (i = 0; i < TIREID_MPC_WEIGHTS; i++) {
        weights[i] *= (tireid_mpc_real)0.8;
    }
    check(tireid_mpc_set_weights(&other, weights) == TIREID_MPC_OK, "other weights are accepted");
    (void)tireid_mpc_init(&state);
    check(drive(&state, &other) > 2e-3, "other weights steer otherwise");
    weights[TIREID_MPC_WEIGHTS - 1U] = zero / zero;
    check(tireid_mpc_set_weights(&other, weights) == TIREID_MPC_NOT_FINITE, "NaN is no weight");
    check(tireid_mpc_accepts(&other), "weights that were refused are not there");
    other.period = -other.period;
    check(!tireid_mpc_accepts(&other), "a negative period is not accepted");
}

int main(void)
{
    static tireid_mpc_state state;
    static tireid_mpc_state twin;
    tireid_mpc_params params;
    double worst;
    (void)tireid_mpc_default_params(&params);
    (void)tireid_mpc_init(&state);
    worst = drive(&state, &params);
    printf("%s, %s\n", tireid_mpc_version(), TIREID_MPC_SINGLE ? "float" : "double");
    printf("largest difference of the steering: %.3g rad of %.3g rad allowed\n", worst, TOLERANCE);
    check(worst <= TOLERANCE, "steering is that of the vectors");
    (void)memset(&work, 0x5A, sizeof work);
    (void)tireid_mpc_init(&twin);
    (void)drive(&twin, &params);
    check(memcmp(&state, &twin, sizeof state) == 0, "a second instance does the same");
    test_guards(&state, &params);
    test_params(&params);
    printf("%s\n", (failures == 0) ? "passed" : "FAILED");
    return (failures == 0) ? 0 : 1;
}
