/* Every input is a drive of an exported tracker: calls with sense and without, rules after each.
 *
 * Nothing but the public headers is read. A refused sample must do to the plan what any other
 * refused sample does, which is to move it on by a period. */
#include "reader.h"

#include "tireid_mpc.h"
#include "tireid_mpc_params.h"

#define REALS(type) (sizeof(type) / sizeof(tireid_mpc_real))
#define NUMBERS ((sizeof(tireid_mpc_params) - (2U * sizeof(uint32_t))) / sizeof(tireid_mpc_real))
#define CARRIED 1e13 /* more than any number that is carried */

static tireid_mpc_params exported;
static tireid_mpc_params params;
static tireid_mpc_state state;
static tireid_mpc_state twin;
static tireid_mpc_work work;
static tireid_mpc_input input;

/* Where the car is and what the road does, of a drive with sense. */
static struct {
    double v_x, e_y, e_psi, v_y, r, kappa;
} car;

static int are_carried(const tireid_mpc_real *x, size_t n)
{
    size_t i;
    for (i = 0U; i < n; i++) {
        if (!(fabs((double)x[i]) <= CARRIED)) {
            return 0;
        }
    }
    return 1;
}

static void check_state(void)
{
    CHECK(are_carried(&state.x[0][0], REALS(state.x)));
    CHECK(are_carried(state.u, REALS(state.u)));
    CHECK(are_carried(&state.feedback[0][0], REALS(state.feedback)));
    CHECK(are_carried(state.commands, REALS(state.commands)));
    CHECK(are_carried(state.lagged, REALS(state.lagged)));
}

/* What of the state a refused sample may not touch but by a period. */
static int same_plan(const tireid_mpc_state *a, const tireid_mpc_state *b)
{
    return (memcmp(a->x, b->x, sizeof a->x) == 0) && (memcmp(a->u, b->u, sizeof a->u) == 0)
        && (memcmp(a->feedback, b->feedback, sizeof a->feedback) == 0)
        && (memcmp(a->lagged, b->lagged, sizeof a->lagged) == 0) && (a->planned == b->planned)
        && (a->age == b->age) && (a->guessed == b->guessed) && (a->started == b->started);
}

static void check_refused(const tireid_mpc_state *before)
{
    static tireid_mpc_input nothing;
    tireid_mpc_real steering;
    twin = *before;
    nothing = input;
    nothing.e_y = (tireid_mpc_real)NAN;
    CHECK(tireid_mpc_step(&twin, &params, &work, &nothing, &steering) == TIREID_MPC_NOT_FINITE);
    CHECK(same_plan(&state, &twin));
}

static double take_step(void)
{
    static tireid_mpc_state before;
    tireid_mpc_real steering = (tireid_mpc_real)NAN;
    tireid_mpc_status status;
    double most, moved;
    unsigned i;
    before = state;
    status = tireid_mpc_step(&state, &params, &work, &input, &steering);
    CHECK((unsigned)status < TIREID_MPC_STATUSES);
    CHECK((status != TIREID_MPC_LATE) && (status != TIREID_MPC_BAD_CALL));
    CHECK(fabs((double)steering) <= ((double)params.max_steering * 1.000001));
    most = (double)params.max_rate * (double)params.period;
    moved = fabs((double)steering - (double)before.commands[0]);
    if (fabs((double)before.commands[0]) <= (double)params.max_steering) { /* not told otherwise */
        CHECK(moved <= ((most * 1.000001) + (fabs((double)steering) * 1e-6)));
    }
    CHECK(memcmp(&steering, &state.commands[0], sizeof steering) == 0);
    CHECK(state.iterations <= params.max_iterations);
    for (i = 0U; i < TIREID_MPC_STATUSES; i++) {
        CHECK(state.faults[i] == (before.faults[i] + ((i == (unsigned)status) ? 1U : 0U)));
    }
    check_state();
    for (i = 0U; (status <= TIREID_MPC_ITERATION_LIMIT) && (i < TIREID_MPC_HORIZON); i++) {
        CHECK(fabs((double)state.u[i]) <= ((double)params.max_rate * 1.000001));
        CHECK(fabs((double)state.x[i][4]) <= ((double)params.max_steering * 1.000001));
    }
    if (status >= TIREID_MPC_NOT_FINITE) {
        check_refused(&before);
    }
    count_step((unsigned)status);
    return (double)steering;
}

