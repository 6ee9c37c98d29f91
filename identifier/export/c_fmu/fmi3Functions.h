/* Declarations of FMI 3.0.

   They agree with the header files of the standard (fmi-standard.org), which may be used instead. */
#ifndef fmi3Functions_h
#define fmi3Functions_h

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define fmi3Version "3.0"
#define fmi3True true
#define fmi3False false

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
  fmi3Independent,
  fmi3Constant,
  fmi3Fixed,
  fmi3Tunable,
  fmi3Discrete,
  fmi3Dependent
} fmi3DependencyKind;
typedef enum {
  fmi3IntervalNotYetKnown,
  fmi3IntervalUnchanged,
  fmi3IntervalChanged
} fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean *,
                                               fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);

/* Whoever links several FMUs into one program defines a prefix for each. */
#ifdef FMI3_FUNCTION_PREFIX
#define fmi3Join(a, b) a##b
#define fmi3JoinExpanded(a, b) fmi3Join(a, b)
#define fmi3FullName(name) fmi3JoinExpanded(FMI3_FUNCTION_PREFIX, name)
#else
#define fmi3FullName(name) name
#endif

#ifndef FMI3_Export
#if defined(_WIN32) || defined(__CYGWIN__)
#define FMI3_Export __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI3_Export __attribute__((visibility("default")))
#else
#define FMI3_Export
#endif
#endif

