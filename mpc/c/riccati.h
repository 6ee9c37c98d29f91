/* Inside of @name@: not for users. A Newton step of the interior point. */
#ifndef @NAME@_RICCATI_H
#define @NAME@_RICCATI_H

#include "@name@.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Backward, for weights of the rows: feedback of each stage. False where not convex. */
bool @name@_factorize(@name@_work *work, @name@_real R);

/* Backward and forward, for slopes of the rows: dx, du and what the rows reach. */
void @name@_sweep(@name@_work *work, @name@_real R);

#ifdef __cplusplus
}
#endif

#endif
