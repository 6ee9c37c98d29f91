/* What is asked of a number before it is computed with. */
#include "tireid_mpc_numbers.h"

#include "tireid_mpc_equations.h"

#define MOST                                                                                       \
    TIREID_MPC_C(1e12) /* of a number that is carried: what is computed of it does not overflow */

#define real tireid_mpc_real

bool tireid_mpc_finite(real x)
{
    const real difference = x - x;
    return (difference <= TIREID_MPC_C(0.0)) && (difference >= TIREID_MPC_C(0.0));
}

real tireid_mpc_clipped(real x, real limit)
{
    const real low = (x > limit) ? limit : x;
    return (low < -limit) ? -limit : low;
}

bool tireid_mpc_within(real x, real limit)
{
    return (x <= limit) && (x >= -limit);
}

bool tireid_mpc_carriable(const real *x, uint32_t n)
{
    uint32_t beyond = 0U;
    uint32_t i;
    for (i = 0U; i < n; i++) {
        beyond += tireid_mpc_within(x[i], MOST) ? 0U : 1U;
    }
    return beyond == 0U;
}
