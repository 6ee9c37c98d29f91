/* Inside of @name@: not for users. */
#ifndef @NAME@_ITERATION_H
#define @NAME@_ITERATION_H

#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Whether x is a number: the difference of infinities, and of NaN, is not zero. */
bool @name@_finite(@name@_real x);

/* Whether |x| <= limit, which NaN is not. */
bool @name@_within(@name@_real x, @name@_real limit);

/* x, not beyond +-limit. */
@name@_real @name@_clipped(@name@_real x, @name@_real limit);

/* Whether numbers may be carried: finite, and far from what would overflow. */
bool @name@_carriable(const @name@_real *x, uint32_t n);

/* No plan: nothing moves. */
void @name@_clear(@name@_state *state);

/* Whether a state is where the prediction holds. */
bool @name@_on_map(const @name@_params *params, const @name@_real *x);

/* The plan, a time later: between its states, and its last input goes on. */
void @name@_shift(@name@_state *state, const @name@_params *params);

/* A plan without a solution: from `x` to the path, on which the car rolls without slip. Nothing
 * moves where that is not finite. */
void @name@_guess(@name@_state *state, const @name@_params *params, const @name@_real *x,
    const @name@_real *kappa, const @name@_real *v_x);

#ifdef __cplusplus
}
#endif

#endif
