/* Declarations of FMI 2.0 for Co-Simulation, as far as this FMU implements them.

   They agree with the header files of the standard (fmi-standard.org), which may be used instead. */
#ifndef fmi2Functions_h
#define fmi2Functions_h

#include <stddef.h>

#define fmi2TypesPlatform "default"
#define fmi2Version "2.0"
#define fmi2True 1
#define fmi2False 0

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum {
  fmi2DoStepStatus,
  fmi2PendingStatus,
  fmi2LastSuccessfulTime,
  fmi2Terminated
} fmi2StatusKind;

typedef struct {
  void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
  fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

/* Whoever links several FMUs into one program defines a prefix for each. */
#ifdef FMI2_FUNCTION_PREFIX
#define fmi2Join(a, b) a##b
#define fmi2JoinExpanded(a, b) fmi2Join(a, b)
#define fmi2FullName(name) fmi2JoinExpanded(FMI2_FUNCTION_PREFIX, name)
#else
#define fmi2FullName(name) name
#endif

#ifndef FMI2_Export
#if defined(_WIN32) || defined(__CYGWIN__)
#define FMI2_Export __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI2_Export __attribute__((visibility("default")))
#else
#define FMI2_Export
#endif
#endif

#define fmi2GetTypesPlatform fmi2FullName(fmi2GetTypesPlatform)
#define fmi2GetVersion fmi2FullName(fmi2GetVersion)
#define fmi2SetDebugLogging fmi2FullName(fmi2SetDebugLogging)
#define fmi2Instantiate fmi2FullName(fmi2Instantiate)
#define fmi2FreeInstance fmi2FullName(fmi2FreeInstance)
#define fmi2SetupExperiment fmi2FullName(fmi2SetupExperiment)
#define fmi2EnterInitializationMode fmi2FullName(fmi2EnterInitializationMode)
#define fmi2ExitInitializationMode fmi2FullName(fmi2ExitInitializationMode)
#define fmi2Terminate fmi2FullName(fmi2Terminate)
#define fmi2Reset fmi2FullName(fmi2Reset)
#define fmi2GetReal fmi2FullName(fmi2GetReal)
#define fmi2GetInteger fmi2FullName(fmi2GetInteger)
#define fmi2GetBoolean fmi2FullName(fmi2GetBoolean)
#define fmi2GetString fmi2FullName(fmi2GetString)
#define fmi2SetReal fmi2FullName(fmi2SetReal)
#define fmi2SetInteger fmi2FullName(fmi2SetInteger)
#define fmi2SetBoolean fmi2FullName(fmi2SetBoolean)
#define fmi2SetString fmi2FullName(fmi2SetString)
#define fmi2GetFMUstate fmi2FullName(fmi2GetFMUstate)
#define fmi2SetFMUstate fmi2FullName(fmi2SetFMUstate)
#define fmi2FreeFMUstate fmi2FullName(fmi2FreeFMUstate)
#define fmi2SerializedFMUstateSize fmi2FullName(fmi2SerializedFMUstateSize)
#define fmi2SerializeFMUstate fmi2FullName(fmi2SerializeFMUstate)
#define fmi2DeSerializeFMUstate fmi2FullName(fmi2DeSerializeFMUstate)
#define fmi2GetDirectionalDerivative fmi2FullName(fmi2GetDirectionalDerivative)
#define fmi2SetRealInputDerivatives fmi2FullName(fmi2SetRealInputDerivatives)
#define fmi2GetRealOutputDerivatives fmi2FullName(fmi2GetRealOutputDerivatives)
#define fmi2DoStep fmi2FullName(fmi2DoStep)
#define fmi2CancelStep fmi2FullName(fmi2CancelStep)
#define fmi2GetStatus fmi2FullName(fmi2GetStatus)
#define fmi2GetRealStatus fmi2FullName(fmi2GetRealStatus)
#define fmi2GetIntegerStatus fmi2FullName(fmi2GetIntegerStatus)
#define fmi2GetBooleanStatus fmi2FullName(fmi2GetBooleanStatus)
#define fmi2GetStringStatus fmi2FullName(fmi2GetStringStatus)

#define FMI2(type) FMI2_Export type
#define FMI2_REFERENCES const fmi2ValueReference[], size_t

FMI2(const char *) fmi2GetTypesPlatform(void);
FMI2(const char *) fmi2GetVersion(void);
FMI2(fmi2Status) fmi2SetDebugLogging(fmi2Component, fmi2Boolean, size_t, const fmi2String[]);
FMI2(fmi2Component)
fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *,
                fmi2Boolean, fmi2Boolean);
