/* Self-test of @name@: forces against vectors that were computed elsewhere, guards and modes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "@name@.h"
#include "vectors.h"

#if @NAME@_SINGLE
#define TOLERANCE @tolerance_single@ /* N */
#else
#define TOLERANCE @tolerance_double@ /* N */
#endif

static int failures = 0;

static void check(int holds, const char *rule)
{
    if (!holds) {
        printf("FAILED: %s\n", rule);
        failures++;
    }
}

static @name@_input sample(int k)
{
    @name@_input input;
    input.v_x = (@name@_real)vector_input[k][0];
    input.v_y = (@name@_real)vector_input[k][1];
    input.r = (@name@_real)vector_input[k][2];
    input.delta_f = (@name@_real)vector_input[k][3];
    input.delta_r = (@name@_real)vector_input[k][4];
    return input;
}

/* Drive n samples; return the largest difference of a force from the vectors [N]. */
static double drive(@name@_state *state, const @name@_params *params, int n)
{
    double worst = 0.0;
    int k;
    int i;
    for (k = 0; k < n; k++) {
        const @name@_input input = sample(k);
        @name@_real force[2];
        const @name@_status status = @name@_step(state, params, &input);
        check(status <= @NAME@_IMPLAUSIBLE, "no vector is refused");
        (void)@name@_get_forces(state, force);
        for (i = 0; i < 2; i++) {
            const double difference = fabs((double)force[i] - vector_force[k][i]);
            worst = (difference <= worst) ? worst : difference;
        }
    }
    return worst;
}

static void refuse(@name@_state *state, const @name@_params *params, const @name@_input *input,
    const char *rule)
{
    const bool lasts = (state->missed + 1U) >= @NAME@_STALE_SAMPLES;
    check(@name@_step(state, params, input) == (lasts ? @NAME@_STALE : @NAME@_BAD_INPUT), rule);
}

static void test_guards(@name@_state *state, const @name@_params *params)
{
    const @name@_state before = *state;
    @name@_input input = sample(VECTORS - 1);
    @name@_real force[2];
    const @name@_real zero = 0;
    input.v_y = zero / zero;
    refuse(state, params, &input, "NaN is refused");
    input.v_y = (@name@_real)1.0 / zero;
    refuse(state, params, &input, "infinity is refused");
    input = sample(VECTORS - 1);
    input.r = params->max_yaw_rate * 2;
    refuse(state, params, &input, "limits are kept");
    check(state->faults == (before.faults + 3U), "faults are counted");
    check(state->missed == 3U, "what is refused counts as time");
@weights_held@    while (state->missed < @NAME@_STALE_SAMPLES) {
        refuse(state, params, &input, "what is refused for long is stale");
    }
    refuse(state, params, &input, "what is stale stays so");
    (void)@name@_get_forces(state, force);
    check((force[0] == zero) && (force[1] == zero), "stale forces are zero");
    input = sample(VECTORS - 1);
    check(@name@_step(state, params, &input) <= @NAME@_IMPLAUSIBLE, "a good sample ends a gap");
    check(state->missed == 0U, "a gap ends");
    *state = before;
    check(@name@_step(NULL, params, &input) == @NAME@_BAD_CALL, "a null state is refused");
    check(@name@_step(state, NULL, &input) == @NAME@_BAD_CALL, "null parameters are refused");
    check(@name@_step(state, params, NULL) == @NAME@_BAD_CALL, "a null input is refused");
    check(memcmp(state, &before, sizeof before) == 0, "a bad call leaves the state as it is");
}

@weights_test@int main(void)
{
    @name@_params params;
    @name@_state state;
    @name@_state twin;
    double worst;
    (void)memset(&state, 0, sizeof state);
    (void)memset(&twin, 0, sizeof twin);
    (void)@name@_default_params(&params);
    (void)@name@_init(&state);
    (void)@name@_init(&twin);
    worst = drive(&state, &params, VECTORS);
    printf("%s, %s\n", @name@_version(), @NAME@_SINGLE ? "float" : "double");
    printf("largest difference of a force: %.3g N of %.3g N allowed\n", worst, TOLERANCE);
    check(worst <= TOLERANCE, "forces are those of the vectors");
    (void)drive(&twin, &params, VECTORS);
    check(memcmp(&state, &twin, sizeof state) == 0, "a second instance does the same");
    test_guards(&state, &params);
@weights_call@    printf("%s\n", (failures == 0) ? "passed" : "FAILED");
    return (failures == 0) ? 0 : 1;
}