/* The car as it moves, and the road ahead of it. */
static void sense(void)
{
    unsigned k;
    input.e_y = (tireid_mpc_real)car.e_y;
    input.e_psi = (tireid_mpc_real)car.e_psi;
    input.v_y = (tireid_mpc_real)car.v_y;
    input.r = (tireid_mpc_real)car.r;
    for (k = 0U; k <= TIREID_MPC_HORIZON; k++) {
        input.kappa[k] = (tireid_mpc_real)car.kappa;
        input.v_x[k] = (tireid_mpc_real)car.v_x;
    }
}

static void go_on(double steering)
{
    const double T = 0.01;
    const double r = car.v_x * steering / (2.7 + (0.003 * car.v_x * car.v_x));
    car.r += (r - car.r) * T / 0.1;
    car.v_y += ((1.5 - (0.01 * car.v_x * car.v_x)) * car.r - car.v_y) * T / 0.1;
    car.e_psi += (car.r - (car.kappa * car.v_x)) * T;
    car.e_y += ((car.v_x * sin(car.e_psi)) + (car.v_y * cos(car.e_psi))) * T;
}

static void begin_road(reader *from)
{
    const double lateral = between(from, -9.0, 9.0);
    car.v_x = between(from, 2.0, 50.0);
    car.kappa = lateral / (car.v_x * car.v_x);
    car.kappa = fmin(fmax(car.kappa, -0.15), 0.15);
}

/* Steps with sense, in which some signals may be held or wrong. */
static void drive(reader *from)
{
    const uint32_t fault = take_byte(from);
    unsigned n = 1U + (take_byte(from) % 16U);
    const tireid_mpc_input held = input;
    const double wrong = ((fault & 0xF0U) == 0xF0U) ? hostile(from) : between(from, -2.0, 2.0);
    for (; n > 0U; n--) {
        sense();
        switch (fault % 16U) {
        case 8:
            input.e_y = held.e_y;
            break;
        case 9:
            input.e_psi = held.e_psi;
            break;
        case 10:
            input.v_y = held.v_y;
            break;
        case 11:
            input.r = held.r;
            break;
        case 12:
            input.e_y += (tireid_mpc_real)wrong;
            break;
        case 13:
            input.e_psi += (tireid_mpc_real)wrong;
            break;
        case 14:
            input.v_y = (tireid_mpc_real)wrong;
            break;
        case 15:
            input.r = (tireid_mpc_real)wrong;
            break;
        default:
            break;
        }
        go_on(take_step());
        if (!(fabs(car.e_y) < 20.0) || !(fabs(car.e_psi) < 3.0)) {
            car.e_y = car.e_psi = car.v_y = car.r = 0.0;
        }
    }
}

/* Steps with any number anywhere; between two of them the car is as it was. */
static void strike(reader *from)
{
    const uint32_t kind = take_byte(from);
    unsigned n = 1U + (kind % 4U);
    unsigned again = 1U + ((kind >> 4U) % 8U);
    tireid_mpc_real number[REALS(tireid_mpc_input)];
    sense();
    (void)memcpy(number, &input, sizeof number);
    for (; n > 0U; n--) {
        const unsigned at = (take_byte(from) << 8U) | take_byte(from);
        number[at % REALS(tireid_mpc_input)] = (tireid_mpc_real)hostile(from);
    }
    (void)memcpy(&input, number, sizeof number);
    for (; again > 0U; again--) {
        (void)take_step();
    }
}

/* Curvature and deviation together: the center of the turn, and beyond. */
static void strike_center(reader *from)
{
    const double e_y = between(from, -6.0, 6.0);
    const double near = between(from, 0.0, 2.0);
    unsigned k;
    sense();
    input.e_y = (tireid_mpc_real)e_y;
    for (k = 0U; k <= TIREID_MPC_HORIZON; k++) {
        input.kappa[k] = (tireid_mpc_real)((e_y != 0.0) ? (near / e_y) : near);
    }
    if ((take_byte(from) % 2U) == 0U) {
        input.kappa[0] = (tireid_mpc_real)0; /* the center comes later */
    }
    (void)take_step();
}

