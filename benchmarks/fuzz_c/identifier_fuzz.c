/* Every input is a drive of an exported identifier: calls with sense and without, rules after each.
 *
 * Nothing but the public header is read; of the carried values only that they are numbers. Where
 * BOXES is set, weights that were not told otherwise must stay within it: LARGEST of a weight, GRIP
 * least and most of their sum, and where it is told OWN least and most of the rest, per axle. */
#include "reader.h"

#include "tireid.h"

#define REALS(type) (sizeof(type) / sizeof(tireid_real))

static tireid_params exported;
static tireid_params params;
static tireid_state state;
static tireid_input input;
static int told; /* weights that were not learnt are in the state */

static struct {
    double v_x, v_y, r, wave, phase, amplitude;
    int measured; /* whether a sensor shows v_y to a step that tells it */
} car;

static void check_numbers(const void *numbers, size_t size)
{
    tireid_real number;
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
#ifdef OWN
    static const double own[2][3][2] = { OWN };
#endif
    tireid_weights weights;
    unsigned axle, i;
    CHECK(tireid_get_weights(&state, &weights) == TIREID_OK);
    for (axle = 0U; (axle < 2U) && (told == 0); axle++) {
        const unsigned n = sizeof weights.W[0] / sizeof weights.W[0][0];
        double sum = 0.0;
        for (i = 0U; i < n; i++) {
            sum += (double)weights.W[axle][i];
            CHECK(fabs((double)weights.W[axle][i]) <= LARGEST);
        }
        CHECK((sum >= grip[0]) && (sum <= grip[1]));
#ifdef OWN
        for (i = 0U; i < 3U; i++) {
            CHECK((double)weights.own[axle][i] >= own[axle][i][0]);
            CHECK((double)weights.own[axle][i] <= own[axle][i][1]);
        }
#endif
    }
#endif
}

#ifdef LEARNT
/* Weights are as they were; those on their bounds are put there again, which rounds. */
static void check_kept(const void *now, const void *then, size_t size)
{
    const double ulp = (sizeof(tireid_real) > 4U) ? DBL_EPSILON : FLT_EPSILON;
    tireid_real a, b;
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
    static tireid_state before;
    tireid_output output;
    tireid_real force[2];
    tireid_status status;
    before = state;
    status = tireid_step(&state, &params, &input);
    CHECK(status != TIREID_BAD_CALL);
    check_numbers(&state.values, sizeof state.values);
    CHECK(tireid_get_output(&state, &output) == TIREID_OK);
    check_numbers(&output, sizeof output);
    CHECK(tireid_get_forces(&state, force) == TIREID_OK);
    CHECK(fabs((double)force[0]) <= (double)exported.max_force);
    CHECK(fabs((double)force[1]) <= (double)exported.max_force);
#if TIREID_TELLS_V_Y
    CHECK(output.v_y_sd >= (tireid_real)0);
    CHECK((output.side_slip_observable == (tireid_real)0)
        || (output.side_slip_observable == (tireid_real)1));
#endif
    CHECK((state.faults - before.faults) <= 1U);
    CHECK((status != TIREID_BAD_INPUT) || (state.faults == (before.faults + 1U)));
#ifdef LEARNT
    if ((told == 0)
        && ((state.adapts == 0U) || (status == TIREID_BAD_INPUT)
            || (status == TIREID_BAD_RESULT))) {
        tireid_weights now, then; /* what is refused teaches nothing; told ones enter their boxes */
        CHECK(tireid_get_weights(&state, &now) == TIREID_OK);
        CHECK(tireid_get_weights(&before, &then) == TIREID_OK);
        check_kept(now.LEARNT, then.LEARNT, sizeof now.LEARNT);
    }
#endif
    check_boxes();
    count_step((unsigned)status);
}

/* A car on tires that saturate, steered by a wave. */
static void sense(void)
{
    const double T = (double)TIREID_SAMPLE_TIME;
    const double delta = car.amplitude * sin(car.phase);
    const double v_x = fmax(car.v_x, 1.0);
    const double front = 8000.0 * tanh(15.0 * (delta - ((car.v_y + (1.15 * car.r)) / v_x)));
    const double rear = 6000.0 * tanh(-17.0 * ((car.v_y - (1.55 * car.r)) / v_x));
    car.phase += car.wave * T;
    car.v_y += T * (((front + rear) / 1500.0) - (v_x * car.r));
    car.r += T * ((1.15 * front) - (1.55 * rear)) / 2500.0;
    car.v_y = fmin(fmax(car.v_y, -20.0), 20.0);
    car.r = fmin(fmax(car.r, -5.0), 5.0);
    input.v_x = (tireid_real)car.v_x;
    input.v_y = (tireid_real)car.v_y;
    input.r = (tireid_real)car.r;
    input.delta_f = (tireid_real)delta;
    input.delta_r = (tireid_real)0;
#if TIREID_READS_A_Y
    input.a_y = (tireid_real)((front + rear) / 1500.0);
#endif
#if TIREID_TELLS_V_Y
    if (!car.measured) {
        input.v_y = (tireid_real)NAN;
    }
#endif
}

