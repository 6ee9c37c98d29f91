/* Inside of the tracker: not for users. Newton steps of the interior point and of active sets. */
#ifndef TIREID_MPC_RICCATI_H
#define TIREID_MPC_RICCATI_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a stage has: its best input, or that of a bound. */
#define TIREID_MPC_FREE 0U
#define TIREID_MPC_RATE 1U
#define TIREID_MPC_ANGLE 2U

/* Backward from stage `last`, for weights of the rows and what is held: feedback of each stage. Behind
 * `last` all must be as it was. False where not convex. */
bool tireid_mpc_factorize(tireid_mpc_work *work, tireid_mpc_real R, uint32_t last);

/* Backward from stage `last`, for slopes of the rows: gradients, and what of du is not feedback. */
void tireid_mpc_backward(tireid_mpc_work *work, tireid_mpc_real R, uint32_t last);

/* Forward from dx[0]: dx, du and what the rows reach. */
void tireid_mpc_forward(tireid_mpc_work *work);

/* Gradient of the cost by the input of stage k, at du: zero but where the stage is held. */
tireid_mpc_real tireid_mpc_pull(const tireid_mpc_work *work, uint32_t k);

#ifdef __cplusplus
}
#endif

#endif
