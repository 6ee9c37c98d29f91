/* The road of the example: a double lane change after the other. */
#ifndef TIREID_LANE_CHANGES_H
#define TIREID_LANE_CHANGES_H

#define LANE_CHANGES_PASS 180.0 /* m from one double lane change to the next */

/* Curvature [1/m], positive to the left, after a way s [m]. */
double lane_changes_curvature(double s);

#endif
