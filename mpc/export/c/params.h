/* The numbers that @name@ was exported with, and guards for others; see @name@.h. */
#ifndef @NAME@_PARAMS_H
#define @NAME@_PARAMS_H

#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

/* @about_numbers@ */
@name@_status @name@_default_params(@name@_params *params);

/* Whether all numbers are within 1e12, and 1e-12 or more where they must be positive; whether delay,
 * period and stage_time go together, and the speeds of the fall-back rise. */
bool @name@_accepts(const @name@_params *params);

/* Go on with other weights of the tire, between two steps; refused with @NAME@_NOT_FINITE, and
 * nothing changed, where one is not finite or beyond 1e12. */
@name@_status @name@_set_weights(@name@_params *params,
    const @name@_real weights[@NAME@_WEIGHTS]);

#ifdef __cplusplus
}
#endif

#endif
