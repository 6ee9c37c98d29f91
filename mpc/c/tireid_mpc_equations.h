/* Inside of the tracker: not for users. */
#ifndef TIREID_MPC_EQUATIONS_H
#define TIREID_MPC_EQUATIONS_H

#include "tireid_mpc.h"

#if TIREID_MPC_SINGLE
#define TIREID_MPC_C(x) x##F
#else
#define TIREID_MPC_C(x) x
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The stage from x[] with input u; its c is x_next itself. `grip` is friction over the one that the
 * weights have. */
void tireid_mpc_linearize(const tireid_mpc_params *params, const tireid_mpc_real *q,
    const tireid_mpc_real *x, tireid_mpc_real u, tireid_mpc_real kappa, tireid_mpc_real v_x,
    tireid_mpc_real grip, tireid_mpc_stage *stage);

/* Cost and slip at the end. */
void tireid_mpc_linearize_end(const tireid_mpc_params *params, const tireid_mpc_real *q,
    const tireid_mpc_real *x, tireid_mpc_real kappa, tireid_mpc_real v_x, tireid_mpc_stage *stage);

/* Where x[] is after a time dt [s] without an input. */
void tireid_mpc_predict(const tireid_mpc_params *params, const tireid_mpc_real *x,
    tireid_mpc_real kappa, tireid_mpc_real v_x, tireid_mpc_real dt, tireid_mpc_real grip,
    tireid_mpc_real *x_next);

/* Forces of the axles at x[] [N], kinematic slip [rad], and the lengths by which slip lags [m]. */
void tireid_mpc_axles(const tireid_mpc_params *params, const tireid_mpc_real *x,
    tireid_mpc_real v_x, tireid_mpc_real grip, tireid_mpc_real force[2], tireid_mpc_real slip[2],
    tireid_mpc_real length[2]);

#ifdef __cplusplus
}
#endif

#endif
