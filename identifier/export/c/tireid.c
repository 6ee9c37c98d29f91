/* State, guards and modes: a good sample makes a step, any other one is counted and passes. */
#include "tireid.h"

#include <stddef.h>

#include "tireid_equations.h"
#include "tireid_tables.h"

#if TIREID_READS_A_Y || TIREID_TELLS_V_Y
#include <math.h>

/* Of a signal that is not measured. */
static const tireid_real tireid_absent = (tireid_real)NAN;
#endif

/* The numbers of a structure that holds numbers and nothing else. */
static const tireid_real *tireid_numbers(const void *structure)
{
    return structure;
}

/* The same, to write them. */
static tireid_real *tireid_own_numbers(void *structure)
{
    return structure;
}

#if TIREID_LEARNS || !TIREID_SUMS
/* Sum of n numbers, which is finite only where all of them are; in parts that may run abreast. */
static inline tireid_real tireid_sum(const tireid_real *x, uint32_t n)
{
    tireid_real a = TIREID_C(0.0);
    tireid_real b = TIREID_C(0.0);
    tireid_real c = TIREID_C(0.0);
    tireid_real d = TIREID_C(0.0);
    tireid_real e = TIREID_C(0.0);
    tireid_real f = TIREID_C(0.0);
    tireid_real g = TIREID_C(0.0);
    tireid_real h = TIREID_C(0.0);
    uint32_t i = 0U;
    for (; (i + 8U) <= n; i += 8U) {
        a += x[i];
        b += x[i + 1U];
        c += x[i + 2U];
        d += x[i + 3U];
        e += x[i + 4U];
        f += x[i + 5U];
        g += x[i + 6U];
        h += x[i + 7U];
    }
    for (; i < n; i++) {
        a += x[i];
    }
    return ((a + b) + (c + d)) + ((e + f) + (g + h));
}
#endif

/* As many numbers as compilers copy in a few instructions, without a call. */
typedef struct {
    tireid_real number[TIREID_SINGLE ? 16 : 8];
} tireid_block;

#define TIREID_BLOCK ((uint32_t)(sizeof(tireid_block) / sizeof(tireid_real)))

static const tireid_block *tireid_block_at(const void *number)
{
    return number;
}

static tireid_block *tireid_own_block_at(void *number)
{
    return number;
}

/* Copy n numbers. Of one assignment compilers make a call, or an instruction that takes its time to
 * begin. */
static inline void tireid_copy(tireid_real *to, const tireid_real *from, uint32_t n)
{
    uint32_t i = 0U;
    for (; (i + TIREID_BLOCK) <= n; i += TIREID_BLOCK) {
        *tireid_own_block_at(&to[i]) = *tireid_block_at(&from[i]);
    }
    for (; i < n; i++) {
        to[i] = from[i];
    }
}

/* Whether |x| <= limit, which NaN is not. */
static bool tireid_within(tireid_real x, tireid_real limit)
{
    return (x <= limit) && (x >= -limit);
}

/* Whether x is a number: the difference of infinities, and of NaN, is not zero. */
static bool tireid_finite(tireid_real x)
{
    const tireid_real difference = x - x;
    return (difference <= TIREID_C(0.0)) && (difference >= TIREID_C(0.0));
}

static bool tireid_accepts(const tireid_params *params, const tireid_input *in)
{
    return tireid_within(in->v_x, params->max_speed)
#if !TIREID_TELLS_V_Y
        && tireid_within(in->v_y, params->max_speed)
#endif
        && tireid_within(in->r, params->max_yaw_rate)
        && tireid_within(in->delta_f, params->max_steering)
        && tireid_within(in->delta_r, params->max_steering);
}

#if TIREID_TELLS_V_Y
/* A sample whose v_y no car has is one without v_y. */
static tireid_input tireid_possible(const tireid_params *params, const tireid_input *in)
{
    tireid_input possible = *in;
    if (!tireid_within(in->v_y, params->max_speed)) {
        possible.v_y = tireid_absent;
    }
    return possible;
}
#endif

#if TIREID_LEARNS || !TIREID_SUMS
/* Sum of all numbers that a step outputs. */
static inline tireid_real tireid_sum_of(const tireid_values *next, const tireid_output *out)
{
    const tireid_real *given = tireid_numbers(out);
    tireid_real sum =
        tireid_sum(tireid_numbers(next), (uint32_t)(sizeof(tireid_values) / sizeof(tireid_real)));
    uint32_t i;
    for (i = 0U; i < (uint32_t)(sizeof(tireid_output) / sizeof(tireid_real)); i++) {
        sum += given[i];
    }
    return sum;
}
#endif

