/* Inside of the tracker: not for users. */
#ifndef TIREID_MPC_ITERATION_H
#define TIREID_MPC_ITERATION_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* No plan: nothing moves. */
void tireid_mpc_clear(tireid_mpc_state *state);

/* Whether a state is where the prediction holds. */
bool tireid_mpc_on_map(const tireid_mpc_params *params, const tireid_mpc_real *x);

/* The plan, a time later: between its states, and its last input goes on. */
void tireid_mpc_shift(tireid_mpc_state *state, const tireid_mpc_params *params);

/* Linearize along the plan from x0 on a road, and do all of the solution that x0 does not enter. */
void tireid_mpc_prepare_from(tireid_mpc_state *state, const tireid_mpc_params *params,
    tireid_mpc_work *work, const tireid_mpc_real *x0, const tireid_mpc_real *kappa,
    const tireid_mpc_real *v_x);

/* A plan without a solution: from `x` to the path, on which the car rolls without slip. Nothing
 * moves where that is not finite. */
void tireid_mpc_guess(tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_real *x, const tireid_mpc_real *kappa, const tireid_mpc_real *v_x);

#ifdef __cplusplus
}
#endif

#endif
