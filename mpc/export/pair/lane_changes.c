/* Lane changes as quintics: their curvature is the second derivative of the offset. */
#include "lane_changes.h"

#include <math.h>

#define LANE 3.5     /* m to the left and back */
#define LENGTH 34.0  /* m, of a lane change */
#define FIRST 40.0   /* m, where it begins */
#define SECOND 100.0 /* m, where the way back begins */

static double lane_change(double z)
{
    const double inside = ((z > 0.0) && (z < 1.0)) ? 1.0 : 0.0;
    return inside * (LANE / (LENGTH * LENGTH)) * 60.0 * z * (1.0 - z) * (1.0 - (2.0 * z));
}

double lane_changes_curvature(double s)
{
    const double at = s - (LANE_CHANGES_PASS * floor(s / LANE_CHANGES_PASS));
    return lane_change((at - FIRST) / LENGTH) - lane_change((at - SECOND) / LENGTH);
}
