/* Inside of @name@: not for users. */
#ifndef @NAME@_EQUATIONS_H
#define @NAME@_EQUATIONS_H

#include <math.h>

#include "@name@.h"

#if @NAME@_SINGLE
#define @NAME@_C(x) x##F
@macros_single@#else
#define @NAME@_C(x) x
@macros_double@#endif

#ifdef __cplusplus
extern "C" {
#endif

/* The stage from x[] with input u; its c is x_next itself. */
void @name@_linearize(const @name@_params *params, const @name@_real *q, const @name@_real *x,
    @name@_real u, @name@_real kappa, @name@_real v_x, @name@_stage *stage);

/* Cost and slip at the end. */
void @name@_linearize_end(const @name@_params *params, const @name@_real *q, const @name@_real *x,
    @name@_real kappa, @name@_real v_x, @name@_stage *stage);

/* Where x[] is after a time dt [s] without an input. */
void @name@_predict(const @name@_params *params, const @name@_real *x, @name@_real kappa,
    @name@_real v_x, @name@_real dt, @name@_real *x_next);

#ifdef __cplusplus
}
#endif

#endif
