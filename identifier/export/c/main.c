/* Reads a recording, writes the forces that are identified.
 *
 *     tireid_example log.csv > forces.csv
 *
 * The log is CSV with a header and, in any order, the columns t [s], vx, vy [m/s], r [rad/s],
 * delta_f [rad], where the step reads it ay [m/s^2] and, where there is one, delta_r [rad]; one row
 * each TIREID_SAMPLE_TIME. Where v_y is an output, vy may be left out: v_y stands by the forces.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tireid.h"

#define LINE 4096
#define COLUMNS 64

enum { T, V_X, V_Y, R, DELTA_F, DELTA_R, A_Y, SIGNALS };

typedef struct {
    const char *name;
    bool needed;
} signal;

static const signal signals[SIGNALS] = {
    { "t", true },
    { "vx", true },
    { "vy", !TIREID_TELLS_V_Y },
    { "r", true },
    { "delta_f", true },
    { "delta_r", false },
    { "ay", TIREID_READS_A_Y },
};

/* Cut a line at its commas; return the number of pieces. */
static int split(char *line, char *piece[COLUMNS])
{
    int count = 0;
    char *at = line;
    line[strcspn(line, "\r\n")] = '\0';
    while ((at != NULL) && (count < COLUMNS)) {
        piece[count] = at;
        count++;
        at = strchr(at, ',');
        if (at != NULL) {
            *at = '\0';
            at++;
        }
    }
    return count;
}

/* Find the columns by their names; -1 where there is none. */
static int find_columns(char *header, int column[SIGNALS])
{
    char *piece[COLUMNS];
    const int count = split(header, piece);
    int i;
    int k;
    for (i = 0; i < SIGNALS; i++) {
        column[i] = -1;
        for (k = 0; k < count; k++) {
            if (strcmp(piece[k], signals[i].name) == 0) {
                column[i] = k;
            }
        }
        if (signals[i].needed && (column[i] < 0)) {
            fprintf(stderr, "tireid_example: the log has no column %s\n", signals[i].name);
            return 0;
        }
    }
    return 1;
}

/* Read a number; in place of a column that the log has not another, a cell without one is NaN. */
static double number(char *piece[COLUMNS], int count, int column, double absent)
{
    double value = absent;
    if (column >= 0) {
        char *end = NULL;
        value = strtod((column < count) ? piece[column] : "", &end);
        if ((column >= count) || (end == piece[column])) {
            value = strtod("nan", NULL);
        }
    }
    return value;
}

#if TIREID_TELLS_V_Y
static void print_side_slip(const tireid_state *state)
{
    tireid_output output;
    (void)tireid_get_output(state, &output);
    printf("%.9g,", (double)output.v_y);
#if TIREID_TELLS_V_Y > 1
    printf("%.9g,", (double)output.v_y_sd);
#endif
#if TIREID_TELLS_V_Y > 2
    printf("%d,", (output.side_slip_observable > 0) ? 1 : 0);
#endif
}
#endif

#ifdef TIREID_TELLS_BAND
static void print_band(const tireid_state *state)
{
    tireid_output output;
    (void)tireid_get_output(state, &output);
    printf("%.9g,%.9g,", (double)output.half_band[0], (double)output.half_band[1]);
}
#endif

int main(int argc, char *argv[])
{
    static char line[LINE];
    int column[SIGNALS];
    tireid_state state;
    tireid_params params;
    FILE *log;
    if (argc != 2) {
        fprintf(stderr, "usage: %s log.csv > forces.csv\n", argv[0]);
        return 2;
    }
    log = fopen(argv[1], "r");
    if (log == NULL) {
        fprintf(stderr, "%s: cannot be read\n", argv[1]);
        return 2;
    }
    if ((fgets(line, LINE, log) == NULL) || !find_columns(line, column)) {
        (void)fclose(log);
        return 2;
    }
    (void)tireid_default_params(&params);
    (void)tireid_init(&state);
#ifdef TIREID_TELLS_BAND
    printf("t,Fyf,Fyr,Fyf_half_band,Fyr_half_band,status\n");
#else
    printf("t,Fyf,Fyr,%s%s%sstatus\n", (TIREID_TELLS_V_Y > 0) ? "vy," : "",
        (TIREID_TELLS_V_Y > 1) ? "vy_sd," : "",
        (TIREID_TELLS_V_Y > 2) ? "side_slip_observable," : "");
#endif
    while (fgets(line, LINE, log) != NULL) {
        char *piece[COLUMNS];
        const int count = split(line, piece);
        tireid_input input;
        tireid_real force[2];
        tireid_status status;
        input.v_x = (tireid_real)number(piece, count, column[V_X], 0.0);
        input.v_y = (tireid_real)number(piece, count, column[V_Y], (double)NAN);
        input.r = (tireid_real)number(piece, count, column[R], 0.0);
        input.delta_f = (tireid_real)number(piece, count, column[DELTA_F], 0.0);
        input.delta_r = (tireid_real)number(piece, count, column[DELTA_R], 0.0);
#if TIREID_READS_A_Y
        input.a_y = (tireid_real)number(piece, count, column[A_Y], (double)NAN);
#endif
        status = tireid_step(&state, &params, &input);
        (void)tireid_get_forces(&state, force);
        printf("%.6f,%.9g,%.9g,", number(piece, count, column[T], 0.0), (double)force[0],
            (double)force[1]);
#ifdef TIREID_TELLS_BAND
        print_band(&state);
#endif
#if TIREID_TELLS_V_Y
        print_side_slip(&state);
#endif
        printf("%d\n", (int)status);
    }
    (void)fclose(log);
    fprintf(stderr, "%s; faults: %lu\n", tireid_version(), (unsigned long)state.faults);
    return 0;
}
