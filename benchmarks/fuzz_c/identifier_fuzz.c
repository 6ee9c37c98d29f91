/* Every input is a drive of an exported identifier: calls with sense and without, rules after each.
 *
 * Nothing but the public header is read; of the carried values only that they are numbers. Where
 * BOXES is set, weights that were not told otherwise must stay within it: LARGEST of a weight, GRIP
 * least and most of their sum, OWN least and most of the rest, per axle. */
#include "reader.h"

#include "@name@.h"

#define REALS(type) (sizeof(type) / sizeof(@name@_real))

static @name@_params exported;
static @name@_params params;
static @name@_state state;
static @name@_input input;
static int told; /* weights that were not learnt are in the state */

static struct {
    double v_x, v_y, r, wave, phase, amplitude;
} car;

static void check_numbers(const void *numbers, size_t size)
{
    @name@_real number;
    size_t at;
    for (at = 0U; (at + sizeof number) <= size; at += sizeof number) {
        (void)memcpy(&number, (const char *)numbers + at, sizeof number);
        CHECK(isfinite(number));
    }
}

static void check_boxes(void)
{
#ifdef BOXES
    static const double grip[2] = { GRIP };
    static const double own[2][3][2] = { OWN };
    @name@_weights weights;
    unsigned axle, i;
    CHECK(@name@_get_weights(&state, &weights) == @NAME@_OK);
    for (axle = 0U; (axle < 2U) && (told == 0); axle++) {
        const unsigned n = sizeof weights.W[0] / sizeof weights.W[0][0];
        double sum = 0.0;
        for (i = 0U; i < n; i++) {
            sum += (double)weights.W[axle][i];
            CHECK(fabs((double)weights.W[axle][i]) <= LARGEST);
        }
        CHECK((sum >= grip[0]) && (sum <= grip[1]));
        for (i = 0U; i < 3U; i++) {
            CHECK((double)weights.own[axle][i] >= own[axle][i][0]);
            CHECK((double)weights.own[axle][i] <= own[axle][i][1]);
        }
    }
#endif
}

#ifdef LEARNT
/* Weights are as they were; those on their bounds are put there again, which rounds. */
static void check_kept(const void *now, const void *then, size_t size)
{
    const double ulp = (sizeof(@name@_real) > 4U) ? DBL_EPSILON : FLT_EPSILON;
    @name@_real a, b;
    size_t at;
    for (at = 0U; (at + sizeof a) <= size; at += sizeof a) {
        (void)memcpy(&a, (const char *)now + at, sizeof a);
        (void)memcpy(&b, (const char *)then + at, sizeof b);
        CHECK(fabs((double)a - (double)b) <= (64.0 * ulp * (1.0 + fabs((double)b))));
    }
}
#endif

static void take_step(void)
{
    static @name@_state before;
    @name@_output output;
    @name@_real force[2];
    @name@_status status;
    before = state;
    status = @name@_step(&state, &params, &input);
    CHECK(status != @NAME@_BAD_CALL);
    check_numbers(&state.values, sizeof state.values);
    CHECK(@name@_get_output(&state, &output) == @NAME@_OK);
    check_numbers(&output, sizeof output);
    CHECK(@name@_get_forces(&state, force) == @NAME@_OK);
    CHECK(fabs((double)force[0]) <= (double)exported.max_force);
    CHECK(fabs((double)force[1]) <= (double)exported.max_force);
    CHECK((state.faults - before.faults) <= 1U);
    CHECK((status != @NAME@_BAD_INPUT) || (state.faults == (before.faults + 1U)));
#ifdef LEARNT
    if ((told == 0)
        && ((state.adapts == 0U) || (status == @NAME@_BAD_INPUT) || (status == @NAME@_BAD_RESULT))) {
        @name@_weights now, then; /* what is refused teaches nothing; told ones enter their boxes */
        CHECK(@name@_get_weights(&state, &now) == @NAME@_OK);
        CHECK(@name@_get_weights(&before, &then) == @NAME@_OK);
        check_kept(now.LEARNT, then.LEARNT, sizeof now.LEARNT);
    }
#endif
    check_boxes();
    count_step((unsigned)status);
}

/* A car on tires that saturate, steered by a wave. */
static void sense(void)
{
    const double T = (double)@NAME@_SAMPLE_TIME;
    const double delta = car.amplitude * sin(car.phase);
    const double v_x = fmax(car.v_x, 1.0);
    const double front = 8000.0 * tanh(15.0 * (delta - ((car.v_y + (1.15 * car.r)) / v_x)));
    const double rear = 6000.0 * tanh(-17.0 * ((car.v_y - (1.55 * car.r)) / v_x));
    car.phase += car.wave * T;
    car.v_y += T * (((front + rear) / 1500.0) - (v_x * car.r));
    car.r += T * ((1.15 * front) - (1.55 * rear)) / 2500.0;
    car.v_y = fmin(fmax(car.v_y, -20.0), 20.0);
    car.r = fmin(fmax(car.r, -5.0), 5.0);
    input.v_x = (@name@_real)car.v_x;
    input.v_y = (@name@_real)car.v_y;
    input.r = (@name@_real)car.r;
    input.delta_f = (@name@_real)delta;
    input.delta_r = (@name@_real)0;
}

