/* Replays what mpc_stress.py recorded, with sanitizers on; follows the tracker in one file.
 *
 * File: for every step what it does (1: begin anew at an angle, 2: take new parameters), then the
 * measurement and the steering that came out. Prints the largest difference and the failures. */
#include <stdio.h>
#include <string.h>

static mpc_params params;
static mpc_state state;
static mpc_work work;
static mpc_input input;

int main(int argc, char *argv[])
{
    FILE *file = (argc == 2) ? fopen(argv[1], "rb") : NULL;
    double head[3], largest = 0.0; /* what it does, angle, steering that was recorded */
    long steps = 0, failures = 0;
    if (file == NULL) return 2;
    (void)mpc_init(&state);
    while (fread(head, sizeof head, 1, file) == 1) {
        double steering, difference;
        if ((head[0] == 2.0) && (fread(&params, sizeof params, 1, file) != 1)) return 2;
        if (head[0] > 0.0) (void)mpc_reset(&state, &params, head[1]);
        if (fread(&input, sizeof input, 1, file) != 1) return 2;
        failures += mpc_step(&state, &params, &work, &input, &steering) != MPC_OK;
        difference = fabs(steering - head[2]);
        largest = (difference <= largest) ? largest : difference; /* NaN too */
        steps++;
    }
    (void)fclose(file);
    printf("%ld %ld %.17g\n", steps, failures, largest);
    return 0;
}