static void begin_road(reader *from)
{
    car.v_x = between(from, 20.0, 55.0);
    if (take_byte(from) >= 208U) {
        car.v_x = between(from, -1.0, 20.0);
    }
    car.wave = between(from, 0.0, 12.0);
    car.amplitude = between(from, 0.0, 0.3);
#if TIREID_TELLS_V_Y
    car.measured = (take_byte(from) >= 192U) ? 1 : 0;
#endif
    if (take_byte(from) < 64U) {
        car.v_y = car.r = 0.0;
    }
}

/* Samples with sense, in which one signal may be held, biased, turned or wrong. */
static void drive(reader *from)
{
    const uint32_t fault = take_byte(from);
    unsigned n = 1U + take_byte(from);
#if TIREID_READS_A_Y
    tireid_real *const signals[] = { &input.v_x, &input.a_y, &input.r, &input.delta_f };
#else
    tireid_real *const signals[] = { &input.v_x, &input.v_y, &input.r, &input.delta_f };
#endif
    tireid_real *const signal = signals[fault % 4U];
    const tireid_real held = *signal;
    const double wrong = ((fault & 0xF0U) == 0xF0U) ? hostile(from) : between(from, -3.0, 3.0);
    for (; n > 0U; n--) {
        sense();
        switch ((fault >> 2U) % 8U) {
        case 4:
            *signal = held;
            break;
        case 5:
            *signal = (tireid_real)((double)*signal + wrong);
            break;
        case 6:
            *signal = -*signal;
            break;
        case 7:
            *signal = (tireid_real)wrong;
            break;
        default:
            break;
        }
        take_step();
    }
}

/* Samples with any number anywhere. */
static void strike(reader *from)
{
    const uint32_t kind = take_byte(from);
    tireid_real number[REALS(tireid_input)];
    unsigned n = 1U + (kind % 3U);
    unsigned again = 1U + (kind >> 2U);
    sense();
    (void)memcpy(number, &input, sizeof number);
    for (; n > 0U; n--) {
        number[take_byte(from) % REALS(tireid_input)] = (tireid_real)hostile(from);
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
        params.max_speed = (tireid_real)hostile(from);
    }
    if ((kind & 2U) != 0U) {
        params.max_yaw_rate = (tireid_real)hostile(from);
    }
    if ((kind & 4U) != 0U) {
        params.max_steering = (tireid_real)hostile(from);
    }
    if ((kind & 8U) != 0U) {
        params.max_force *= (tireid_real)between(from, 0.0, 1.0);
    }
}

#ifdef LEARNT
/* Weights that were learnt, in part or wholly others; refused ones change nothing. */
static void set_weights(reader *from)
{
    tireid_weights weights;
    const tireid_state before = state;
    const uint32_t kind = take_byte(from);
    tireid_status status;
    unsigned i;
    CHECK(tireid_get_weights(&state, &weights) == TIREID_OK);
    for (i = 0U; i < (kind % 4U); i++) {
        tireid_real number[REALS(tireid_weights)];
        const unsigned at = take_byte(from) % REALS(tireid_weights);
        (void)memcpy(number, &weights, sizeof number);
        number[at] =
            (tireid_real)(((kind & 4U) != 0U) ? hostile(from)
                                              : between(from, -2.0, 2.0) * (double)number[at]);
        (void)memcpy(&weights, number, sizeof number);
    }
    status = tireid_set_weights(&state, &weights);
    CHECK((status == TIREID_OK) || (status == TIREID_BAD_INPUT));
    if (status == TIREID_BAD_INPUT) {
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
    const tireid_state before = state;
    if (kind == 0U) {
        CHECK(tireid_init(&state) == TIREID_OK);
        told = 0;
    } else if (kind < 4U) {
        CHECK(tireid_reset(&state) == TIREID_OK);
        CHECK(state.faults == before.faults);
    } else if (kind == 4U) {
        CHECK(tireid_step(NULL, &params, &input) == TIREID_BAD_CALL);
        CHECK(tireid_step(&state, NULL, &input) == TIREID_BAD_CALL);
        CHECK(tireid_step(&state, &params, NULL) == TIREID_BAD_CALL);
        CHECK(memcmp(&before, &state, sizeof before) == 0);
    } else {
#ifdef LEARNT
        CHECK(tireid_set_adaptation(&state, kind != 5U) == TIREID_OK);
#endif
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    reader from = { data, size };
    inputs++;
    CHECK(tireid_default_params(&exported) == TIREID_OK);
    params = exported;
    CHECK(tireid_init(&state) == TIREID_OK);
    told = 0;
    car.v_y = car.r = car.phase = 0.0;
    begin_road(&from);
    sense();
    while (from.left > 0U) {
        switch (take_byte(&from) % 16U) {
        case 0:
        case 1:
        case 2:
        case 3:
        case 4:
        case 5:
        case 6:
            drive(&from);
            break;
        case 7:
        case 8:
            begin_road(&from);
            break;
        case 9:
        case 10:
        case 11:
            strike(&from);
            break;
        case 12:
            set_params(&from);
            break;
        case 13:
            change_mode(&from);
            break;
#ifdef LEARNT
        case 14:
            set_weights(&from);
            break;
#endif
        default:
            params = exported;
            break;
        }
    }
    return 0;
}
