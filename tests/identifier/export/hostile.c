/* A million samples that no sensor should deliver; and ten instances side by side. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tireid.h"

static uint64_t seed;

static uint64_t draw(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return seed;
}

static double uniform(void)
{
    return (double)(draw() >> 11) / 9007199254740992.0;
}

static tireid_real odd_number(void)
{
    const double zero = 0.0;
    switch (draw() % 8U) {
    case 0:
        return (tireid_real)(zero / zero);
    case 1:
        return (tireid_real)(1.0 / zero);
    case 2:
        return (tireid_real)(-1.0 / zero);
    case 3:
        return (tireid_real)1e-42;
    case 4:
        return (tireid_real)(-1e-42);
    case 5:
        return (tireid_real)3e38;
    case 6:
        return (tireid_real)(1e3 * (uniform() - 0.5));
    default:
        return (tireid_real)0;
    }
}

#define SPELL 200 /* samples of calm driving, then as many without sense or without numbers */

static tireid_input calm(long k)
{
    const double t = 0.01 * (double)k;
    tireid_input in;
    in.v_x = (tireid_real)(20.0 + 15.0 * sin(0.2 * t));
    in.v_y = (tireid_real)(0.3 * sin(2.0 * t));
    in.r = (tireid_real)(0.2 * sin(2.1 * t));
    in.delta_f = (tireid_real)(0.03 * sin(2.2 * t));
    in.delta_r = (tireid_real)(0.003 * sin(1.1 * t));
    return in;
}

/* Plausible, stuck, reversed, at the limits, and anything at all. */
static tireid_input next_input(tireid_input last, long k)
{
    tireid_input in = last;
    const uint64_t kind = draw() % 16U;
    if (((k / SPELL) % 8) == 7) { /* a sensor that is not there for 2 s */
        in.r = odd_number();
        in.v_x = (tireid_real)3e38;
        return in;
    }
    if ((((k / SPELL) % 2) == 0) && ((draw() % 50U) != 0U)) {
        return calm(k);
    }
    if (kind == 0U) {
        return in; /* stuck */
    }
    if (kind == 1U) {
        in.v_x = -in.v_x;
        in.v_y = -in.v_y;
        in.r = -in.r;
        return in;
    }
    in.v_x = (tireid_real)(40.0 * uniform());
    in.v_y = (tireid_real)(4.0 * (uniform() - 0.5));
    in.r = (tireid_real)(2.0 * (uniform() - 0.5));
    in.delta_f = (tireid_real)(0.6 * (uniform() - 0.5));
    in.delta_r = (tireid_real)(0.2 * (uniform() - 0.5));
    if (kind == 2U) {
        in.v_x = (tireid_real)(290.0 * uniform());
        in.v_y = (tireid_real)(580.0 * (uniform() - 0.5));
        in.r = (tireid_real)(15.0 * (uniform() - 0.5));
    } else if (kind < 8U) {
        tireid_real *const field[5] = { &in.v_x, &in.v_y, &in.r, &in.delta_f, &in.delta_r };
        *field[draw() % 5U] = odd_number();
    }
    return in;
}

static int all_finite(const tireid_values *values)
{
    tireid_real number[sizeof *values / sizeof(tireid_real)];
    size_t i;
    memcpy(number, values, sizeof number);
    for (i = 0; i < sizeof number / sizeof number[0]; i++) {
        if (!isfinite(number[i])) {
            return 0;
        }
    }
    return 1;
}

#ifdef BOUNDED /* the axle identifier: limits come as macros, -DLEAST_GRIP=... */
#define UNITS 4
#define ALL (UNITS + 3)

/* Whether the weights are in their boxes, P = U D U' definite and its variances within limits. */
static int within_bounds(const tireid_weights *weights)
{
    static const long double scale[UNITS] = { LADDER };
    static const long double offset[2] = { STEERING, V_Y };
    static const long double widest[2][4] = { WIDEST };
    int axle, i, j;
    for (axle = 0; axle < 2; axle++) {
        const tireid_real *const w = weights->W[axle];
        const tireid_real *const own = weights->own[axle];
        long double U[ALL][ALL] = { { 0 } };
        long double D[ALL];
        long double size[4] = { 0 };
        long double grip = 0;
        long double slope = 0;
        int k = 0;
        for (i = 0; i < UNITS; i++) {
            grip += (long double)w[i];
            slope += (long double)w[i] / scale[i];
            if (!(fabsl((long double)w[i]) <= WEIGHT)) {
                printf("weight %g: ", (double)w[i]);
                return 0;
            }
        }
        if (!(grip >= LEAST_GRIP && grip <= MOST_GRIP && slope >= 0)) {
            printf("grip %.9g, slope %.9g: ", (double)grip, (double)slope);
            return 0;
        }
        if (!((long double)own[0] >= 0 && (long double)own[0] <= COMPLIANCE
                && (long double)own[1] >= 0 && (long double)own[1] <= 1
                && fabsl((long double)own[2]) <= offset[axle])) {
            printf("own %g %g %g: ", (double)own[0], (double)own[1], (double)own[2]);
            return 0;
        }
        for (i = 0; i < ALL; i++) {
            D[i] = (long double)weights->UD[axle][k++];
            if (!(D[i] >= 0)) {
                printf("covariance that is not definite: ");
                return 0;
            }
            U[i][i] = 1;
            for (j = i + 1; j < ALL; j++) {
                U[i][j] = (long double)weights->UD[axle][k++];
            }
        }
        for (i = 0; i < ALL; i++) {
            for (j = i; j < ALL; j++) {
                size[(i < UNITS) ? 0 : i - UNITS + 1] += U[i][j] * U[i][j] * D[j];
            }
        }
        for (i = 0; i < 4; i++) {
            if (!(size[i] <= widest[axle][i])) {
                printf(
                    "variance %d is %.9g of its limit: ", i, (double)(size[i] / widest[axle][i]));
                return 0;
            }
        }
    }
    return 1;
}
#endif

