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

/* The stage from x[] with input u; its c is x_next itself. */
void tireid_mpc_linearize(const tireid_mpc_params *params, const tireid_mpc_real *q,
    const tireid_mpc_real *x, tireid_mpc_real u, tireid_mpc_real kappa, tireid_mpc_real v_x,
    tireid_mpc_stage *stage);

/* Cost and slip at the end. */
void tireid_mpc_linearize_end(const tireid_mpc_params *params, const tireid_mpc_real *q,
    const tireid_mpc_real *x, tireid_mpc_real kappa, tireid_mpc_real v_x, tireid_mpc_stage *stage);

/* Where x[] is after a time dt [s] without an input. */
void tireid_mpc_predict(const tireid_mpc_params *params, const tireid_mpc_real *x,
    tireid_mpc_real kappa, tireid_mpc_real v_x, tireid_mpc_real dt, tireid_mpc_real *x_next);

#ifdef __cplusplus
}
#endif

#endif