/* Whether a result is finite, which the sum of its numbers says, with forces that a car may have. */
static bool tireid_believes(const tireid_params *params, tireid_real sum, const tireid_output *out)
{
    return tireid_finite(sum) && tireid_within(out->axle_force[0], params->max_force)
        && tireid_within(out->axle_force[1], params->max_force);
}

tireid_status tireid_default_params(tireid_params *params)
{
    tireid_status status = TIREID_BAD_CALL;
    if (params != NULL) {
        params->max_speed = (tireid_real)TIREID_MAX_SPEED;
        params->max_yaw_rate = (tireid_real)TIREID_MAX_YAW_RATE;
        params->max_steering = (tireid_real)TIREID_MAX_STEERING;
        params->max_force = (tireid_real)TIREID_MAX_FORCE;
        status = TIREID_OK;
    }
    return status;
}

tireid_status tireid_init(tireid_state *state)
{
    tireid_status status = TIREID_BAD_CALL;
    if (state != NULL) {
        state->values = tireid_start;
        state->output = tireid_no_output;
        state->faults = 0U;
        state->missed = 0U;
        state->started = 0U;
        state->adapts = 1U;
        status = TIREID_OK;
    }
    return status;
}

tireid_status tireid_reset(tireid_state *state)
{
    tireid_status status = TIREID_BAD_CALL;
    if (state != NULL) {
#if TIREID_LEARNS
        tireid_weights weights;
        weights = state->values.weights;
        state->values = tireid_start;
        state->values.weights = weights;
#else
        state->values = tireid_start;
#endif
        state->output = tireid_no_output;
        state->missed = 0U;
        state->started = 0U;
        status = TIREID_OK;
    }
    return status;
}

#if TIREID_JUDGES
/* Whether a step went on with this sample, and not with the last one that it believed. */
static bool tireid_believed(const tireid_values *next, const tireid_input *in)
{
    return (next->signals.gate[0] == in->v_x)
#if !TIREID_TELLS_V_Y
        && (next->signals.gate[1] == in->v_y)
#endif
        && (next->signals.gate[2] == in->r) && (next->signals.gate[3] == in->delta_f)
        && (next->signals.gate[4] == in->delta_r);
}
#endif

/* Take a sample that is accepted, where the result can be believed. */
static tireid_status tireid_advance(
    tireid_state *state, const tireid_params *params, const tireid_input *input)
{
    tireid_values next;
    tireid_output out;
    tireid_real sum;
    tireid_status status;
#if TIREID_DECIDES
    if (tireid_drives(input)) {
        sum = tireid_driving(TIREID_PARTS(&state->values), input, TIREID_PARTS(&next), &out);
        status = TIREID_OK;
    } else {
        sum = tireid_elsewhere(TIREID_PARTS(&state->values), input, TIREID_PARTS(&next), &out);
        status = (input->v_x < (tireid_real)TIREID_MIN_SPEED) ? TIREID_REST : TIREID_IMPLAUSIBLE;
    }
#else
    sum = tireid_driving(TIREID_PARTS(&state->values), input, TIREID_PARTS(&next), &out);
    status = (input->v_x < (tireid_real)TIREID_MIN_SPEED) ? TIREID_REST : TIREID_OK;
#if TIREID_JUDGES
    if (!tireid_believed(&next, input)) {
        status = TIREID_IMPLAUSIBLE;
    }
#endif
#endif
#if TIREID_LEARNS
    if (state->adapts == 0U) {
        next.weights = state->values.weights;
    }
#endif
#if TIREID_LEARNS || !TIREID_SUMS
    if ((TIREID_SUMS == 0) || (state->adapts == 0U)) {
        sum = tireid_sum_of(&next, &out);
    }
#endif
    if (tireid_believes(params, sum, &out)) {
        tireid_copy(tireid_own_numbers(&state->values), tireid_numbers(&next),
            (uint32_t)(sizeof(tireid_values) / sizeof(tireid_real)));
        state->output = out;
        state->started = 1U;
    } else {
        status = TIREID_BAD_RESULT;
    }
    return status;
}

#if TIREID_JUDGES
/* Show the step a sample where no car is, which its gate does not believe, in place of one that is
 * refused. */
