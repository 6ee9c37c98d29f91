/* Identifier and tracker on a car: learn the tires while driving, and steer by what was learnt.
 *
 *     tireid_closed_loop [drives.csv]
 *
 * Drives the same double lane changes twice: by the tires of the export, and learning; writes both
 * drives to the file, which must not exist. Returns 0
 * where the learning car stays on the road and, once it has learnt, within LEARNT_PEAK.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "tireid.h"
#include "tireid_handover.h"
#include "tireid_mpc.h"
#include "tireid_mpc_params.h"
#include "simulated_car.h"
#include "lane_changes.h"

#define SPEED 21.0       /* m/s: the lane changes ask for 0.83 of the friction */
#define PASSES 6         /* double lane changes */
#define TRANSPORT 2      /* periods from a measurement until its command leaves */
#define ACTUATOR 0.02    /* lag of the steering [s] */
#define LEARN_FIRST 6.0  /* s before anything is handed over */
#define SHARE 0.02       /* of the way to what was learnt, each period */
#define WIDEST 1.75      /* m: the car leaves the road */
#define LEARNT_PEAK 0.15 /* m, in the last pass: a few centimeters are usual */

typedef struct {
    double sum;  /* of squares of e_y [m^2] */
    double peak; /* of |e_y| [m] */
    long samples;
} score;

typedef struct {
    score pass[PASSES];
    double solve_time; /* of all steps [s] */
    unsigned long steps;
    unsigned long taken;  /* times that learnt weights were taken */
    unsigned long faults; /* steps without a new plan */
    bool completed;
} result;

static unsigned long seed;

/* Noise, uniform between -size and size, the same on every machine. */
static double noise(double size)
{
    seed = ((seed * 1664525UL) + 1013904223UL) & 0xFFFFFFFFUL;
    return size * (((double)seed / 2147483648.0) - 1.0);
}

/* The car against the road, and the road ahead. */
static tireid_mpc_input look(const simulated_car *car, const tireid_mpc_params *params)
{
    const double period = (double)params->period;
    const double ahead = fmax((double)params->delay - (0.5 * period), 0.0);
    tireid_mpc_input in;
    unsigned k;
    in.e_y = (tireid_mpc_real)(car->e_y + noise(0.005));
    in.e_psi = (tireid_mpc_real)(car->e_psi + noise(0.001));
    in.v_y = (tireid_mpc_real)(car->v_y + noise(0.02));
    in.r = (tireid_mpc_real)(car->r + noise(0.002));
    for (k = 0; k <= TIREID_MPC_HORIZON; k++) {
        const double stage = ((double)k - 0.5) * (double)params->stage_time;
        const double t = (k == 0) ? 0.0 : (ahead + stage);
        in.kappa[k] = (tireid_mpc_real)lane_changes_curvature(car->s + (car->v_x * t));
        in.v_x[k] = (tireid_mpc_real)car->v_x;
    }
    return in;
}

/* Tell the identifier what the sensors say, and hand over what it has learnt; where it tells v_y, the
 * tracker is not shown another one. */
static bool learn(tireid_state *identifier, const tireid_params *limits, const simulated_car *car,
    tireid_mpc_input *seen, tireid_mpc_params *params, bool hands_over)
{
    tireid_input in;
    tireid_weights learnt;
#if TIREID_TELLS_V_Y
    tireid_output told;
#endif
    in.v_x = (tireid_real)car->v_x;
#if TIREID_TELLS_V_Y
    in.v_y = (tireid_real)NAN; /* no sensor: the tracker steers by the one that is told */
#else
    in.v_y = (tireid_real)seen->v_y;
#endif
    in.r = (tireid_real)seen->r;
    in.delta_f = (tireid_real)car->delta;
    in.delta_r = 0;
#if TIREID_READS_A_Y
    in.a_y = (tireid_real)(((car->force[0] + car->force[1]) / (double)params->car[0]) + noise(0.1));
#endif
    (void)tireid_step(identifier, limits, &in);
#if TIREID_TELLS_V_Y
    (void)tireid_get_output(identifier, &told);
    seen->v_y = (tireid_mpc_real)told.v_y;
#endif
    (void)tireid_get_weights(identifier, &learnt);
    return hands_over && tireid_handover(&learnt, params, (tireid_mpc_real)SHARE);
}

static void add(score *pass, double e_y)
{
    pass->sum += e_y * e_y;
    pass->peak = fmax(pass->peak, fabs(e_y));
    pass->samples++;
}

