/* Self-test of @name@: steering against vectors that were computed elsewhere, guards, weights. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "@name@.h"
#include "@name@_params.h"
#include "vectors.h"

#if @NAME@_SINGLE
#define TOLERANCE @tolerance_single@ /* rad */
#else
#define TOLERANCE @tolerance_double@ /* rad */
#endif

static int failures = 0;
static @name@_work work;

static void check(int holds, const char *rule)
{
    if (!holds) {
        printf("FAILED: %s\n", rule);
        failures++;
    }
}

static @name@_input vector(unsigned k)
{
    @name@_input input;
    unsigned j;
    input.e_y = (@name@_real)vector_input[k][0];
    input.e_psi = (@name@_real)vector_input[k][1];
    input.v_y = (@name@_real)vector_input[k][2];
    input.r = (@name@_real)vector_input[k][3];
    for (j = 0; j <= @NAME@_HORIZON; j++) {
        const unsigned at = (j == 0) ? k : (k + VECTOR_OFFSET + (VECTOR_STRIDE * (j - 1)));
        input.kappa[j] = (@name@_real)vector_road[at][0];
        input.v_x[j] = (@name@_real)vector_road[at][1];
    }
    return input;
}

/* Take the vectors; return the largest difference of the steering [rad]. */
static double drive(@name@_state *state, const @name@_params *params)
{
    double worst = 0.0;
    unsigned k;
    for (k = 0; k < VECTORS; k++) {
        const @name@_input input = vector(k);
        const double before = (double)state->commands[0];
        @name@_real steering;
        const @name@_status status = @name@_step(state, params, &work, &input, &steering);
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
static void refuse(@name@_state *state, const @name@_params *params, const @name@_input *input,
    @name@_status wanted, const char *rule)
{
    const double most = 1.000001 * (double)(params->max_rate * params->period);
    const double before = (double)state->commands[0];
    const uint32_t faults = state->faults[wanted];
    @name@_real steering;
    const @name@_status status = @name@_step(state, params, &work, input, &steering);
    check(status == wanted, rule);
    check(state->faults[wanted] == (faults + 1U), "what is refused is counted");
    check(fabs((double)steering - before) <= most, "what is refused is steered through");
}

static void test_guards(@name@_state *state, const @name@_params *params)
{
    const @name@_real zero = 0;
    const @name@_real nan = zero / zero;
    const @name@_input good = vector(VECTORS - 1);
    @name@_input input = good;
    @name@_real steering;
    input.v_y = nan;
    refuse(state, params, &input, @NAME@_NOT_FINITE, "NaN is refused");
    input = good;
    input.kappa[@NAME@_HORIZON] = (@name@_real)1.0 / zero;
    refuse(state, params, &input, @NAME@_NOT_FINITE, "an infinite curvature is refused");
    input = good;
    input.e_y = params->widest_e_y * 2;
    refuse(state, params, &input, @NAME@_OFF_PATH, "a car off the path is known");
    input = good;
    input.r = params->max_yaw_rate * -2;
    refuse(state, params, &input, @NAME@_OFF_MAP, "a car that spins is known");
    input = good;
    input.v_x[1] = params->min_speed / 2;
    refuse(state, params, &input, @NAME@_TOO_SLOW, "a slow car is known");
    check(@name@_late(state, state->commands[1]) == @NAME@_OK, "a late command is accepted");
    check(@name@_late(state, nan) == @NAME@_BAD_CALL, "NaN was not steered");
    check(@name@_step(NULL, params, &work, &good, &steering) == @NAME@_BAD_CALL, "null state");
    check(@name@_step(state, NULL, &work, &good, &steering) == @NAME@_BAD_CALL, "null params");
    check(@name@_step(state, params, NULL, &good, &steering) == @NAME@_BAD_CALL, "null work");
    check(@name@_step(state, params, &work, NULL, &steering) == @NAME@_BAD_CALL, "null input");
    check(@name@_step(state, params, &work, &good, NULL) == @NAME@_BAD_CALL, "null steering");
}

static void test_params(const @name@_params *params)
{
    static @name@_state state;
    const @name@_real zero = 0;
    @name@_params other = *params;
    @name@_real weights[@NAME@_WEIGHTS];
    unsigned i;
    check(@name@_accepts(params), "what was exported is accepted");
    (void)memcpy(weights, params->weights, sizeof weights);
    for (i = 0; i < @NAME@_WEIGHTS; i++) {
        weights[i] *= (@name@_real)0.8;
    }
    check(@name@_set_weights(&other, weights) == @NAME@_OK, "other weights are accepted");
    (void)@name@_init(&state);
    check(drive(&state, &other) > 2e-3, "other weights steer otherwise");
    weights[@NAME@_WEIGHTS - 1U] = zero / zero;
    check(@name@_set_weights(&other, weights) == @NAME@_NOT_FINITE, "NaN is no weight");
    check(@name@_accepts(&other), "weights that were refused are not there");
    other.period = -other.period;
    check(!@name@_accepts(&other), "a negative period is not accepted");
}

int main(void)
{
    static @name@_state state;
    static @name@_state twin;
    @name@_params params;
    double worst;
    (void)@name@_default_params(&params);
    (void)@name@_init(&state);
    worst = drive(&state, &params);
    printf("%s, %s\n", @name@_version(), @NAME@_SINGLE ? "float" : "double");
    printf("largest difference of the steering: %.3g rad of %.3g rad allowed\n", worst, TOLERANCE);
    check(worst <= TOLERANCE, "steering is that of the vectors");
    (void)memset(&work, 0x5A, sizeof work);
    (void)@name@_init(&twin);
    (void)drive(&twin, &params);
    check(memcmp(&state, &twin, sizeof state) == 0, "a second instance does the same");
    test_guards(&state, &params);
    test_params(&params);
    printf("%s\n", (failures == 0) ? "passed" : "FAILED");
    return (failures == 0) ? 0 : 1;
}
