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

@decided_prototypes@/* One step from `now` to `next`, which are not the same. */
void @name@_driving(const @name@_values *now, const @name@_input *in, @name@_values *next,
    @name@_output *out);

#ifdef __cplusplus
}
#endif

#endif
