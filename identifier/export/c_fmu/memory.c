/* See memory.h. */
#include "memory.h"

#include <math.h>
#include <string.h>

/* A sample is due this fraction of a sampling interval early, so that the rounding of a master's
   clock neither takes it twice nor leaves it out: a million additions err by less. */
static const double EARLY = 1e-3;
static const double FARTHEST = 9e15; /* samples that a double counts one by one */

void MODEL(fmu_start)(Memory *memory) {
  memset(memory, 0, sizeof *memory);
  MODEL(default_params)(&memory->params);
  MODEL(init)(&memory->state);
#if MODEL_TELLS_V_Y
  memory->input[1] = (double)NAN; /* until it is set, nothing is measured */
#endif
#if MODEL_READS_A_Y
  memory->input[INPUTS] = (double)NAN;
#endif
}

/* Where an input stands in the array, -1 where the reference is of none. */
static int place_of(unsigned int reference) {
  int place = -1;
  if (reference >= VR_INPUT && reference < VR_INPUT + INPUTS) place = (int)reference - VR_INPUT;
#if MODEL_READS_A_Y
  if (reference == VR_A_Y) place = INPUTS;
#endif
  return place;
}

static void take_sample(Memory *memory) {
  MODEL(input) input;
  input.v_x = (MODEL(real))memory->input[0];
  input.v_y = (MODEL(real))memory->input[1];
  input.r = (MODEL(real))memory->input[2];
  input.delta_f = (MODEL(real))memory->input[3];
  input.delta_r = (MODEL(real))memory->input[4];
#if MODEL_READS_A_Y
  input.a_y = (MODEL(real))memory->input[INPUTS];
#endif
  memory->status = (int32_t)MODEL(step)(&memory->state, &memory->params, &input);
}

int MODEL(fmu_advance)(Memory *memory, double end_time) {
  const double elapsed = (end_time - memory->start_time) / MODEL_DT;
  int64_t due;
  if (!(fabs(elapsed) < FARTHEST)) return 1;
  due = (int64_t)ceil(elapsed - EARLY);
  for (; memory->samples < due; ++memory->samples) take_sample(memory);
  memory->time = end_time;
  return 0;
}

int MODEL(fmu_get_real)(const Memory *memory, unsigned int reference, double *value) {
  const int place = place_of(reference);
  if (reference == VR_TIME)
    *value = memory->time;
  else if (place >= 0)
    *value = memory->input[place];
  else if (reference >= VR_FORCE && reference < VR_FORCE + FORCES)
    *value = (double)memory->state.output.axle_force[reference - VR_FORCE];
  else if (reference == VR_SAMPLE_TIME)
    *value = MODEL_DT;
  else if (reference == VR_MIN_SPEED)
    *value = MODEL_MIN_SPEED;
#if MODEL_TELLS_V_Y
  else if (reference == VR_V_Y)
    *value = (double)memory->state.output.v_y;
#endif
#if MODEL_TELLS_V_Y > 1
  else if (reference == VR_V_Y_SD)
    *value = (double)memory->state.output.v_y_sd;
#endif
#ifdef MODEL_TELLS_BAND
  else if (reference >= VR_HALF_BAND && reference < VR_HALF_BAND + FORCES)
    *value = (double)memory->state.output.half_band[reference - VR_HALF_BAND];
#endif
  else
    return 1;
  return 0;
}

int MODEL(fmu_set_real)(Memory *memory, unsigned int reference, double value) {
  const int place = place_of(reference);
  if (place < 0) return 1;
  memory->input[place] = value;
  return 0;
}

int MODEL(fmu_get_integer)(const Memory *memory, unsigned int reference, int32_t *value) {
  if (reference == VR_STATUS)
    *value = memory->status;
  else if (reference == VR_SAMPLES) /* an Int32 for masters; the count itself goes on */
    *value = memory->samples > INT32_MAX ? INT32_MAX : (int32_t)memory->samples;
  else
    return 1;
  return 0;
}

int MODEL(fmu_get_boolean)(const Memory *memory, unsigned int reference, int *value) {
  if (reference == VR_ADAPTATION) *value = memory->state.adapts != 0;
#if MODEL_TELLS_V_Y > 2
  else if (reference == VR_OBSERVABLE)
    *value = memory->state.output.side_slip_observable > 0;
#endif
  else
    return 1;
  return 0;
}

int MODEL(fmu_set_boolean)(Memory *memory, unsigned int reference, int value) {
  if (reference != VR_ADAPTATION) return 1;
  memory->state.adapts = value != 0;
  return 0;
}