/* Whether weights kept their values, but for the rounding of a projection onto their bounds. */
static int held(const tireid_weights *before, const tireid_weights *after)
{
    const double rounding = (sizeof(tireid_real) == sizeof(float)) ? 1e-6 : 1e-14;
    tireid_real old[sizeof *before / sizeof(tireid_real)];
    tireid_real new[sizeof *after / sizeof(tireid_real)];
    size_t i;
    memcpy(old, before, sizeof old);
    memcpy(new, after, sizeof new);
    for (i = 0; i < sizeof old / sizeof old[0]; i++) {
        if (!(fabs((double)new[i] - (double)old[i]) <= rounding * (1.0 + fabs((double)old[i])))) {
            return 0;
        }
    }
    return 1;
}

static int torture(tireid_params *params)
{
    static tireid_state state;
    tireid_input in = { 0 };
    uint32_t faults = 0;
    uint32_t missed = 0;
    uint32_t kinds[8] = { 0 };
    long k;
    seed = 88172645463325252U;
    tireid_init(&state);
    for (k = 0; k < 1000000; k++) {
        const tireid_state before = state;
        tireid_status status;
        in = next_input(in, k);
        status = tireid_step(&state, params, &in);
        kinds[status]++;
        faults += (status >= TIREID_IMPLAUSIBLE) ? 1U : 0U;
        if (state.faults != faults) {
            printf("fault %ld was not counted\n", k);
            return 1;
        }
        if (!all_finite(&state.values)) {
            printf("the state is not finite after %ld\n", k);
            return 1;
        }
#if TIREID_LEARNS
        if ((k % 16) == 0) { /* what it has learnt may be given to it again */
            const tireid_weights learnt = state.values.weights;
            if (tireid_set_weights(&state, &learnt) != TIREID_OK) {
                printf("its own weights are refused after %ld\n", k);
                return 1;
            }
        }
#endif
#ifdef BOUNDED
        if (!within_bounds(&state.values.weights)) {
            printf("a bound is broken after %ld\n", k);
            return 1;
        }
#endif
        if (!(fabs((double)state.output.axle_force[0]) <= (double)params->max_force)
            || !(fabs((double)state.output.axle_force[1]) <= (double)params->max_force)) {
            printf("a force is beyond the limit after %ld\n", k);
            return 1;
        }
        missed = (status >= TIREID_BAD_INPUT) ? missed + 1U : 0U;
        if ((status == TIREID_STALE) != (missed >= TIREID_STALE_SAMPLES)) {
            printf("status %d after %u refused samples in a row\n", (int)status, missed);
            return 1;
        }
        if ((status == TIREID_STALE)
            && ((state.output.axle_force[0] != 0) || (state.output.axle_force[1] != 0))) {
            printf("a stale force is not zero after %ld\n", k);
            return 1;
        }
        if ((missed != 0U) && !held(&before.values.weights, &state.values.weights)) {
            printf("sample %ld was refused and changed the weights\n", k);
            return 1;
        }
    }
    printf("ok %u rest %u implausible %u bad_input %u bad_result %u stale %u\n", kinds[0], kinds[1],
        kinds[2], kinds[3], kinds[4], kinds[6]);
    return 0;
}

#define INSTANCES 10
#define STEPS 2000

static void drive(tireid_state *state, const tireid_params *params, int which, int k)
{
    const double t = 0.01 * k;
    tireid_input in;
    in.v_x = (tireid_real)(10.0 + which);
    in.v_y = (tireid_real)(0.3 * sin(2.0 * t + which));
    in.r = (tireid_real)(0.2 * sin(2.1 * t + which));
    in.delta_f = (tireid_real)(0.03 * sin(2.2 * t + which));
    in.delta_r = (tireid_real)0;
    (void)tireid_step(state, params, &in);
}

static int side_by_side(const tireid_params *params)
{
    static tireid_state together[INSTANCES];
    static tireid_state alone;
    static tireid_state moved;
    int i;
    int k;
    for (i = 0; i < INSTANCES; i++) {
        tireid_init(&together[i]);
    }
    for (k = 0; k < STEPS; k++) {
        for (i = 0; i < INSTANCES; i++) {
            if (k == STEPS / 2) { /* a state may be moved */
                memcpy(&moved, &together[i], sizeof moved);
                memset(&together[i], 0x5A, sizeof moved);
                memcpy(&together[i], &moved, sizeof moved);
            }
            drive(&together[i], params, i, k);
        }
    }
    for (i = 0; i < INSTANCES; i++) {
        tireid_init(&alone);
        for (k = 0; k < STEPS; k++) {
            drive(&alone, params, i, k);
        }
        if (memcmp(&alone, &together[i], sizeof alone) != 0) {
            printf("instance %d was disturbed\n", i);
            return 1;
        }
    }
    return memcmp(&together[0], &together[1], sizeof alone) == 0;
}

int main(void)
{
    static tireid_params params;
    tireid_default_params(&params);
    return torture(&params) || side_by_side(&params);
}
