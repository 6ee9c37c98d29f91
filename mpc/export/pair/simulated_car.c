/* Single track with tires that saturate and lag, and a steering that lags. */
#include "simulated_car.h"

#include <math.h>

#include "lane_changes.h"

#define GRAVITY 9.81
#define SHAPE 1.5 /* of the tire's curve: past its peak the force falls */
#define SUBSTEPS 10

/* Force over load of a slip: mu sin(C atan(B slip)). */
static double curve(const simulated_car_numbers *numbers, double slip)
{
    const double B = numbers->stiffness / (SHAPE * numbers->friction);
    return numbers->friction * sin(SHAPE * atan(B * slip));
}

static void substep(
    simulated_car *car, const simulated_car_numbers *numbers, double command, double dt)
{
    const double *l = numbers->l;
    const double kappa = lane_changes_curvature(car->s);
    const double v_x = car->v_x;
    const double slip[2] = { car->delta - atan((car->v_y + (l[0] * car->r)) / v_x),
        -atan((car->v_y - (l[1] * car->r)) / v_x) };
    const double s_dot =
        ((v_x * cos(car->e_psi)) - (car->v_y * sin(car->e_psi))) / (1.0 - (kappa * car->e_y));
    const double e_y_dot = (v_x * sin(car->e_psi)) + (car->v_y * cos(car->e_psi));
    int i;
    for (i = 0; i < 2; i++) {
        const double load = numbers->mass * GRAVITY * l[1 - i] / (l[0] + l[1]);
        car->slip[i] += dt * (v_x / numbers->lag) * (slip[i] - car->slip[i]);
        car->force[i] = load * curve(numbers, car->slip[i]);
    }
    car->force[0] *= cos(car->delta);
    car->s += dt * s_dot;
    car->e_y += dt * e_y_dot;
    car->e_psi += dt * (car->r - (kappa * s_dot));
    car->v_y += dt * (((car->force[0] + car->force[1]) / numbers->mass) - (v_x * car->r));
    car->r += dt * ((l[0] * car->force[0]) - (l[1] * car->force[1])) / numbers->inertia;
    car->delta += dt * (command - car->delta) / numbers->actuator;
}

void simulated_car_advance(
    simulated_car *car, const simulated_car_numbers *numbers, double command, double dt)
{
    int k;
    for (k = 0; k < SUBSTEPS; k++) {
        substep(car, numbers, command, dt / SUBSTEPS);
    }
}
