/* Inside of the tracker: not for users. */
#ifndef TIREID_MPC_NUMBERS_H
#define TIREID_MPC_NUMBERS_H

#include "tireid_mpc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether x is a number: the difference of infinities, and of NaN, is not zero. */
bool tireid_mpc_finite(tireid_mpc_real x);

/* Whether |x| <= limit, which NaN is not. */
bool tireid_mpc_within(tireid_mpc_real x, tireid_mpc_real limit);

/* x, not beyond +-limit. */
tireid_mpc_real tireid_mpc_clipped(tireid_mpc_real x, tireid_mpc_real limit);

/* Whether numbers may be carried: finite, and far from what would overflow. */
bool tireid_mpc_carriable(const tireid_mpc_real *x, uint32_t n);

#ifdef __cplusplus
}
#endif

#endif