static void begin_road(reader *from)
{
    car.v_x = between(from, 20.0, 55.0);
    if (take_byte(from) >= 208U) {
        car.v_x = between(from, -1.0, 20.0);
    }
    car.wave = between(from, 0.0, 12.0);
    car.amplitude = between(from, 0.0, 0.3);
    if (take_byte(from) < 64U) {
        car.v_y = car.r = 0.0;
    }
}

/* Samples with sense, in which one signal may be held, biased, turned or wrong. */
static void drive(reader *from)
{
    const uint32_t fault = take_byte(from);
    unsigned n = 1U + take_byte(from);
    @name@_real *const signals[] = { &input.v_x, &input.v_y, &input.r, &input.delta_f };
    @name@_real *const signal = signals[fault % 4U];
    const @name@_real held = *signal;
    const double wrong = ((fault & 0xF0U) == 0xF0U) ? hostile(from) : between(from, -3.0, 3.0);
    for (; n > 0U; n--) {
        sense();
        switch ((fault >> 2U) % 8U) {
        case 4: *signal = held; break;
        case 5: *signal = (@name@_real)((double)*signal + wrong); break;
        case 6: *signal = -*signal; break;
        case 7: *signal = (@name@_real)wrong; break;
        default: break;
        }
        take_step();
    }
}

/* Samples with any number anywhere. */
static void strike(reader *from)
{
    const uint32_t kind = take_byte(from);
    @name@_real number[REALS(@name@_input)];
    unsigned n = 1U + (kind % 3U);
    unsigned again = 1U + (kind >> 2U);
    sense();
    (void)memcpy(number, &input, sizeof number);
    for (; n > 0U; n--) {
        number[take_byte(from) % REALS(@name@_input)] = (@name@_real)hostile(from);
    }
    (void)memcpy(&input, number, sizeof number);
    for (; again > 0U; again--) {
        take_step();
    }
}

/* Limits as hostile as samples, but for that of the force, which is what a user relies on. */
static void set_params(reader *from)
{
    const uint32_t kind = take_byte(from);
    params = exported;
    if ((kind & 1U) != 0U) {
        params.max_speed = (@name@_real)hostile(from);
    }
    if ((kind & 2U) != 0U) {
        params.max_yaw_rate = (@name@_real)hostile(from);
    }
    if ((kind & 4U) != 0U) {
        params.max_steering = (@name@_real)hostile(from);
    }
    if ((kind & 8U) != 0U) {
        params.max_force *= (@name@_real)between(from, 0.0, 1.0);
    }
}

#ifdef LEARNT
/* Weights that were learnt, in part or wholly others; refused ones change nothing. */
static void set_weights(reader *from)
{
    @name@_weights weights;
    const @name@_state before = state;
    const uint32_t kind = take_byte(from);
    @name@_status status;
    unsigned i;
    CHECK(@name@_get_weights(&state, &weights) == @NAME@_OK);
    for (i = 0U; i < (kind % 4U); i++) {
        @name@_real number[REALS(@name@_weights)];
        const unsigned at = take_byte(from) % REALS(@name@_weights);
        (void)memcpy(number, &weights, sizeof number);
        number[at] = (@name@_real)(((kind & 4U) != 0U)
                ? hostile(from)
                : between(from, -2.0, 2.0) * (double)number[at]);
        (void)memcpy(&weights, number, sizeof number);
    }
    status = @name@_set_weights(&state, &weights);
    CHECK((status == @NAME@_OK) || (status == @NAME@_BAD_INPUT));
    if (status == @NAME@_BAD_INPUT) {
        CHECK(memcmp(&before, &state, sizeof before) == 0);
    } else if ((kind % 4U) != 0U) {
        told = 1;
    } else {
        /* those that were there */
    }
    check_numbers(&state.values, sizeof state.values);
}
#endif

static void change_mode(reader *from)
{
    const uint32_t kind = take_byte(from) % 8U;
    const @name@_state before = state;
    if (kind == 0U) {
        CHECK(@name@_init(&state) == @NAME@_OK);
        told = 0;
    } else if (kind < 4U) {
        CHECK(@name@_reset(&state) == @NAME@_OK);
        CHECK(state.faults == before.faults);
    } else if (kind == 4U) {
        CHECK(@name@_step(NULL, &params, &input) == @NAME@_BAD_CALL);
        CHECK(@name@_step(&state, NULL, &input) == @NAME@_BAD_CALL);
        CHECK(@name@_step(&state, &params, NULL) == @NAME@_BAD_CALL);
        CHECK(memcmp(&before, &state, sizeof before) == 0);
    } else {
#ifdef LEARNT
        CHECK(@name@_set_adaptation(&state, kind != 5U) == @NAME@_OK);
#endif
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    reader from = { data, size };
    inputs++;
    CHECK(@name@_default_params(&exported) == @NAME@_OK);
    params = exported;
    CHECK(@name@_init(&state) == @NAME@_OK);
    told = 0;
    car.v_y = car.r = car.phase = 0.0;
    begin_road(&from);
    sense();
    while (from.left > 0U) {
        switch (take_byte(&from) % 16U) {
        case 0: case 1: case 2: case 3: case 4: case 5: case 6: drive(&from); break;
        case 7: case 8: begin_road(&from); break;
        case 9: case 10: case 11: strike(&from); break;
        case 12: set_params(&from); break;
        case 13: change_mode(&from); break;
#ifdef LEARNT
        case 14: set_weights(&from); break;
#endif
        default: params = exported; break;
        }
    }
    return 0;
}