#define fmi3GetVersion fmi3FullName(fmi3GetVersion)
#define fmi3SetDebugLogging fmi3FullName(fmi3SetDebugLogging)
#define fmi3InstantiateModelExchange fmi3FullName(fmi3InstantiateModelExchange)
#define fmi3InstantiateCoSimulation fmi3FullName(fmi3InstantiateCoSimulation)
#define fmi3InstantiateScheduledExecution fmi3FullName(fmi3InstantiateScheduledExecution)
#define fmi3FreeInstance fmi3FullName(fmi3FreeInstance)
#define fmi3EnterInitializationMode fmi3FullName(fmi3EnterInitializationMode)
#define fmi3ExitInitializationMode fmi3FullName(fmi3ExitInitializationMode)
#define fmi3EnterEventMode fmi3FullName(fmi3EnterEventMode)
#define fmi3Terminate fmi3FullName(fmi3Terminate)
#define fmi3Reset fmi3FullName(fmi3Reset)
#define fmi3GetFloat32 fmi3FullName(fmi3GetFloat32)
#define fmi3GetFloat64 fmi3FullName(fmi3GetFloat64)
#define fmi3GetInt8 fmi3FullName(fmi3GetInt8)
#define fmi3GetUInt8 fmi3FullName(fmi3GetUInt8)
#define fmi3GetInt16 fmi3FullName(fmi3GetInt16)
#define fmi3GetUInt16 fmi3FullName(fmi3GetUInt16)
#define fmi3GetInt32 fmi3FullName(fmi3GetInt32)
#define fmi3GetUInt32 fmi3FullName(fmi3GetUInt32)
#define fmi3GetInt64 fmi3FullName(fmi3GetInt64)
#define fmi3GetUInt64 fmi3FullName(fmi3GetUInt64)
#define fmi3GetBoolean fmi3FullName(fmi3GetBoolean)
#define fmi3GetString fmi3FullName(fmi3GetString)
#define fmi3GetBinary fmi3FullName(fmi3GetBinary)
#define fmi3GetClock fmi3FullName(fmi3GetClock)
#define fmi3SetFloat32 fmi3FullName(fmi3SetFloat32)
#define fmi3SetFloat64 fmi3FullName(fmi3SetFloat64)
#define fmi3SetInt8 fmi3FullName(fmi3SetInt8)
#define fmi3SetUInt8 fmi3FullName(fmi3SetUInt8)
#define fmi3SetInt16 fmi3FullName(fmi3SetInt16)
#define fmi3SetUInt16 fmi3FullName(fmi3SetUInt16)
#define fmi3SetInt32 fmi3FullName(fmi3SetInt32)
#define fmi3SetUInt32 fmi3FullName(fmi3SetUInt32)
#define fmi3SetInt64 fmi3FullName(fmi3SetInt64)
#define fmi3SetUInt64 fmi3FullName(fmi3SetUInt64)
#define fmi3SetBoolean fmi3FullName(fmi3SetBoolean)
#define fmi3SetString fmi3FullName(fmi3SetString)
#define fmi3SetBinary fmi3FullName(fmi3SetBinary)
#define fmi3SetClock fmi3FullName(fmi3SetClock)
#define fmi3GetNumberOfVariableDependencies fmi3FullName(fmi3GetNumberOfVariableDependencies)
#define fmi3GetVariableDependencies fmi3FullName(fmi3GetVariableDependencies)
#define fmi3GetFMUState fmi3FullName(fmi3GetFMUState)
#define fmi3SetFMUState fmi3FullName(fmi3SetFMUState)
#define fmi3FreeFMUState fmi3FullName(fmi3FreeFMUState)
#define fmi3SerializedFMUStateSize fmi3FullName(fmi3SerializedFMUStateSize)
#define fmi3SerializeFMUState fmi3FullName(fmi3SerializeFMUState)
#define fmi3DeserializeFMUState fmi3FullName(fmi3DeserializeFMUState)
#define fmi3GetDirectionalDerivative fmi3FullName(fmi3GetDirectionalDerivative)
#define fmi3GetAdjointDerivative fmi3FullName(fmi3GetAdjointDerivative)
#define fmi3EnterConfigurationMode fmi3FullName(fmi3EnterConfigurationMode)
#define fmi3ExitConfigurationMode fmi3FullName(fmi3ExitConfigurationMode)
#define fmi3GetIntervalDecimal fmi3FullName(fmi3GetIntervalDecimal)
#define fmi3GetIntervalFraction fmi3FullName(fmi3GetIntervalFraction)
#define fmi3GetShiftDecimal fmi3FullName(fmi3GetShiftDecimal)
#define fmi3GetShiftFraction fmi3FullName(fmi3GetShiftFraction)
#define fmi3SetIntervalDecimal fmi3FullName(fmi3SetIntervalDecimal)
#define fmi3SetIntervalFraction fmi3FullName(fmi3SetIntervalFraction)
#define fmi3SetShiftDecimal fmi3FullName(fmi3SetShiftDecimal)
#define fmi3SetShiftFraction fmi3FullName(fmi3SetShiftFraction)
#define fmi3EvaluateDiscreteStates fmi3FullName(fmi3EvaluateDiscreteStates)
#define fmi3UpdateDiscreteStates fmi3FullName(fmi3UpdateDiscreteStates)
#define fmi3EnterContinuousTimeMode fmi3FullName(fmi3EnterContinuousTimeMode)
#define fmi3CompletedIntegratorStep fmi3FullName(fmi3CompletedIntegratorStep)
#define fmi3SetTime fmi3FullName(fmi3SetTime)
#define fmi3SetContinuousStates fmi3FullName(fmi3SetContinuousStates)
#define fmi3GetContinuousStateDerivatives fmi3FullName(fmi3GetContinuousStateDerivatives)
#define fmi3GetEventIndicators fmi3FullName(fmi3GetEventIndicators)
#define fmi3GetContinuousStates fmi3FullName(fmi3GetContinuousStates)
#define fmi3GetNominalsOfContinuousStates fmi3FullName(fmi3GetNominalsOfContinuousStates)
#define fmi3GetNumberOfEventIndicators fmi3FullName(fmi3GetNumberOfEventIndicators)
#define fmi3GetNumberOfContinuousStates fmi3FullName(fmi3GetNumberOfContinuousStates)
#define fmi3EnterStepMode fmi3FullName(fmi3EnterStepMode)
#define fmi3GetOutputDerivatives fmi3FullName(fmi3GetOutputDerivatives)
#define fmi3DoStep fmi3FullName(fmi3DoStep)
#define fmi3ActivateModelPartition fmi3FullName(fmi3ActivateModelPartition)

#define FMI3(type) FMI3_Export type
#define FMI3_REFERENCES const fmi3ValueReference[], size_t

FMI3(const char *) fmi3GetVersion(void);
FMI3(fmi3Status) fmi3SetDebugLogging(fmi3Instance, fmi3Boolean, size_t, const fmi3String[]);
FMI3(fmi3Instance)
fmi3InstantiateModelExchange(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                             fmi3InstanceEnvironment, fmi3LogMessageCallback);
FMI3(fmi3Instance)
fmi3InstantiateCoSimulation(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                            fmi3Boolean, fmi3Boolean, FMI3_REFERENCES, fmi3InstanceEnvironment,
                            fmi3LogMessageCallback, fmi3IntermediateUpdateCallback);
FMI3(fmi3Instance)
fmi3InstantiateScheduledExecution(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean,
                                  fmi3InstanceEnvironment, fmi3LogMessageCallback,
                                  fmi3ClockUpdateCallback, fmi3LockPreemptionCallback,
                                  fmi3UnlockPreemptionCallback);
