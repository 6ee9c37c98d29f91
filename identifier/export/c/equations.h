/* Inside of @name@: not for users. */
#ifndef @NAME@_EQUATIONS_H
#define @NAME@_EQUATIONS_H

#include <math.h>

#include "@name@.h"

#if @NAME@_SINGLE
#define @NAME@_C(x) x##F
#define @NAME@_PICK(x, y) x##F
#define @NAME@_SQRT(x) sqrtf(x)
#define @NAME@_FABS(x) fabsf(x)
#else
#define @NAME@_C(x) x
#define @NAME@_PICK(x, y) y
#define @NAME@_SQRT(x) sqrt(x)
#define @NAME@_FABS(x) fabs(x)
#endif

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
