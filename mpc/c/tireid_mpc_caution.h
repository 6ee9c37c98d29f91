/* Inside of the tracker: not for users. */
#ifndef TIREID_MPC_CAUTION_H
#define TIREID_MPC_CAUTION_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Plan with the tire as it is told; what motion showed of its friction is forgotten. */
void tireid_mpc_trust(tireid_mpc_state *state);

/* Look at a measurement, with the wheels at an angle [rad], and find the grip to plan with; one that
 * is not `fit` interrupts what is followed. */
void tireid_mpc_watch(tireid_mpc_state *state, const tireid_mpc_params *params,
    const tireid_mpc_input *in, tireid_mpc_real wheels, bool fit);

/* How much of the soft limits the doubt of the forces leaves along the plan that is linearized. */
void tireid_mpc_tighten(
    const tireid_mpc_state *state, const tireid_mpc_params *params, tireid_mpc_work *work);

#ifdef __cplusplus
}
#endif

#endif
