/* Inside of the tracker: not for users. A Newton step of the interior point. */
#ifndef TIREID_MPC_RICCATI_H
#define TIREID_MPC_RICCATI_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Backward, for weights of the rows: feedback of each stage. False where not convex. */
bool tireid_mpc_factorize(tireid_mpc_work *work, tireid_mpc_real R);

/* Backward and forward, for slopes of the rows: dx, du and what the rows reach. */
void tireid_mpc_sweep(tireid_mpc_work *work, tireid_mpc_real R);

#ifdef __cplusplus
}
#endif

#endif
