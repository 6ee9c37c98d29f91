/* Self-test: forces against vectors that were computed elsewhere, guards and modes. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tireid.h"
#include "tireid_vectors.h"

#if TIREID_SINGLE
#define TOLERANCE VECTOR_TOLERANCE_SINGLE /* N */
#else
#define TOLERANCE VECTOR_TOLERANCE_DOUBLE /* N */
#endif

static int failures = 0;

static void check(int holds, const char *rule)
{
    if (!holds) {
        printf("FAILED: %s\n", rule);
        failures++;
    }
}

static tireid_input sample(int k)
{
    tireid_real number[sizeof(tireid_input) / sizeof(tireid_real)] = { 0 };
    tireid_input input;
    size_t i;
    for (i = 0; i < (sizeof number / sizeof number[0]); i++) {
        number[i] = (tireid_real)vector_input[k][i];
    }
    (void)memcpy(&input, number, sizeof input);
    return input;
}

/* Drive n samples; return the largest difference of a force from the vectors [N]. */
static double drive(tireid_state *state, const tireid_params *params, int n)
{
    double worst = 0.0;
    int k;
    int i;
    for (k = 0; k < n; k++) {
        const tireid_input input = sample(k);
        tireid_real force[2];
        const tireid_status status = tireid_step(state, params, &input);
        check(status <= TIREID_IMPLAUSIBLE, "no vector is refused");
        (void)tireid_get_forces(state, force);
        for (i = 0; i < 2; i++) {
            const double difference = fabs((double)force[i] - vector_force[k][i]);
            worst = (difference <= worst) ? worst : difference;
        }
    }
    return worst;
}

static void refuse(
    tireid_state *state, const tireid_params *params, const tireid_input *input, const char *rule)
{
    const bool lasts = (state->missed + 1U) >= TIREID_STALE_SAMPLES;
    check(tireid_step(state, params, input) == (lasts ? TIREID_STALE : TIREID_BAD_INPUT), rule);
}

/* Signals that need not be there. */
static void test_absent(tireid_state *state, const tireid_params *params)
{
    const tireid_state before = *state;
    tireid_input input = sample(VECTORS - 1);
    const tireid_real zero = 0;
#if TIREID_TELLS_V_Y
    tireid_state without;
    input.v_y = zero / zero;
    check(tireid_step(state, params, &input) <= TIREID_IMPLAUSIBLE, "v_y may be NaN");
    without = *state;
    *state = before;
    input.v_y = params->max_speed * 2;
    check(tireid_step(state, params, &input) <= TIREID_IMPLAUSIBLE, "v_y is not refused");
    check(memcmp(state, &without, sizeof without) == 0, "a v_y that no car has is none");
    *state = before;
#else
    input.v_y = zero / zero;
    refuse(state, params, &input, "v_y must be a number");
    *state = before;
#endif
#if TIREID_READS_A_Y
    input = sample(VECTORS - 1);
    input.a_y = zero / zero;
    check(tireid_step(state, params, &input) <= TIREID_IMPLAUSIBLE, "a_y may be NaN");
    input.a_y = (tireid_real)1.0 / zero;
    check(tireid_step(state, params, &input) <= TIREID_IMPLAUSIBLE, "a_y is not refused");
    *state = before;
#endif
}

