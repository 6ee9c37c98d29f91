/* Steers a car along a path, in C99; tireid_mpc_config.h says which car, and holds the sizes.
 *
 * Axes: x forward, y left, z up. Steering, yaw rate, slip and lateral force are positive to the
 * left; slip angle alpha = delta - atan((v_y +- l r)/v_x), so that F_y = +C alpha.
 *
 * One step each params.period. Nothing is allocated and every loop is bounded. The caller owns
 * state, parameters and work memory; they hold no pointer and may be copied with memcpy. Work
 * memory means nothing between two steps, but what `prepare` leaves there for the next. Calls on different states may run at the same time, with
 * work memory of their own.
 */
#ifndef TIREID_MPC_H
#define TIREID_MPC_H

#include <stdbool.h>
#include <stdint.h>

#include "tireid_mpc_config.h"

#if defined(__FAST_MATH__)
#error "-ffast-math and -Ofast delete the guards against NaN: compile without them"
#elif defined(__FINITE_MATH_ONLY__)
#if __FINITE_MATH_ONLY__ > 0
#error "-ffinite-math-only deletes the guards against NaN: compile without it"
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define TIREID_MPC_ROWS 5U /* bounds a stage: rate, angle, deviation, slip in front, at the rear */
#define TIREID_MPC_COMMANDS 32U /* past commands that a delay may reach back */
#define TIREID_MPC_STATUSES 9U

typedef enum {
    TIREID_MPC_OK = 0,              /* the plan is new */
    TIREID_MPC_ITERATION_LIMIT = 1, /* the plan is new, not quite the best one */
    TIREID_MPC_QP_FAILED = 2,       /* no plan: not convex, or not finite */
    TIREID_MPC_NOT_FINITE = 3,      /* an input is not a number */
    TIREID_MPC_OFF_PATH = 4,        /* |e_y| or |e_psi| beyond the limits, or kappa e_y > 0.9 */
    TIREID_MPC_OFF_MAP = 5,         /* |v_y|, |r|, speed or curvature beyond the limits */
    TIREID_MPC_TOO_SLOW = 6,        /* slower than min_speed, now or ahead */
    TIREID_MPC_LATE = 7,            /* set by the caller: the command came after its time */
    TIREID_MPC_BAD_CALL = 8         /* a null pointer, no such angle: nothing was done */
} tireid_mpc_status;

typedef struct {
    tireid_mpc_real car[4];                      /* mass [kg], yaw inertia [kg m^2], l_f, l_r [m] */
    tireid_mpc_real weights[TIREID_MPC_WEIGHTS]; /* of the tire; may change between two steps */
    tireid_mpc_real cost[TIREID_MPC_ERRORS];     /* q of 1/2 q y^2 a stage, y in SI */
    tireid_mpc_real cost_end[TIREID_MPC_ERRORS]; /* q at the end of the plan */
    tireid_mpc_real cost_rate;                   /* R of 1/2 R u^2 a stage, u [rad/s] */
    tireid_mpc_real stage_time;                  /* of a stage of the plan [s] */
    tireid_mpc_real period;                      /* between two steps [s], at most stage_time */
    tireid_mpc_real delay;        /* from a measurement to its command's effect [s] */
    tireid_mpc_real max_steering; /* |delta| [rad], hard */
    tireid_mpc_real max_rate;     /* |u| [rad/s], hard */
    tireid_mpc_real max_e_y;      /* |e_y| [m], soft */
    tireid_mpc_real max_slip[2];  /* |alpha|, front and rear [rad], soft; curves end there */
    tireid_mpc_real rise[2];      /* of the axle forces beyond max_slip [N/rad] */
    tireid_mpc_real soft_e_y;     /* Z of 1/2 Z s^2 where |e_y| is s beyond [1/m^2] */
    tireid_mpc_real soft_slip;    /* Z of slip [1/rad^2] */
    tireid_mpc_real caution;      /* share of what is not known that is feared, 0 to 1 */
    tireid_mpc_real grips[TIREID_MPC_GRIPS]; /* frictions over that of the tire, 1 and falling */
    tireid_mpc_real prior[TIREID_MPC_GRIPS]; /* what each is held for at first, see `cost` */
    tireid_mpc_real surprise;                /* cost of a friction that comes without notice */
    tireid_mpc_real doubt[2][TIREID_MPC_DOUBTS]; /* half the band of the axle forces [N] */
    tireid_mpc_real doubt_step;     /* slip from one of them to the next, from 0 on [rad] */
    tireid_mpc_real force_error[2]; /* of the axle forces as motion shows them [N] */
    tireid_mpc_real stiffness;      /* slope of the force in front at no slip [N/rad] */
    tireid_mpc_real widest_e_y;     /* |e_y| [m] beyond which the car is off the path */
    tireid_mpc_real widest_e_psi;   /* |e_psi| [rad] */
    tireid_mpc_real max_v_y;        /* |v_y| [m/s] beyond which the tire is not known */
    tireid_mpc_real max_yaw_rate;   /* |r| [rad/s] */
    tireid_mpc_real min_speed;      /* v_x [m/s], positive, now and ahead */
    tireid_mpc_real max_speed;      /* v_x [m/s] beyond which no input is believed */
    tireid_mpc_real max_curvature;  /* |kappa| [1/m], likewise */
    tireid_mpc_real speeds[TIREID_MPC_SPEEDS]; /* of the rows below [m/s], rising */
    tireid_mpc_real gains[TIREID_MPC_SPEEDS][TIREID_MPC_GAINS]; /* of steering without a plan, SI */
    tireid_mpc_real hold_time; /* how long an old plan is followed [s] */
    tireid_mpc_real tolerance; /* of the solver, in parts: 1e-8, in float 1e-5 */
    uint32_t max_iterations;   /* of the solver */
    uint32_t linearizations;   /* a step, 1 in real time */
    uint32_t max_active_sets;  /* of limits tried before the interior point; 0: none */
} tireid_mpc_params;

