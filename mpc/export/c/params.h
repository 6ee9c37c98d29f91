/* The numbers that @name@ was exported with, and guards for others; see @name@.h. */
#ifndef @NAME@_PARAMS_H
#define @NAME@_PARAMS_H

#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

/* @about_numbers@ */
@name@_status @name@_default_params(@name@_params *params);

/* Whether all numbers are finite, and positive where they must be. */
bool @name@_accepts(const @name@_params *params);

/* Go on with other weights of the tire, between two steps; refused with @NAME@_NOT_FINITE, and
 * nothing changed, where one is not finite. */
@name@_status @name@_set_weights(@name@_params *params,
    const @name@_real weights[@NAME@_WEIGHTS]);

#ifdef __cplusplus
}
#endif

#endif
