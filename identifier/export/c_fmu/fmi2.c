/* The interface of FMI 2.0 for Co-Simulation. What it computes is in memory.c and the component. */
#include "fmi2Functions.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"

typedef struct {
  Memory now;
  int running; /* initialization is over, the run is not */
  char *name;
  fmi2CallbackFunctions callbacks;
} Instance;

/* A saved state on disk begins with the token, so that it is not given to another model. */
static const char TOKEN[] = MODEL_TOKEN;

static fmi2Status fail(const fmi2CallbackFunctions *callbacks, fmi2String name,
                       const char *message) {
  if (callbacks && callbacks->logger)
    callbacks->logger(callbacks->componentEnvironment, name, fmi2Error, "logStatusError", "%s",
                      message);
  return fmi2Error;
}

static fmi2Status refuse(fmi2Component c, const char *message) {
  Instance *instance = c;
  return instance ? fail(&instance->callbacks, instance->name, message) : fmi2Error;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[]) {
  (void)loggingOn;
  (void)nCategories;
  (void)categories;
  return c ? fmi2OK : fmi2Error;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn) {
  Instance *instance;
  size_t length;
  (void)fmuResourceLocation;
  (void)visible;
  (void)loggingOn;
  if (!instanceName || !*instanceName) {
    fail(functions, "?", "an instance needs a name");
    return NULL;
  }
  if (fmuType != fmi2CoSimulation) {
    fail(functions, instanceName, "this FMU is for Co-Simulation only");
    return NULL;
  }
  if (!fmuGUID || strcmp(fmuGUID, TOKEN) != 0) {
    fail(functions, instanceName, "the GUID is not that of this FMU, " MODEL_TOKEN);
    return NULL;
  }
  length = strlen(instanceName) + 1;
  instance = calloc(1, sizeof *instance);
  if (!instance || !(instance->name = malloc(length))) {
    free(instance);
    fail(functions, instanceName, "out of memory");
    return NULL;
  }
  memcpy(instance->name, instanceName, length);
  if (functions) instance->callbacks = *functions;
  MODEL(fmu_start)(&instance->now);
  return instance;
}

void fmi2FreeInstance(fmi2Component c) {
  Instance *instance = c;
  if (instance) free(instance->name);
  free(instance);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
  Instance *instance = c;
  (void)toleranceDefined;
  (void)tolerance;
  (void)stopTimeDefined;
  (void)stopTime;
  if (!instance || instance->running) return refuse(c, "the experiment is set up too late");
  instance->now.start_time = startTime;
  instance->now.time = startTime;
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  Instance *instance = c;
  return instance && !instance->running ? fmi2OK : refuse(c, "it is already initialized");
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Instance *instance = c;
  if (!instance || instance->running) return refuse(c, "it is already initialized");
  instance->running = 1;
  return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
  Instance *instance = c;
  if (!instance) return fmi2Error;
  instance->running = 0;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  Instance *instance = c;
  if (!instance) return fmi2Error;
  instance->running = 0;
  MODEL(fmu_start)(&instance->now);
  return fmi2OK;
}

/* Hands all values to one function of memory.h, declared for one value. */
#define EACH(function, value)                                         \
  Instance *instance = c;                                             \
  size_t i;                                                           \
  if (!instance) return fmi2Error;                                    \
  for (i = 0; i < nvr; ++i)                                           \
    if (MODEL(function)(&instance->now, vr[i], value))                \
      return refuse(c, "no variable of this type has the reference"); \
  return fmi2OK

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
  EACH(fmu_get_real, &value[i]);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
  EACH(fmu_get_integer, &value[i]);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
  EACH(fmu_get_boolean, &value[i]);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
  EACH(fmu_set_real, value[i]);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
  EACH(fmu_set_boolean, value[i]);
}

/* Of these there are none: right only where none is asked for. */
#define NO_VARIABLES(function, type)                                                              \
  fmi2Status function(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, type value[]) { \
    (void)vr;                                                                                     \
    (void)value;                                                                                  \
    return nvr == 0 ? fmi2OK : refuse(c, "no variable of this type can be read or set");          \
  }
NO_VARIABLES(fmi2GetString, fmi2String)
NO_VARIABLES(fmi2SetString, const fmi2String)
NO_VARIABLES(fmi2SetInteger, const fmi2Integer)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  Instance *instance = c;
  if (!instance || !FMUstate) return refuse(c, "there is no place for the state");
  if (!*FMUstate && !(*FMUstate = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*FMUstate, &instance->now, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
  Instance *instance = c;
  if (!instance || !FMUstate) return refuse(c, "there is no state");
  memcpy(&instance->now, FMUstate, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
  if (!c) return fmi2Error;
  if (FMUstate) {
    free(*FMUstate);
    *FMUstate = NULL;
  }
  return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
  (void)FMUstate;
  if (!c || !size) return refuse(c, "there is no place for the size");
  *size = sizeof TOKEN + sizeof(Memory);
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                 size_t size) {
  if (!c || !FMUstate || !serializedState || size < sizeof TOKEN + sizeof(Memory))
    return refuse(c, "there is no place for the state");
  memcpy(serializedState, TOKEN, sizeof TOKEN);
  memcpy(serializedState + sizeof TOKEN, FMUstate, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                   fmi2FMUstate *FMUstate) {
  if (!c || !FMUstate || !serializedState || size != sizeof TOKEN + sizeof(Memory) ||
      memcmp(serializedState, TOKEN, sizeof TOKEN) != 0)
    return refuse(c, "this is not a saved state of this FMU");
  if (!*FMUstate && !(*FMUstate = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*FMUstate, serializedState + sizeof TOKEN, sizeof(Memory));
  return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  Instance *instance = c;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance || !instance->running) return refuse(c, "a step before initialization");
  if (!(communicationStepSize >= 0.0)) return refuse(c, "the step size must not be negative");
  if (MODEL(fmu_advance)(&instance->now, currentCommunicationPoint + communicationStepSize))
    return refuse(c, "the communication point is no time");
  return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(c, "steps are never pending"); }

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
  Instance *instance = c;
  if (!instance || s != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = instance->now.time;
  return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
  if (!c || s != fmi2Terminated) return fmi2Discard;
  *value = fmi2False; /* it never ends by itself */
  return fmi2OK;
}

/* Steps are done when fmi2DoStep returns: there is nothing else to ask. */
#define NO_STATUS(function, type)                                             \
  fmi2Status function(fmi2Component c, const fmi2StatusKind s, type *value) { \
    (void)c;                                                                  \
    (void)s;                                                                  \
    (void)value;                                                              \
    return fmi2Discard;                                                       \
  }
NO_STATUS(fmi2GetStatus, fmi2Status)
NO_STATUS(fmi2GetIntegerStatus, fmi2Integer)
NO_STATUS(fmi2GetStringStatus, fmi2String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                        size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
  (void)vUnknown_ref;
  (void)nUnknown;
  (void)vKnown_ref;
  (void)nKnown;
  (void)dvKnown;
  (void)dvUnknown;
  return refuse(c, "derivatives are not provided");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
  (void)vr;
  (void)order;
  (void)value;
  return nvr == 0 ? fmi2OK : refuse(c, "inputs are held between steps, not interpolated");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
  (void)vr;
  (void)order;
  (void)value;
  return nvr == 0 ? fmi2OK : refuse(c, "derivatives of outputs are not provided");
}
