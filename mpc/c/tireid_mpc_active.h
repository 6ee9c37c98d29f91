/* Inside of the tracker: not for users. A quadratic program by sets of active rows. */
#ifndef TIREID_MPC_ACTIVE_H
#define TIREID_MPC_ACTIVE_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Begin with the rows that are at their limits, or beyond, along the plan, in the first stages. */
void tireid_mpc_begin_set(tireid_mpc_work *work, tireid_mpc_real tolerance, uint32_t stages);

/* Take the set in `active` of the stages up to `last` into the program, and go backward. Behind them
 * all must be as it was. False where not convex. */
bool tireid_mpc_prepare_set(tireid_mpc_work *work, tireid_mpc_real R, uint32_t last);

/* Solve what `tireid_mpc_qp` states, beginning with the set that is prepared. OK: solved to rounding;
 * ITERATION_LIMIT: it is not, and needs another method. */
tireid_mpc_status tireid_mpc_active_set(tireid_mpc_work *work, const tireid_mpc_params *params);

#ifdef __cplusplus
}
#endif

#endif
