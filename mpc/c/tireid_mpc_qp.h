/* Inside of the tracker: not for users. One quadratic program of the tracker and its solution. */
#ifndef TIREID_MPC_QP_H
#define TIREID_MPC_QP_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Minimize sum 1/2 x'H x + h'x + 1/2 R u^2 + g u over the stages and the end, where
 * x[k+1] = A x[k] + B u[k] + c, x[0] = dx[0], and rows of bounds |value + row x| <= 1 hold: u and the
 * steering angle hard; deviation and slip angles soft, at the cost 1/2 s^2 / regular of breaking
 * one by s. Everything is the difference from the plan that was linearized at.
 *
 * Return what became of it, with du, dx and the count of iterations in `work`. */
tireid_mpc_status tireid_mpc_qp(tireid_mpc_work *work, const tireid_mpc_params *params);

/* What comes before the first set is tried, anew of the first stages alone.   plan: its inputs. */
void tireid_mpc_prepare_qp(tireid_mpc_work *work, const tireid_mpc_params *params,
    const tireid_mpc_real *plan, uint32_t stages);

#ifdef __cplusplus
}
#endif

#endif