static void tireid_pass(tireid_state *state, const tireid_params *params)
{
    if (state->started != 0U) {
        tireid_input nowhere;
        nowhere.v_x = (tireid_real)TIREID_NOWHERE;
#if TIREID_TELLS_V_Y
        nowhere.v_y = tireid_absent;
#else
        nowhere.v_y = TIREID_C(0.0);
#endif
        nowhere.r = TIREID_C(0.0);
        nowhere.delta_f = TIREID_C(0.0);
        nowhere.delta_r = TIREID_C(0.0);
#if TIREID_READS_A_Y
        nowhere.a_y = tireid_absent;
#endif
        (void)tireid_advance(state, params, &nowhere);
    }
}
#else
/* Rest at a sample: observers take the measurement, filters begin anew, weights stay. */
static void tireid_begin(
    tireid_state *state, const tireid_params *params, const tireid_input *input)
{
    tireid_values next;
    tireid_output out;
    tireid_real sum;
    tireid_input rest = *input;
    rest.v_x = TIREID_C(0.0);
#if TIREID_READS_A_Y
    rest.a_y = tireid_absent;
#endif
#if TIREID_DECIDES
    sum = tireid_elsewhere(TIREID_PARTS(&state->values), &rest, TIREID_PARTS(&next), &out);
#else
    sum = tireid_driving(TIREID_PARTS(&state->values), &rest, TIREID_PARTS(&next), &out);
#endif
#if !TIREID_SUMS
    sum = tireid_sum_of(&next, &out);
#endif
    if (tireid_believes(params, sum, &out)) {
        state->values = next;
    }
}

/* Whether the next good sample is one to rest at: after a gap, and at the first where it matters. */
static bool tireid_is_new(const tireid_state *state)
{
#if TIREID_RESTS_FIRST
    return (state->started == 0U) || (state->missed > 0U);
#else
    return (state->started != 0U) && (state->missed > 0U);
#endif
}
#endif

/* Time goes on without a sample; return whether that lasts for too long. */
static bool tireid_is_stale(tireid_state *state)
{
    bool stale = false;
    state->missed += (state->missed < UINT32_MAX) ? 1U : 0U;
    if (state->missed >= TIREID_STALE_SAMPLES) {
        state->output = tireid_no_output;
        stale = true;
    }
    return stale;
}

tireid_status tireid_step(
    tireid_state *state, const tireid_params *params, const tireid_input *input)
{
    tireid_status status;
    if ((state == NULL) || (params == NULL) || (input == NULL)) {
        status = TIREID_BAD_CALL;
    } else {
        status = TIREID_BAD_INPUT;
        if (tireid_accepts(params, input)) {
#if TIREID_TELLS_V_Y
            const tireid_input possible = tireid_possible(params, input);
            const tireid_input *const sample = &possible;
#else
            const tireid_input *const sample = input;
#endif
#if !TIREID_JUDGES
            if (tireid_is_new(state)) {
                tireid_begin(state, params, sample);
            }
#endif
            status = tireid_advance(state, params, sample);
        }
        if (status < TIREID_BAD_INPUT) {
            state->missed = 0U;
        } else {
#if TIREID_JUDGES
            tireid_pass(state, params);
#endif
            if (tireid_is_stale(state)) {
                status = TIREID_STALE;
            }
        }
        if (status >= TIREID_IMPLAUSIBLE) {
            state->faults += (state->faults < UINT32_MAX) ? 1U : 0U;
        }
    }
    return status;
}

tireid_status tireid_get_output(const tireid_state *state, tireid_output *output)
{
    tireid_status status = TIREID_BAD_CALL;
    if ((state != NULL) && (output != NULL)) {
        *output = state->output;
        status = TIREID_OK;
    }
    return status;
}

tireid_status tireid_get_forces(const tireid_state *state, tireid_real force[2])
{
    tireid_status status = TIREID_BAD_CALL;
    if ((state != NULL) && (force != NULL)) {
        force[0] = state->output.axle_force[0];
        force[1] = state->output.axle_force[1];
        status = TIREID_OK;
    }
    return status;
}

#if TIREID_RULES
static bool tireid_are_not_negative(const tireid_real *x, uint32_t n)
{
    bool are = true;
    uint32_t i;
    for (i = 0U; i < n; i++) {
        are = are && (x[i] >= TIREID_C(0.0));
    }
    return are;
}

/* Whether the diagonal of an upper triangle, by rows, holds no negative number: D of U D U'. */
static bool tireid_are_factors(const tireid_real *upper, uint32_t order)
{
    bool are = true;
    uint32_t at = 0U;
    uint32_t i;
    for (i = order; i > 0U; i--) {
        are = are && (upper[at] >= TIREID_C(0.0));
        at += i;
    }
    return are;
}

#if TIREID_COVARIANCE
/* Whether the upper triangle of a symmetric matrix, by rows, is that of a covariance: in no direction
 * is its variance negative by more than rounding. It lies alone, or in the whole matrix. */
