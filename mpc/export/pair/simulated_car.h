/* A car that is neither what the identifier nor what the tracker believes in: for the example. */
#ifndef TIREID_SIMULATED_CAR_H
#define TIREID_SIMULATED_CAR_H

typedef struct {
    double mass;      /* kg */
    double inertia;   /* yaw [kg m^2] */
    double l[2];      /* from the center of mass to the axles [m] */
    double friction;  /* peak of force over load [-] */
    double stiffness; /* slope of force over load [1/rad] */
    double lag;       /* relaxation length [m] */
    double actuator;  /* lag of the steering [s] */
} simulated_car_numbers;

typedef struct {
    double s;        /* way along the road [m] */
    double e_y;      /* left of its center line [m] */
    double e_psi;    /* heading against it [rad] */
    double v_x;      /* m/s, held */
    double v_y;      /* m/s */
    double r;        /* rad/s */
    double delta;    /* angle of the front wheels now [rad] */
    double slip[2];  /* lagged, front and rear [rad] */
    double force[2]; /* of the axles, frame of the body [N] */
} simulated_car;

/* Go on for a time dt [s] with a command of the steering [rad]. */
void simulated_car_advance(
    simulated_car *car, const simulated_car_numbers *numbers, double command, double dt);

#endif