FMI3(void) fmi3FreeInstance(fmi3Instance);
FMI3(fmi3Status)
fmi3EnterInitializationMode(fmi3Instance, fmi3Boolean, fmi3Float64, fmi3Float64, fmi3Boolean,
                            fmi3Float64);
FMI3(fmi3Status) fmi3ExitInitializationMode(fmi3Instance);
FMI3(fmi3Status) fmi3EnterEventMode(fmi3Instance);
FMI3(fmi3Status) fmi3Terminate(fmi3Instance);
FMI3(fmi3Status) fmi3Reset(fmi3Instance);
FMI3(fmi3Status) fmi3GetFloat32(fmi3Instance, FMI3_REFERENCES, fmi3Float32[], size_t);
FMI3(fmi3Status) fmi3GetFloat64(fmi3Instance, FMI3_REFERENCES, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetInt8(fmi3Instance, FMI3_REFERENCES, fmi3Int8[], size_t);
FMI3(fmi3Status) fmi3GetUInt8(fmi3Instance, FMI3_REFERENCES, fmi3UInt8[], size_t);
FMI3(fmi3Status) fmi3GetInt16(fmi3Instance, FMI3_REFERENCES, fmi3Int16[], size_t);
FMI3(fmi3Status) fmi3GetUInt16(fmi3Instance, FMI3_REFERENCES, fmi3UInt16[], size_t);
FMI3(fmi3Status) fmi3GetInt32(fmi3Instance, FMI3_REFERENCES, fmi3Int32[], size_t);
FMI3(fmi3Status) fmi3GetUInt32(fmi3Instance, FMI3_REFERENCES, fmi3UInt32[], size_t);
FMI3(fmi3Status) fmi3GetInt64(fmi3Instance, FMI3_REFERENCES, fmi3Int64[], size_t);
FMI3(fmi3Status) fmi3GetUInt64(fmi3Instance, FMI3_REFERENCES, fmi3UInt64[], size_t);
FMI3(fmi3Status) fmi3GetBoolean(fmi3Instance, FMI3_REFERENCES, fmi3Boolean[], size_t);
FMI3(fmi3Status) fmi3GetString(fmi3Instance, FMI3_REFERENCES, fmi3String[], size_t);
FMI3(fmi3Status) fmi3GetBinary(fmi3Instance, FMI3_REFERENCES, size_t[], fmi3Binary[], size_t);
FMI3(fmi3Status) fmi3GetClock(fmi3Instance, FMI3_REFERENCES, fmi3Clock[]);
FMI3(fmi3Status) fmi3SetFloat32(fmi3Instance, FMI3_REFERENCES, const fmi3Float32[], size_t);
FMI3(fmi3Status) fmi3SetFloat64(fmi3Instance, FMI3_REFERENCES, const fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3SetInt8(fmi3Instance, FMI3_REFERENCES, const fmi3Int8[], size_t);
FMI3(fmi3Status) fmi3SetUInt8(fmi3Instance, FMI3_REFERENCES, const fmi3UInt8[], size_t);
FMI3(fmi3Status) fmi3SetInt16(fmi3Instance, FMI3_REFERENCES, const fmi3Int16[], size_t);
FMI3(fmi3Status) fmi3SetUInt16(fmi3Instance, FMI3_REFERENCES, const fmi3UInt16[], size_t);
FMI3(fmi3Status) fmi3SetInt32(fmi3Instance, FMI3_REFERENCES, const fmi3Int32[], size_t);
FMI3(fmi3Status) fmi3SetUInt32(fmi3Instance, FMI3_REFERENCES, const fmi3UInt32[], size_t);
FMI3(fmi3Status) fmi3SetInt64(fmi3Instance, FMI3_REFERENCES, const fmi3Int64[], size_t);
FMI3(fmi3Status) fmi3SetUInt64(fmi3Instance, FMI3_REFERENCES, const fmi3UInt64[], size_t);
FMI3(fmi3Status) fmi3SetBoolean(fmi3Instance, FMI3_REFERENCES, const fmi3Boolean[], size_t);
FMI3(fmi3Status) fmi3SetString(fmi3Instance, FMI3_REFERENCES, const fmi3String[], size_t);
FMI3(fmi3Status)
fmi3SetBinary(fmi3Instance, FMI3_REFERENCES, const size_t[], const fmi3Binary[], size_t);
FMI3(fmi3Status) fmi3SetClock(fmi3Instance, FMI3_REFERENCES, const fmi3Clock[]);
FMI3(fmi3Status) fmi3GetNumberOfVariableDependencies(fmi3Instance, fmi3ValueReference, size_t *);
FMI3(fmi3Status)
fmi3GetVariableDependencies(fmi3Instance, fmi3ValueReference, size_t[], fmi3ValueReference[],
                            size_t[], fmi3DependencyKind[], size_t);
FMI3(fmi3Status) fmi3GetFMUState(fmi3Instance, fmi3FMUState *);
FMI3(fmi3Status) fmi3SetFMUState(fmi3Instance, fmi3FMUState);
FMI3(fmi3Status) fmi3FreeFMUState(fmi3Instance, fmi3FMUState *);
FMI3(fmi3Status) fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t *);
FMI3(fmi3Status) fmi3SerializeFMUState(fmi3Instance, fmi3FMUState, fmi3Byte[], size_t);
FMI3(fmi3Status) fmi3DeserializeFMUState(fmi3Instance, const fmi3Byte[], size_t, fmi3FMUState *);
FMI3(fmi3Status)
fmi3GetDirectionalDerivative(fmi3Instance, FMI3_REFERENCES, FMI3_REFERENCES, const fmi3Float64[],
                             size_t, fmi3Float64[], size_t);
FMI3(fmi3Status)
fmi3GetAdjointDerivative(fmi3Instance, FMI3_REFERENCES, FMI3_REFERENCES, const fmi3Float64[],
                         size_t, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3EnterConfigurationMode(fmi3Instance);
FMI3(fmi3Status) fmi3ExitConfigurationMode(fmi3Instance);
FMI3(fmi3Status)
fmi3GetIntervalDecimal(fmi3Instance, FMI3_REFERENCES, fmi3Float64[], fmi3IntervalQualifier[]);
FMI3(fmi3Status)
fmi3GetIntervalFraction(fmi3Instance, FMI3_REFERENCES, fmi3UInt64[], fmi3UInt64[],
                        fmi3IntervalQualifier[]);
FMI3(fmi3Status) fmi3GetShiftDecimal(fmi3Instance, FMI3_REFERENCES, fmi3Float64[]);
FMI3(fmi3Status) fmi3GetShiftFraction(fmi3Instance, FMI3_REFERENCES, fmi3UInt64[], fmi3UInt64[]);
FMI3(fmi3Status) fmi3SetIntervalDecimal(fmi3Instance, FMI3_REFERENCES, const fmi3Float64[]);
FMI3(fmi3Status)
fmi3SetIntervalFraction(fmi3Instance, FMI3_REFERENCES, const fmi3UInt64[], const fmi3UInt64[]);
FMI3(fmi3Status) fmi3SetShiftDecimal(fmi3Instance, FMI3_REFERENCES, const fmi3Float64[]);
FMI3(fmi3Status)
fmi3SetShiftFraction(fmi3Instance, FMI3_REFERENCES, const fmi3UInt64[], const fmi3UInt64[]);
FMI3(fmi3Status) fmi3EvaluateDiscreteStates(fmi3Instance);
FMI3(fmi3Status)
fmi3UpdateDiscreteStates(fmi3Instance, fmi3Boolean *, fmi3Boolean *, fmi3Boolean *, fmi3Boolean *,
                         fmi3Boolean *, fmi3Float64 *);
FMI3(fmi3Status) fmi3EnterContinuousTimeMode(fmi3Instance);
FMI3(fmi3Status)
fmi3CompletedIntegratorStep(fmi3Instance, fmi3Boolean, fmi3Boolean *, fmi3Boolean *);
FMI3(fmi3Status) fmi3SetTime(fmi3Instance, fmi3Float64);
FMI3(fmi3Status) fmi3SetContinuousStates(fmi3Instance, const fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetContinuousStateDerivatives(fmi3Instance, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetEventIndicators(fmi3Instance, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetContinuousStates(fmi3Instance, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetNominalsOfContinuousStates(fmi3Instance, fmi3Float64[], size_t);
FMI3(fmi3Status) fmi3GetNumberOfEventIndicators(fmi3Instance, size_t *);
FMI3(fmi3Status) fmi3GetNumberOfContinuousStates(fmi3Instance, size_t *);
FMI3(fmi3Status) fmi3EnterStepMode(fmi3Instance);
FMI3(fmi3Status)
fmi3GetOutputDerivatives(fmi3Instance, FMI3_REFERENCES, const fmi3Int32[], fmi3Float64[], size_t);
FMI3(fmi3Status)
fmi3DoStep(fmi3Instance, fmi3Float64, fmi3Float64, fmi3Boolean, fmi3Boolean *, fmi3Boolean *,
           fmi3Boolean *, fmi3Float64 *);
FMI3(fmi3Status) fmi3ActivateModelPartition(fmi3Instance, fmi3ValueReference, fmi3Float64);

#endif
