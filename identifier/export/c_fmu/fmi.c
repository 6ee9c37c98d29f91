/* The interface of FMI 2.0 and 3.0 for Co-Simulation, by MODEL_FMI. What it computes is in memory.c
   and the component. */
#include "memory.h"

#if MODEL_FMI == 3
#include "fmi3Functions.h"
#define FMI(name) fmi3##name
#define STATE(action) fmi3##action##FMUState
#define STATE_SIZE fmi3SerializedFMUStateSize
#define STATE_READ fmi3DeserializeFMUState
typedef fmi3Status Status;
typedef fmi3Instance Component;
typedef fmi3FMUState State;
#else
#include "fmi2Functions.h"
#define FMI(name) fmi2##name
#define STATE(action) fmi2##action##FMUstate
#define STATE_SIZE fmi2SerializedFMUstateSize
#define STATE_READ fmi2DeSerializeFMUstate
typedef fmi2Status Status;
typedef fmi2Component Component;
typedef fmi2FMUstate State;
#endif

#include <stdlib.h>
#include <string.h>

typedef struct {
  Memory now;
  int running; /* initialization is over, the run is not */
#if MODEL_FMI == 3
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
#else
  char *name;
  fmi2CallbackFunctions callbacks;
#endif
} Instance;

/* A saved state on disk begins with the token, so that it is not given to another model. */
static const char TOKEN[] = MODEL_TOKEN;

#if MODEL_FMI == 3

static fmi3Status refuse(fmi3Instance c, const char *message) {
  Instance *instance = c;
  if (instance && instance->log)
    instance->log(instance->environment, fmi3Error, "logStatusError", message);
  return fmi3Error;
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

#else

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

#endif

const char *FMI(GetVersion)(void) { return FMI(Version); }

Status FMI(SetDebugLogging)(Component c, FMI(Boolean) loggingOn, size_t nCategories,
                            const FMI(String) categories[]) {
  (void)loggingOn;
  (void)nCategories;
  (void)categories;
  return c ? FMI(OK) : FMI(Error);
}

Status FMI(ExitInitializationMode)(Component c) {
  Instance *instance = c;
  if (!instance || instance->running) return refuse(c, "it is already initialized");
  instance->running = 1;
  return FMI(OK);
}

/* Takes the samples from a communication point on, over a step [s]. */
static Status step(Component c, double point, double size) {
  Instance *instance = c;
  if (!instance || !instance->running) return refuse(c, "a step before initialization");
  if (!(size >= 0.0)) return refuse(c, "the step size must not be negative");
  if (MODEL(fmu_advance)(&instance->now, point + size))
    return refuse(c, "the communication point is no time");
  return FMI(OK);
}

Status FMI(Terminate)(Component c) {
  Instance *instance = c;
  if (!instance) return FMI(Error);
  instance->running = 0;
  return FMI(OK);
}

Status FMI(Reset)(Component c) {
  Instance *instance = c;
  if (!instance) return FMI(Error);
  instance->running = 0;
  MODEL(fmu_start)(&instance->now);
  return FMI(OK);
}

Status STATE(Get)(Component c, State *state) {
  Instance *instance = c;
  if (!instance || !state) return refuse(c, "there is no place for the state");
  if (!*state && !(*state = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*state, &instance->now, sizeof(Memory));
  return FMI(OK);
}

Status STATE(Set)(Component c, State state) {
  Instance *instance = c;
  if (!instance || !state) return refuse(c, "there is no state");
  memcpy(&instance->now, state, sizeof(Memory));
  return FMI(OK);
}

Status STATE(Free)(Component c, State *state) {
  if (!c) return FMI(Error);
  if (state) {
    free(*state);
    *state = NULL;
  }
  return FMI(OK);
}

Status STATE_SIZE(Component c, State state, size_t *size) {
  (void)state;
  if (!c || !size) return refuse(c, "there is no place for the size");
  *size = sizeof TOKEN + sizeof(Memory);
  return FMI(OK);
}

Status STATE(Serialize)(Component c, State state, FMI(Byte) serializedState[], size_t size) {
  if (!c || !state || !serializedState || size < sizeof TOKEN + sizeof(Memory))
    return refuse(c, "there is no place for the state");
  memcpy(serializedState, TOKEN, sizeof TOKEN);
  memcpy(serializedState + sizeof TOKEN, state, sizeof(Memory));
  return FMI(OK);
}

Status STATE_READ(Component c, const FMI(Byte) serializedState[], size_t size, State *state) {
  if (!c || !state || !serializedState || size != sizeof TOKEN + sizeof(Memory) ||
      memcmp(serializedState, TOKEN, sizeof TOKEN) != 0)
    return refuse(c, "this is not a saved state of this FMU");
  if (!*state && !(*state = malloc(sizeof(Memory)))) return refuse(c, "out of memory");
  memcpy(*state, serializedState + sizeof TOKEN, sizeof(Memory));
  return FMI(OK);
}

#if MODEL_FMI == 3

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

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
  const Instance *instance = c;
  const fmi3Status status = step(c, currentCommunicationPoint, communicationStepSize);
  (void)noSetFMUStatePriorToCurrentPoint;
  if (status != fmi3OK) return status;
  *eventHandlingNeeded = fmi3False;
  *terminateSimulation = fmi3False;
  *earlyReturn = fmi3False;
  *lastSuccessfulTime = instance->now.time;
  return fmi3OK;
}

#else

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

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
  (void)noSetFMUStatePriorToCurrentPoint;
  return step(c, currentCommunicationPoint, communicationStepSize);
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

#endif