static result drive(bool learns, FILE *log)
{
    static tireid_state identifier;
    static tireid_mpc_state tracker;
    static tireid_mpc_work work;
    static tireid_params limits;
    static tireid_mpc_params params;
    double on_the_way[TRANSPORT] = { 0.0 }; /* commands, the oldest last */
    simulated_car_numbers numbers = { 0.0, 0.0, { 0.0, 0.0 }, 0.95, 15.0, 0.4, ACTUATOR };
    simulated_car car;
    result found;
    unsigned i;
    (void)memset(&car, 0, sizeof car);
    (void)memset(&found, 0, sizeof found);
    (void)tireid_default_params(&limits);
    (void)tireid_init(&identifier);
    (void)tireid_mpc_default_params(&params);
    (void)tireid_mpc_init(&tracker);
    numbers.mass = (double)params.car[0];
    numbers.inertia = (double)params.car[1];
    numbers.l[0] = (double)params.car[2];
    numbers.l[1] = (double)params.car[3];
    params.delay = ((tireid_mpc_real)TRANSPORT * params.period) + (tireid_mpc_real)ACTUATOR;
    car.v_x = SPEED;
    seed = 1UL;
    while ((car.s < (PASSES * LANE_CHANGES_PASS)) && (fabs(car.e_y) < WIDEST)) {
        const double t = (double)found.steps * (double)params.period;
        tireid_mpc_input seen = look(&car, &params);
        tireid_mpc_real steering = 0;
        tireid_mpc_status status;
        clock_t start;
        found.taken +=
            learn(&identifier, &limits, &car, &seen, &params, learns && (t > LEARN_FIRST)) ? 1UL
                                                                                           : 0UL;
        start = clock();
        status = tireid_mpc_step(&tracker, &params, &work, &seen, &steering);
        found.solve_time += (double)(clock() - start) / (double)CLOCKS_PER_SEC;
        found.faults += (status >= TIREID_MPC_QP_FAILED) ? 1UL : 0UL;
        found.steps++;
        add(&found.pass[(int)(car.s / LANE_CHANGES_PASS)], car.e_y);
        if (log != NULL) {
            fprintf(log, "%d,%.3f,%.4f,%.5f,%.5f,%.5f,%.5f,%.6f,%.1f,%.1f,%d\n", learns ? 1 : 0, t,
                car.s, car.e_y, car.e_psi, car.v_y, car.r, car.delta, car.force[0], car.force[1],
                (int)status);
        }
        simulated_car_advance(&car, &numbers, on_the_way[TRANSPORT - 1], (double)params.period);
        for (i = TRANSPORT - 1; i > 0; i--) {
            on_the_way[i] = on_the_way[i - 1];
        }
        on_the_way[0] = (double)steering;
    }
    found.completed = fabs(car.e_y) < WIDEST;
    return found;
}

static void print(const char *title, const result *found)
{
    int i;
    printf("%s: %s, %lu steps, %lu without a new plan, %.0f us a step\n", title,
        found->completed ? "completed" : "LEFT THE ROAD", found->steps, found->faults,
        1e6 * found->solve_time / (double)found->steps);
    for (i = 0; i < PASSES; i++) {
        const score *pass = &found->pass[i];
        if (pass->samples > 0) {
            printf("  pass %d: e_y rms %.3f m, peak %.3f m\n", i + 1,
                sqrt(pass->sum / (double)pass->samples), pass->peak);
        }
    }
}

int main(int argc, char *argv[])
{
    FILE *log = (argc > 1) ? fopen(argv[1], "r") : NULL;
    result exported;
    result learnt;
    bool good;
    if (log != NULL) {
        (void)fclose(log);
        fprintf(stderr, "%s: exists and is not replaced, give another name\n", argv[1]);
        return 2;
    }
    log = (argc > 1) ? fopen(argv[1], "w") : NULL;
    if ((argc > 1) && (log == NULL)) {
        fprintf(stderr, "%s: cannot be written\n", argv[1]);
        return 2;
    }
    if (log != NULL) {
        fprintf(log, "learns,t,s,e_y,e_psi,v_y,r,delta,Fyf,Fyr,status\n");
    }
    exported = drive(false, log);
    learnt = drive(true, log);
    if (log != NULL) {
        (void)fclose(log);
    }
    print("tires of the export", &exported);
    print("tires that are learnt", &learnt);
    good = learnt.completed && (learnt.faults == 0UL) && (learnt.taken > 0UL)
        && (learnt.pass[PASSES - 1].peak <= LEARNT_PEAK);
    printf("%s; the last pass stays within %.2f m of %.2f m allowed: %s\n", tireid_mpc_version(),
        learnt.pass[PASSES - 1].peak, LEARNT_PEAK, good ? "yes" : "NO");
    return good ? 0 : 1;
}