static void swap_weights(reader *from)
{
    tireid_mpc_real weights[TIREID_MPC_WEIGHTS];
    const uint32_t kind = take_byte(from);
    const double share = between(from, 0.4, 1.4);
    tireid_mpc_params before = params;
    int sane = 1;
    unsigned i;
    for (i = 0U; i < TIREID_MPC_WEIGHTS; i++) {
        weights[i] = (tireid_mpc_real)(share * (double)exported.weights[i]);
    }
    for (i = 0U; i < (kind % 4U); i++) {
        weights[take_byte(from) % TIREID_MPC_WEIGHTS] = (tireid_mpc_real)hostile(from);
    }
    for (i = 0U; i < TIREID_MPC_WEIGHTS; i++) {
        sane = sane && isfinite(weights[i]);
    }
    if (tireid_mpc_set_weights(&params, weights) == TIREID_MPC_OK) {
        CHECK(sane);
    } else {
        CHECK(memcmp(&before, &params, sizeof before) == 0);
    }
}

/* Any number in any place of the parameters, as far as they are accepted. */
static void set_param(reader *from)
{
    const tireid_mpc_params before = params;
    tireid_mpc_real number[NUMBERS];
    const unsigned at = (take_byte(from) << 8U) | take_byte(from);
    (void)memcpy(number, &params, sizeof number);
    number[at % NUMBERS] = ((at & 0x8000U) != 0U)
        ? (tireid_mpc_real)hostile(from)
        : (tireid_mpc_real)(between(from, 0.2, 3.0) * (double)number[at % NUMBERS]);
    (void)memcpy(&params, number, sizeof number);
    params.max_iterations = 1U + (take_byte(from) % 40U);
    params.linearizations = take_byte(from) % 3U;
    if (!tireid_mpc_accepts(&params)) {
        params = before;
    }
}

static void tell_angle(reader *from)
{
    const uint32_t kind = take_byte(from);
    const double angle = ((kind % 2U) == 0U) ? between(from, -0.7, 0.7) : hostile(from);
    const tireid_mpc_state before = state;
    const tireid_mpc_status status = ((kind & 2U) != 0U)
        ? tireid_mpc_late(&state, (tireid_mpc_real)angle)
        : tireid_mpc_reset(&state, &params, (tireid_mpc_real)angle);
    CHECK((status == TIREID_MPC_OK) || (status == TIREID_MPC_BAD_CALL));
    CHECK((status == TIREID_MPC_OK) || (memcmp(&before, &state, sizeof before) == 0));
    check_state();
}

/* An iteration from any place. */
static void solve(reader *from)
{
    tireid_mpc_real x0[TIREID_MPC_STATES];
    tireid_mpc_status status;
    const tireid_mpc_state before = state;
    unsigned i;
    sense();
    for (i = 0U; i < TIREID_MPC_STATES; i++) {
        x0[i] =
            (tireid_mpc_real)((take_byte(from) < 64U) ? hostile(from) : between(from, -1.0, 1.0));
    }
    if (take_byte(from) < 64U) {
        input.kappa[1U + (take_byte(from) % TIREID_MPC_HORIZON)] = (tireid_mpc_real)hostile(from);
    }
    status = tireid_mpc_solve(&state, &params, &work, x0, &input.kappa[1], &input.v_x[1]);
    CHECK(status <= TIREID_MPC_QP_FAILED);
    CHECK((status != TIREID_MPC_QP_FAILED) || same_plan(&before, &state));
    check_state();
    count_step((unsigned)status);
}

static void call_without(reader *from)
{
    const tireid_mpc_state before = state;
    const uint32_t kind = take_byte(from) % 5U;
    tireid_mpc_real steering = 0;
    CHECK(tireid_mpc_step((kind == 0U) ? NULL : &state, (kind == 1U) ? NULL : &params,
              (kind == 2U) ? NULL : &work, (kind == 3U) ? NULL : &input,
              (kind == 4U) ? NULL : &steering)
        == TIREID_MPC_BAD_CALL);
    CHECK(memcmp(&before, &state, sizeof before) == 0);
    (void)memset(&work, (int)take_byte(from), sizeof work); /* means nothing between two steps */
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    reader from = { data, size };
    inputs++;
    CHECK(tireid_mpc_default_params(&exported) == TIREID_MPC_OK);
    params = exported;
    CHECK(tireid_mpc_init(&state) == TIREID_MPC_OK);
    car.e_y = car.e_psi = car.v_y = car.r = 0.0;
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
            begin_road(&from);
            break;
        case 8:
        case 9:
            strike(&from);
            break;
        case 10:
            strike_center(&from);
            break;
        case 11:
            swap_weights(&from);
            break;
        case 12:
            set_param(&from);
            break;
        case 13:
            tell_angle(&from);
            break;
        case 14:
            solve(&from);
            break;
        default:
            call_without(&from);
            break;
        }
    }
    return 0;
}
