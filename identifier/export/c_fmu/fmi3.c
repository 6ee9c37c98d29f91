/* The interface of FMI 3.0 for Co-Simulation. What it computes is in memory.c and the component. */
#include "fmi3Functions.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"

typedef struct {
  Memory now;
  int running; /* initialization is over, the run is not */
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} Instance;

/* A saved state on disk begins with the token, so that it is not given to another model. */
static const char TOKEN[] = MODEL_TOKEN;

static fmi3Status refuse(fmi3Instance c, const char *message) {
  Instance *instance = c;
  if (instance && instance->log)
    instance->log(instance->environment, fmi3Error, "logStatusError", message);
  return fmi3Error;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[]) {
  (void)loggingOn;
  (void)nCategories;
  (void)categories;
  return c ? fmi3OK : fmi3Error;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
  Instance *instance;
  const char *fault = NULL;
  (void)resourcePath;
  (void)visible;
  (void)loggingOn;
  (void)eventModeUsed;
  (void)earlyReturnAllowed;
  (void)requiredIntermediateVariables;
  (void)nRequiredIntermediateVariables;
  (void)intermediateUpdate;
  if (!instanceName || !*instanceName)
    fault = "an instance needs a name";
  else if (!instantiationToken || strcmp(instantiationToken, TOKEN) != 0)
    fault = "the instantiation token is not that of this FMU, " MODEL_TOKEN;
  instance = fault ? NULL : calloc(1, sizeof *instance);
  if (!instance) {
    if (logMessage)
      logMessage(instanceEnvironment, fmi3Error, "logStatusError", fault ? fault : "out of memory");
    return NULL;
  }
  instance->environment = instanceEnvironment;
  instance->log = logMessage;
  MODEL(fmu_start)(&instance->now);
  return instance;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
  Instance *instance = c;
  (void)toleranceDefined;
  (void)tolerance;
  (void)stopTimeDefined;
  (void)stopTime;
  if (!instance || instance->running) return refuse(c, "it is already initialized");
  instance->now.start_time = startTime;
  instance->now.time = startTime;
  return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
  Instance *instance = c;
  if (!instance || instance->running) return refuse(c, "it is already initialized");
  instance->running = 1;
  return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) {
  Instance *instance = c;
  if (!instance) return fmi3Error;
  instance->running = 0;
  return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance c) {
  Instance *instance = c;
  if (!instance) return fmi3Error;
  instance->running = 0;
  MODEL(fmu_start)(&instance->now);
  return fmi3OK;
}

/* Hands all values to one function of memory.h, declared for one value. */
#define EACH(function, value)                                                                    \
  Instance *instance = c;                                                                        \
  size_t i;                                                                                      \
  if (!instance || nValues != nValueReferences) return refuse(c, "each variable has one value"); \
  for (i = 0; i < nValues; ++i)                                                                  \
    if (function(&instance->now, valueReferences[i], value))                                     \
      return refuse(c, "no variable of this type has the reference");                            \
  return fmi3OK

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues) {
  EACH(MODEL(fmu_get_real), &values[i]);
}

fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Int32 values[], size_t nValues) {
  EACH(MODEL(fmu_get_integer), &values[i]);
}

/* A boolean is a bool here and an int in memory.h. */
static int get_bool(const Memory *memory, fmi3ValueReference reference, fmi3Boolean *value) {
  int number = 0;
  const int unknown = MODEL(fmu_get_boolean)(memory, reference, &number);
  *value = number != 0;
  return unknown;
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Boolean values[], size_t nValues) {
  EACH(get_bool, &values[i]);
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
  EACH(MODEL(fmu_set_real), values[i]);
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Boolean values[], size_t nValues) {
  EACH(MODEL(fmu_set_boolean), values[i]);
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *FMUState) {
  Instance *instance = c;
  if (!instance || !FMUState) return refuse(c, "there is no place for the state");
  if (!*FMUState && !(*FMUState = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*FMUState, &instance->now, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState FMUState) {
  Instance *instance = c;
  if (!instance || !FMUState) return refuse(c, "there is no state");
  memcpy(&instance->now, FMUState, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *FMUState) {
  if (!c) return fmi3Error;
  if (FMUState) {
    free(*FMUState);
    *FMUState = NULL;
  }
  return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState FMUState, size_t *size) {
  (void)FMUState;
  if (!c || !size) return refuse(c, "there is no place for the size");
  *size = sizeof TOKEN + sizeof(Memory);
  return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                 size_t size) {
  if (!c || !FMUState || !serializedState || size < sizeof TOKEN + sizeof(Memory))
    return refuse(c, "there is no place for the state");
  memcpy(serializedState, TOKEN, sizeof TOKEN);
  memcpy(serializedState + sizeof TOKEN, FMUState, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte serializedState[], size_t size,
                                   fmi3FMUState *FMUState) {
  if (!c || !FMUState || !serializedState || size != sizeof TOKEN + sizeof(Memory) ||
      memcmp(serializedState, TOKEN, sizeof TOKEN) != 0)
    return refuse(c, "this is not a saved state of this FMU");
  if (!*FMUState && !(*FMUState = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*FMUState, serializedState + sizeof TOKEN, sizeof(Memory));
  return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
  Instance *instance = c;
  (void)noSetFMUStatePriorToCurrentPoint;
  if (!instance || !instance->running) return refuse(c, "a step before initialization");
  if (!(communicationStepSize >= 0.0)) return refuse(c, "the step size must not be negative");
  if (MODEL(fmu_advance)(&instance->now, currentCommunicationPoint + communicationStepSize))
    return refuse(c, "the communication point is no time");
  *eventHandlingNeeded = fmi3False;
  *terminateSimulation = fmi3False;
  *earlyReturn = fmi3False;
  *lastSuccessfulTime = instance->now.time;
  return fmi3OK;
}