FMI2(void) fmi2FreeInstance(fmi2Component);
FMI2(fmi2Status)
fmi2SetupExperiment(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real);
FMI2(fmi2Status) fmi2EnterInitializationMode(fmi2Component);
FMI2(fmi2Status) fmi2ExitInitializationMode(fmi2Component);
FMI2(fmi2Status) fmi2Terminate(fmi2Component);
FMI2(fmi2Status) fmi2Reset(fmi2Component);
FMI2(fmi2Status) fmi2GetReal(fmi2Component, FMI2_REFERENCES, fmi2Real[]);
FMI2(fmi2Status) fmi2GetInteger(fmi2Component, FMI2_REFERENCES, fmi2Integer[]);
FMI2(fmi2Status) fmi2GetBoolean(fmi2Component, FMI2_REFERENCES, fmi2Boolean[]);
FMI2(fmi2Status) fmi2GetString(fmi2Component, FMI2_REFERENCES, fmi2String[]);
FMI2(fmi2Status) fmi2SetReal(fmi2Component, FMI2_REFERENCES, const fmi2Real[]);
FMI2(fmi2Status) fmi2SetInteger(fmi2Component, FMI2_REFERENCES, const fmi2Integer[]);
FMI2(fmi2Status) fmi2SetBoolean(fmi2Component, FMI2_REFERENCES, const fmi2Boolean[]);
FMI2(fmi2Status) fmi2SetString(fmi2Component, FMI2_REFERENCES, const fmi2String[]);
FMI2(fmi2Status) fmi2GetFMUstate(fmi2Component, fmi2FMUstate *);
FMI2(fmi2Status) fmi2SetFMUstate(fmi2Component, fmi2FMUstate);
FMI2(fmi2Status) fmi2FreeFMUstate(fmi2Component, fmi2FMUstate *);
FMI2(fmi2Status) fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t *);
FMI2(fmi2Status) fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, fmi2Byte[], size_t);
FMI2(fmi2Status)
fmi2DeSerializeFMUstate(fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *);
FMI2(fmi2Status)
fmi2GetDirectionalDerivative(fmi2Component, FMI2_REFERENCES, FMI2_REFERENCES, const fmi2Real[],
                             fmi2Real[]);
FMI2(fmi2Status)
fmi2SetRealInputDerivatives(fmi2Component, FMI2_REFERENCES, const fmi2Integer[], const fmi2Real[]);
FMI2(fmi2Status)
fmi2GetRealOutputDerivatives(fmi2Component, FMI2_REFERENCES, const fmi2Integer[], fmi2Real[]);
FMI2(fmi2Status) fmi2DoStep(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
FMI2(fmi2Status) fmi2CancelStep(fmi2Component);
FMI2(fmi2Status) fmi2GetStatus(fmi2Component, const fmi2StatusKind, fmi2Status *);
FMI2(fmi2Status) fmi2GetRealStatus(fmi2Component, const fmi2StatusKind, fmi2Real *);
FMI2(fmi2Status) fmi2GetIntegerStatus(fmi2Component, const fmi2StatusKind, fmi2Integer *);
FMI2(fmi2Status) fmi2GetBooleanStatus(fmi2Component, const fmi2StatusKind, fmi2Boolean *);
FMI2(fmi2Status) fmi2GetStringStatus(fmi2Component, const fmi2StatusKind, fmi2String *);

#endif
