/* The identified tire, for the prediction of the tracker. */
#ifndef TIREID_HANDOVER_H
#define TIREID_HANDOVER_H

#include "tireid.h"
#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Move the tire in `params`, and the slip that is of use on it, a share of the way, 0 to 1, to the
 * identified one; call it between two steps. Small shares, say 0.05 a period, let the plan move without
 * a jump.
 *
 * False, and nothing changed, where that is no tire: a number that is not finite, an axle that could
 * push with more than the identifier's max_force, a curve whose force does not rise with slip. Whether
 * the excitation was sufficient, and whether it explains the last seconds better than the tire in use,
 * is for the caller to judge. */
bool tireid_handover(
    const tireid_weights *learnt, tireid_mpc_params *params, tireid_mpc_real share);

#ifdef __cplusplus
}
#endif

#endif