static void test_guards(tireid_state *state, const tireid_params *params)
{
    const tireid_state before = *state;
    tireid_input input = sample(VECTORS - 1);
    tireid_real force[2];
    const tireid_real zero = 0;
    test_absent(state, params);
    input.delta_f = zero / zero;
    refuse(state, params, &input, "NaN is refused");
    input.delta_f = (tireid_real)1.0 / zero;
    refuse(state, params, &input, "infinity is refused");
    input = sample(VECTORS - 1);
    input.r = params->max_yaw_rate * 2;
    refuse(state, params, &input, "limits are kept");
    check(state->faults == (before.faults + 3U), "faults are counted");
    check(state->missed == 3U, "what is refused counts as time");
#if TIREID_LEARNS
    {
        /* But for the rounding of a projection onto their bounds. */
        const double rounding = (sizeof(tireid_real) == sizeof(float)) ? 1e-6 : 1e-14;
        const tireid_weights *const now = &state->values.weights;
        tireid_real old[sizeof *now / sizeof(tireid_real)];
        tireid_real held[sizeof *now / sizeof(tireid_real)];
        size_t i;
        bool same = true;
        (void)memcpy(old, &before.values.weights, sizeof old);
        (void)memcpy(held, now, sizeof held);
        for (i = 0; i < (sizeof old / sizeof old[0]); i++) {
            const double size = 1.0 + fabs((double)old[i]);
            same = same && (fabs((double)held[i] - (double)old[i]) <= (rounding * size));
        }
        check(same, "nothing is learnt from what is refused");
    }
#endif
    while (state->missed < TIREID_STALE_SAMPLES) {
        refuse(state, params, &input, "what is refused for long is stale");
    }
    refuse(state, params, &input, "what is stale stays so");
    (void)tireid_get_forces(state, force);
    check((force[0] == zero) && (force[1] == zero), "stale forces are zero");
    input = sample(VECTORS - 1);
    check(tireid_step(state, params, &input) <= TIREID_IMPLAUSIBLE, "a good sample ends a gap");
    check(state->missed == 0U, "a gap ends");
    *state = before;
    check(tireid_step(NULL, params, &input) == TIREID_BAD_CALL, "a null state is refused");
    check(tireid_step(state, NULL, &input) == TIREID_BAD_CALL, "null parameters are refused");
    check(tireid_step(state, params, NULL) == TIREID_BAD_CALL, "a null input is refused");
    check(memcmp(state, &before, sizeof before) == 0, "a bad call leaves the state as it is");
}

#if TIREID_LEARNS
static void test_modes(tireid_state *state, const tireid_params *params)
{
    const tireid_real zero = 0;
    tireid_real number;
    tireid_weights learnt;
    tireid_weights after;
    tireid_weights broken;
    (void)memset(&learnt, 0, sizeof learnt);
    (void)memset(&after, 0, sizeof after);
    (void)tireid_get_weights(state, &learnt);
    (void)tireid_set_adaptation(state, false);
    (void)tireid_reset(state);
    (void)drive(state, params, VECTORS);
    (void)tireid_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "frozen weights hold their values");
    (void)tireid_set_adaptation(state, true);
    (void)drive(state, params, VECTORS);
    (void)tireid_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) != 0, "adaptation moves the weights");
    (void)tireid_set_weights(state, &learnt);
    (void)tireid_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "weights that were set are kept");
    broken = learnt;
    number = zero / zero;
    (void)memcpy(&broken, &number, sizeof number); /* the first of them */
    check(tireid_set_weights(state, &broken) == TIREID_BAD_INPUT, "NaN is no weight");
#if TIREID_RANGES
    number = 50; /* static axle loads, which no tire carries */
    (void)memcpy(&broken, &number, sizeof number);
    check(tireid_set_weights(state, &broken) == TIREID_BAD_INPUT, "weights have limits");
    (void)tireid_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "weights beyond limits change nothing");
#endif
#ifdef VECTOR_NOT_NEGATIVE
    broken = learnt;
    number = -1;
    (void)memcpy((char *)&broken + (VECTOR_NOT_NEGATIVE * sizeof number), &number, sizeof number);
    check(tireid_set_weights(state, &broken) == TIREID_BAD_INPUT, "no variance is negative");
    (void)tireid_get_weights(state, &after);
    check(memcmp(&learnt, &after, sizeof learnt) == 0, "refused weights change nothing");
#endif
}
#endif

int main(void)
{
    tireid_params params;
    tireid_state state;
    tireid_state twin;
    double worst;
    (void)memset(&state, 0, sizeof state);
    (void)memset(&twin, 0, sizeof twin);
    (void)tireid_default_params(&params);
    (void)tireid_init(&state);
    (void)tireid_init(&twin);
    worst = drive(&state, &params, VECTORS);
    printf("%s, %s\n", tireid_version(), TIREID_SINGLE ? "float" : "double");
    printf("largest difference of a force: %.3g N of %.3g N allowed\n", worst, TOLERANCE);
    check(worst <= TOLERANCE, "forces are those of the vectors");
    (void)drive(&twin, &params, VECTORS);
    check(memcmp(&state, &twin, sizeof state) == 0, "a second instance does the same");
    test_guards(&state, &params);
#if TIREID_LEARNS
    test_modes(&state, &params);
#endif
    printf("%s\n", (failures == 0) ? "passed" : "FAILED");
    return (failures == 0) ? 0 : 1;
}
