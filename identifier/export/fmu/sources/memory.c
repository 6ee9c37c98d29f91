/* See memory.h. */
#include "memory.h"

#include <math.h>
#include <string.h>

#ifdef __FAST_MATH__
#error "fast math removes the guards against numbers that are not finite"
#endif

/* A sample is due this fraction of a sampling interval early, so that the rounding of a master's
   clock neither takes it twice nor leaves it out: a million additions err by less. */
static const double EARLY = 1e-3;
static const double FARTHEST = 9e15; /* samples that a double counts one by one */

void MODEL(start)(Memory *memory) {
  memset(memory, 0, sizeof *memory);
  memory->adaptation = 1;
  memcpy(memory->carry, MODEL(carry_start), sizeof memory->carry);
}

static int finite_all(const double *values, int count) {
  int i;
  for (i = 0; i < count; ++i)
    if (!isfinite(values[i])) return 0;
  return 1;
}

/* One sample: on success the carried values move on, else they stay. */
static void take_sample(Memory *memory) {
  double next[MODEL_CARRY], force[FORCES], first[INPUTS];
  const double *input = memory->input;
  if (!finite_all(input, INPUTS)) {
    memory->status = STATUS_BAD_INPUT;
    return;
  }
  if (MODEL_RESTS_FIRST && memory->samples == 0) {
    memcpy(first, input, sizeof first);
    first[0] = 0.0; /* standing, the observer takes the measurement */
    MODEL(kernel)(memory->carry, first, next, force);
    if (finite_all(next, MODEL_CARRY)) memcpy(memory->carry, next, sizeof next);
  }
  MODEL(kernel)(memory->carry, input, next, force);
  if (!finite_all(next, MODEL_CARRY) || !finite_all(force, FORCES)) {
    memory->status = STATUS_NOT_FINITE;
    return;
  }
  if (!memory->adaptation) MODEL(keep_learnt)(memory->carry, next);
  memcpy(memory->carry, next, sizeof next);
  memcpy(memory->force, force, sizeof force);
  memory->status = input[0] < MODEL_MIN_SPEED ? STATUS_BELOW_MIN_SPEED : STATUS_RUNNING;
}

int MODEL(advance)(Memory *memory, double end_time) {
  const double elapsed = (end_time - memory->start_time) / MODEL_DT;
  int64_t due;
  if (!(fabs(elapsed) < FARTHEST)) return 1;
  due = (int64_t)ceil(elapsed - EARLY);
  for (; memory->samples < due; ++memory->samples) take_sample(memory);
  memory->time = end_time;
  return 0;
}

int MODEL(get_real)(const Memory *memory, unsigned int reference, double *value) {
  if (reference == VR_TIME)
    *value = memory->time;
  else if (reference >= VR_INPUT && reference < VR_INPUT + INPUTS)
    *value = memory->input[reference - VR_INPUT];
  else if (reference >= VR_FORCE && reference < VR_FORCE + FORCES)
    *value = memory->force[reference - VR_FORCE];
  else if (reference == VR_SAMPLE_TIME)
    *value = MODEL_DT;
  else if (reference == VR_MIN_SPEED)
    *value = MODEL_MIN_SPEED;
  else
    return 1;
  return 0;
}

int MODEL(set_real)(Memory *memory, unsigned int reference, double value) {
  if (reference < VR_INPUT || reference >= VR_INPUT + INPUTS) return 1;
  memory->input[reference - VR_INPUT] = value;
  return 0;
}

int MODEL(get_integer)(const Memory *memory, unsigned int reference, int32_t *value) {
  if (reference == VR_STATUS)
    *value = memory->status;
  else if (reference == VR_SAMPLES) /* an Int32 for masters; the count itself goes on */
    *value = memory->samples > INT32_MAX ? INT32_MAX : (int32_t)memory->samples;
  else
    return 1;
  return 0;
}

int MODEL(get_boolean)(const Memory *memory, unsigned int reference, int *value) {
  if (reference != VR_ADAPTATION) return 1;
  *value = memory->adaptation;
  return 0;
}

int MODEL(set_boolean)(Memory *memory, unsigned int reference, int value) {
  if (reference != VR_ADAPTATION) return 1;
  memory->adaptation = value != 0;
  return 0;
}
