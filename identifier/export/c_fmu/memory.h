/* What one instance remembers, and how it moves on; the same for FMI 2 and FMI 3.

   Samples are taken at start_time + k * MODEL_DT, k = 0, 1, ...; k is counted as an integer. A
   communication step from t to t + h takes every sample in [t, t + h), with the inputs that were
   set before it; outputs then are those of the last sample taken. */
#ifndef MEMORY_H
#define MEMORY_H

#include <stdint.h>

#include "model.h"

enum { INPUTS = 5, FORCES = 2 };

/* Value references; the order of the inputs is that of the array, in which a_y is the last. */
enum {
  VR_TIME = 0,
  VR_INPUT = 1,
  VR_FORCE = 6,
  VR_STATUS = 8,
  VR_SAMPLES = 9,
  VR_ADAPTATION = 10,
  VR_SAMPLE_TIME = 11,
  VR_MIN_SPEED = 12,
  VR_A_Y = 13,
  VR_V_Y = 14, /* output */
  VR_V_Y_SD = 15,
  VR_OBSERVABLE = 16,
  VR_HALF_BAND = 17 /* of the front axle, then of the rear one */
};

/* Plain numbers: a copy of this is a saved state. */
typedef struct {
  double time;
  double start_time;
  double input[INPUTS + 1]; /* v_x, v_y, r, delta_f, delta_r, a_y */
  int64_t samples;
  int32_t status; /* of the component's last step */
  MODEL(params) params;
  MODEL(state) state;
} Memory;

/* All values as before the first sample. */
void MODEL(fmu_start)(Memory *memory);

/* Takes all samples before a time. Returns 0, or 1 where the time is no number or too far away. */
int MODEL(fmu_advance)(Memory *memory, double end_time);

/* Each returns 0, or 1 where there is no such variable. */
int MODEL(fmu_get_real)(const Memory *memory, unsigned int reference, double *value);
int MODEL(fmu_set_real)(Memory *memory, unsigned int reference, double value);
int MODEL(fmu_get_integer)(const Memory *memory, unsigned int reference, int32_t *value);
int MODEL(fmu_get_boolean)(const Memory *memory, unsigned int reference, int *value);
int MODEL(fmu_set_boolean)(Memory *memory, unsigned int reference, int value);

#endif