typedef struct {
    tireid_mpc_real e_y;   /* deviation from the path [m], > 0 left of it */
    tireid_mpc_real e_psi; /* heading against the path [rad] */
    tireid_mpc_real v_y;   /* lateral velocity [m/s] */
    tireid_mpc_real r;     /* yaw rate [rad/s] */
    /* curvature [1/m] and speed [m/s]: now, then in mid of each stage */
    tireid_mpc_real kappa[TIREID_MPC_HORIZON + 1U];
    tireid_mpc_real v_x[TIREID_MPC_HORIZON + 1U];
} tireid_mpc_input;

typedef struct {
    /* plan, from the time of the command on; steering rate [rad/s]; its feedback of each state */
    tireid_mpc_real x[TIREID_MPC_HORIZON + 1U][TIREID_MPC_STATES];
    tireid_mpc_real u[TIREID_MPC_HORIZON];
    tireid_mpc_real feedback[TIREID_MPC_HORIZON][TIREID_MPC_STATES];
    tireid_mpc_real commands[TIREID_MPC_COMMANDS]; /* steering [rad], the last one first */
    tireid_mpc_real lagged[2];                     /* slip of lagging tires now [rad] */
    tireid_mpc_real zero;  /* of the wheels over what is commanded [rad], without caution none */
    tireid_mpc_real drift; /* across the path beyond heading and v_y, that is planned with [m/s] */
    tireid_mpc_real turning;  /* beyond the yaw rate, that is planned with [rad/s] */
    tireid_mpc_real apart[2]; /* both as position and heading show them now [m/s, rad/s] */
    tireid_mpc_real stays[2]; /* what of that stays */
    tireid_mpc_real last[2];  /* v_y [m/s] and yaw rate [rad/s] that were watched last */
    tireid_mpc_real place[2]; /* e_y [m] and e_psi [rad], followed by what moves the car */
    tireid_mpc_real grip;     /* friction that is planned with, over that of the tire */
    /* of each friction: -2 ln of its likelihood over that of the best; its slip [rad]; the impulse of
     * the axles, followed by it [N s] */
    tireid_mpc_real cost[TIREID_MPC_GRIPS];
    tireid_mpc_real slips[TIREID_MPC_GRIPS][2];
    tireid_mpc_real impulse[TIREID_MPC_GRIPS][2];
    uint32_t faults[TIREID_MPC_STATUSES]; /* steps of each status, from init on */
    uint32_t iterations;                  /* of the last solution */
    uint32_t shifted;  /* 1: the plan is where the next step begins, before that */
    uint32_t prepared; /* 1: work memory is prepared for the next solution */
    uint32_t age;      /* steps since the plan was new */
    uint32_t planned;  /* 0 until there is a plan */
    uint32_t guessed;  /* 1: x and u without a solution */
    uint32_t started;  /* 0 until the first step */
    uint32_t gentle;   /* steps that told of the zero of the wheels */
    uint32_t placed;   /* steps that told of those of v_y and yaw rate */
    uint32_t watched;  /* steps for which impulses are followed */
    uint32_t doubted;  /* 0 until frictions have their costs */
} tireid_mpc_state;

/* A stage, linearized: x_next = A x + B u + c, all as differences from the plan; by columns. */
typedef struct {
    tireid_mpc_real c[TIREID_MPC_STATES];
    tireid_mpc_real A[TIREID_MPC_STATES * TIREID_MPC_STATES];
    tireid_mpc_real B[TIREID_MPC_STATES];
    tireid_mpc_real H[TIREID_MPC_STATES * TIREID_MPC_STATES];
    tireid_mpc_real h[TIREID_MPC_STATES];
    tireid_mpc_real slip[2];
    tireid_mpc_real slip_x[2U * TIREID_MPC_STATES];
} tireid_mpc_stage;

/* v <= 1 and -v <= 1 */
typedef tireid_mpc_real tireid_mpc_sides[2][TIREID_MPC_HORIZON * TIREID_MPC_ROWS];

