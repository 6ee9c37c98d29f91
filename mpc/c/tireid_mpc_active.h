/* Inside of the tracker: not for users. A quadratic program by sets of active rows. */
#ifndef TIREID_MPC_ACTIVE_H
#define TIREID_MPC_ACTIVE_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Begin with the rows that are at their limits, or beyond, along the way in the first stages; of a car
 * that is thrown about, with the rates that are at theirs in the plan. */
void tireid_mpc_begin_set(tireid_mpc_work *work, const tireid_mpc_params *params,
    const tireid_mpc_real *plan, uint32_t stages);

/* Take the set in `active` of the stages up to `last` into the program, and go backward. Behind them
 * all must be as it was. False where not convex. */
bool tireid_mpc_prepare_set(tireid_mpc_work *work, tireid_mpc_real R, uint32_t last);

/* Solve what `tireid_mpc_qp` states by at most so many sets, of which the first is prepared. OK: solved to
 * rounding; ITERATION_LIMIT: it is not, and needs another method. */
tireid_mpc_status tireid_mpc_active_set(
    tireid_mpc_work *work, const tireid_mpc_params *params, uint32_t most);

#ifdef __cplusplus
}
#endif

#endif
