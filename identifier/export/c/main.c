/* Reads a recording, writes the forces that are identified.
 *
 *     tireid_example log.csv > forces.csv
 *
 * The log is CSV with a header and, in any order, the columns t [s], vx, vy [m/s], r [rad/s],
 * delta_f [rad] and, where there is one, delta_r [rad]; one row each TIREID_SAMPLE_TIME.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tireid.h"

#define LINE 4096
#define COLUMNS 64
#define SIGNALS 6

static const char *const names[SIGNALS] = { "t", "vx", "vy", "r", "delta_f", "delta_r" };

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
            if (strcmp(piece[k], names[i]) == 0) {
                column[i] = k;
            }
        }
        if ((i < (SIGNALS - 1)) && (column[i] < 0)) {
            fprintf(stderr, "tireid_example: the log has no column %s\n", names[i]);
            return 0;
        }
    }
    return 1;
}

/* Read a number; a column that the log has not is zero, a cell without a number is NaN. */
static double number(char *piece[COLUMNS], int count, int column)
{
    double value = 0.0;
    if (column >= 0) {
        char *end = NULL;
        value = strtod((column < count) ? piece[column] : "", &end);
        if ((column >= count) || (end == piece[column])) {
            value = strtod("nan", NULL);
        }
    }
    return value;
}

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
    printf("t,Fyf,Fyr,status\n");
    while (fgets(line, LINE, log) != NULL) {
        char *piece[COLUMNS];
        const int count = split(line, piece);
        tireid_input input;
        tireid_real force[2];
        tireid_status status;
        input.v_x = (tireid_real)number(piece, count, column[1]);
        input.v_y = (tireid_real)number(piece, count, column[2]);
        input.r = (tireid_real)number(piece, count, column[3]);
        input.delta_f = (tireid_real)number(piece, count, column[4]);
        input.delta_r = (tireid_real)number(piece, count, column[5]);
        status = tireid_step(&state, &params, &input);
        (void)tireid_get_forces(&state, force);
        printf("%.6f,%.9g,%.9g,%d\n", number(piece, count, column[0]), (double)force[0],
            (double)force[1], (int)status);
    }
    (void)fclose(log);
    fprintf(stderr, "%s; faults: %lu\n", tireid_version(), (unsigned long)state.faults);
    return 0;
}