typedef struct {
    tireid_mpc_stage stage[TIREID_MPC_HORIZON + 1U];
    tireid_mpc_real x[TIREID_MPC_HORIZON + 1U][TIREID_MPC_STATES]; /* that were linearized at */
    tireid_mpc_real u[TIREID_MPC_HORIZON];
    tireid_mpc_real du[TIREID_MPC_HORIZON];
    tireid_mpc_real dx[TIREID_MPC_HORIZON + 1U][TIREID_MPC_STATES];
    tireid_mpc_real feedback[TIREID_MPC_HORIZON][TIREID_MPC_STATES];
    /* backward: see tireid_mpc_riccati.c */
    tireid_mpc_real M[TIREID_MPC_HORIZON + 1U][TIREID_MPC_STATES * TIREID_MPC_STATES];
    tireid_mpc_real m[TIREID_MPC_HORIZON + 1U][TIREID_MPC_STATES];
    tireid_mpc_real Pc[TIREID_MPC_HORIZON][TIREID_MPC_STATES];
    tireid_mpc_real L[TIREID_MPC_HORIZON][TIREID_MPC_STATES];
    tireid_mpc_real l[TIREID_MPC_HORIZON];
    tireid_mpc_real lambda[TIREID_MPC_HORIZON];
    tireid_mpc_real per_lambda[TIREID_MPC_HORIZON];
    tireid_mpc_real d[TIREID_MPC_HORIZON];
    uint32_t held[TIREID_MPC_HORIZON]; /* what a stage has instead of its best input: */
    tireid_mpc_real
        held_to[TIREID_MPC_HORIZON]; /* its du, or the difference of the angle behind it */
    tireid_mpc_real left[TIREID_MPC_HORIZON][3]; /* share of the soft limits that caution leaves */
    /* rows |value| <= 1, in parts of their limits */
    tireid_mpc_real scale[TIREID_MPC_HORIZON * TIREID_MPC_ROWS]; /* 1 / limit */
    tireid_mpc_real value[TIREID_MPC_HORIZON * TIREID_MPC_ROWS]; /* at the plan */
    tireid_mpc_real reached[TIREID_MPC_HORIZON * TIREID_MPC_ROWS];
    tireid_mpc_real regular[TIREID_MPC_HORIZON * TIREID_MPC_ROWS];
    tireid_mpc_real slope[TIREID_MPC_HORIZON * TIREID_MPC_ROWS];
    int32_t active[TIREID_MPC_HORIZON * TIREID_MPC_ROWS]; /* 1 at its limit, -1 at the other, 0 */
    int32_t next[TIREID_MPC_HORIZON * TIREID_MPC_ROWS];   /* after what is reached */
    tireid_mpc_sides gap;
    tireid_mpc_sides multiplier;
    tireid_mpc_sides gap_step;
    tireid_mpc_sides multiplier_step;
    tireid_mpc_sides target;
    tireid_mpc_sides weight;
    tireid_mpc_sides inverse;
    tireid_mpc_real kappa[TIREID_MPC_HORIZON]; /* road that is linearized on */
    tireid_mpc_real v_x[TIREID_MPC_HORIZON];
    bool ready; /* the first set of active rows is factorized */
    uint32_t iterations;
} tireid_mpc_work;

/* Begin with the wheels straight and no plan; faults are forgotten. */
tireid_mpc_status tireid_mpc_init(tireid_mpc_state *state);

/* Begin with the wheels at an angle [rad], at most params.max_steering to either side, and no plan;
 * faults are kept. */
tireid_mpc_status tireid_mpc_reset(
    tireid_mpc_state *state, const tireid_mpc_params *params, tireid_mpc_real steering);

/* Do ahead of a measurement what does not ask for it: shift the plan, linearize along it on the road that
 * is expected, factorize. Its step then does the first third of the stages anew, and a sweep. Of `expected` the road alone is
 * read, as the next step will be told. Parameters and work memory must stay as they are until then.
 * Without a plan, or where the road becomes another, the step does all itself. */
tireid_mpc_status tireid_mpc_prepare(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *expected);

/* Take a measurement; steering [rad] is what to command now, whatever the status. No number that is
 * not finite enters the state: what is refused leaves the plan that there was. */
tireid_mpc_status tireid_mpc_step(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_input *input, tireid_mpc_real *steering);

/* One iteration from the plan in the state, which is not shifted, and stays where there is no other.
 * Begins from what is prepared, on that road. x0 is the car at the beginning of the first stage; kappa and v_x are those of the stages. */
tireid_mpc_status tireid_mpc_solve(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_real x0[TIREID_MPC_STATES],
    const tireid_mpc_real kappa[TIREID_MPC_HORIZON], const tireid_mpc_real v_x[TIREID_MPC_HORIZON]);

/* Say that the command of the last step came too late, and what was steered instead [rad], at most
 * 3.2 to either side. */
tireid_mpc_status tireid_mpc_late(tireid_mpc_state *state, tireid_mpc_real steering);

const char *tireid_mpc_version(void);

#ifdef __cplusplus
}
#endif

#endif
