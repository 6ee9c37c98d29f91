/* Which component the FMU holds. */
#ifndef MODEL_H
#define MODEL_H

#include "tireid.h"
#include "token.h"

/* All names begin with that of the component, for programs that hold several. */
#define MODEL(name) tireid_##name

#define MODEL_DT TIREID_SAMPLE_TIME
#define MODEL_MIN_SPEED TIREID_MIN_SPEED
#define MODEL_READS_A_Y TIREID_READS_A_Y
#define MODEL_TELLS_V_Y TIREID_TELLS_V_Y
#ifdef TIREID_TELLS_BAND
#define MODEL_TELLS_BAND TIREID_TELLS_BAND
#endif

#endif