static bool tireid_is_covariance(const tireid_real *upper, bool whole)
{
    tireid_real low[TIREID_COVARIANCE][TIREID_COVARIANCE];
    tireid_real pivot[TIREID_COVARIANCE];
    bool is = true;
    uint32_t at = 0U;
    uint32_t i;
    uint32_t j;
    uint32_t k;
    for (i = 0U; i < TIREID_COVARIANCE; i++) {
        at += whole ? i : 0U;
        for (j = i; j < TIREID_COVARIANCE; j++) {
            low[j][i] = upper[at];
            at++;
        }
    }
    for (j = 0U; j < TIREID_COVARIANCE; j++) {
        pivot[j] = low[j][j] * (TIREID_C(1.0) + (tireid_real)TIREID_SLACK);
        is = is && (low[j][j] >= TIREID_C(0.0));
        for (k = 0U; k < j; k++) {
            pivot[j] -= low[j][k] * low[j][k] * pivot[k];
        }
        for (i = j + 1U; i < TIREID_COVARIANCE; i++) {
            for (k = 0U; k < j; k++) {
                low[i][j] -= low[i][k] * low[j][k] * pivot[k];
            }
            if (pivot[j] > TIREID_C(0.0)) {
                low[i][j] /= pivot[j];
            } else { /* what never varies, varies with nothing */
                is = is && tireid_within(low[i][j], TIREID_C(0.0));
            }
        }
        is = is && (pivot[j] >= TIREID_C(0.0));
    }
    return is;
}
#endif

/* Whether weights keep all rules of the table. */
static bool tireid_keeps_rules(const tireid_real *weight)
{
    bool keeps = true;
    uint32_t i;
    for (i = 0U; i < TIREID_RULES; i++) {
        const tireid_rule *rule = &tireid_rules[i];
        const tireid_real *number = &weight[rule->first];
        if (rule->kind == TIREID_NOT_NEGATIVE) {
            keeps = keeps && tireid_are_not_negative(number, rule->order);
        } else if (rule->kind == TIREID_FACTORS) {
            keeps = keeps && tireid_are_factors(number, rule->order);
        } else {
#if TIREID_COVARIANCE
            keeps = keeps && tireid_is_covariance(number, rule->kind == TIREID_MATRIX);
#else
            keeps = false; /* there is none among these weights */
#endif
        }
    }
    return keeps;
}
#endif

#if TIREID_RANGES
/* Whether weights lie in all ranges of the table. */
static bool tireid_keeps_ranges(const tireid_real *weight)
{
    bool keeps = true;
    uint32_t i;
    uint32_t j;
    for (i = 0U; i < TIREID_RANGES; i++) {
        const tireid_range *range = &tireid_ranges[i];
        tireid_real sum = TIREID_C(0.0);
        for (j = 0U; j < range->order; j++) {
            sum += tireid_shares[range->shares + j] * weight[range->first + j];
        }
        keeps = keeps && (sum >= range->low) && (sum <= range->high);
    }
    return keeps;
}
#endif

#if TIREID_LEARNS
tireid_status tireid_get_weights(const tireid_state *state, tireid_weights *weights)
{
    tireid_status status = TIREID_BAD_CALL;
    if ((state != NULL) && (weights != NULL)) {
        *weights = state->values.weights;
        status = TIREID_OK;
    }
    return status;
}

tireid_status tireid_set_weights(tireid_state *state, const tireid_weights *weights)
{
    tireid_status status = TIREID_BAD_CALL;
    if ((state != NULL) && (weights != NULL)) {
        const tireid_real *number = tireid_numbers(weights);
        const uint32_t n = (uint32_t)(sizeof(tireid_weights) / sizeof(tireid_real));
        bool good = tireid_finite(tireid_sum(number, n));
#if TIREID_RULES
        good = good && tireid_keeps_rules(number);
#endif
#if TIREID_RANGES
        good = good && tireid_keeps_ranges(number);
#endif
        status = TIREID_BAD_INPUT;
        if (good) {
            state->values.weights = *weights;
            status = TIREID_OK;
        }
    }
    return status;
}

tireid_status tireid_set_adaptation(tireid_state *state, bool adapts)
{
    tireid_status status = TIREID_BAD_CALL;
    if (state != NULL) {
        state->adapts = 0U;
        if (adapts) {
            state->adapts = 1U;
        }
        status = TIREID_OK;
    }
    return status;
}
#endif

const char *tireid_version(void)
{
    return TIREID_VERSION;
}
