/* The numbers of the export, and guards for others; see tireid_mpc.h. */
#ifndef TIREID_MPC_PARAMS_H
#define TIREID_MPC_PARAMS_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Those of the export: its car, tire, period and delay. */
tireid_mpc_status tireid_mpc_default_params(tireid_mpc_params *params);

/* Whether all numbers are within 1e12, and 1e-12 or more where they must be positive; whether delay,
 * period and stage_time go together, and the speeds of the fall-back rise. */
bool tireid_mpc_accepts(const tireid_mpc_params *params);

/* Go on with other weights of the tire, between two steps; refused with TIREID_MPC_NOT_FINITE, and
 * nothing changed, where one is not finite or beyond 1e12. */
tireid_mpc_status tireid_mpc_set_weights(
    tireid_mpc_params *params, const tireid_mpc_real weights[TIREID_MPC_WEIGHTS]);

#ifdef __cplusplus
}
#endif

#endif
