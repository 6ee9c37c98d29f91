/* What FMI 3.0 asks every FMU to export and this one does not offer: Model Exchange, Scheduled
   Execution, clocks, derivatives, arrays, and variables of types that it has none of. */
#include "fmi3Functions.h"

#define REFERENCES const fmi3ValueReference references[], size_t n
#define IGNORE(value) (void)(value)

/* Variables of a type of which there is none: right only where none is asked for. */
#define NO_VARIABLES(access, name, type)                                               \
  fmi3Status access##name(fmi3Instance c, REFERENCES, type values[], size_t nValues) { \
    IGNORE(references), IGNORE(values), IGNORE(nValues);                               \
    return c && n == 0 ? fmi3OK : fmi3Error;                                           \
  }
#define NO_TYPE(name)                     \
  NO_VARIABLES(fmi3Get, name, fmi3##name) \
  NO_VARIABLES(fmi3Set, name, const fmi3##name)

NO_TYPE(Float32)
NO_TYPE(Int8)
NO_TYPE(UInt8)
NO_TYPE(Int16)
NO_TYPE(UInt16)
NO_TYPE(UInt32)
NO_TYPE(Int64)
NO_TYPE(UInt64)
NO_TYPE(String)
NO_VARIABLES(fmi3Set, Int32, const fmi3Int32)

#define NO_BINARY(name, size_type, type)                                                          \
  fmi3Status name(fmi3Instance c, REFERENCES, size_type sizes[], type values[], size_t nValues) { \
    IGNORE(references), IGNORE(sizes), IGNORE(values), IGNORE(nValues);                           \
    return c && n == 0 ? fmi3OK : fmi3Error;                                                      \
  }
NO_BINARY(fmi3GetBinary, size_t, fmi3Binary)
NO_BINARY(fmi3SetBinary, const size_t, const fmi3Binary)

/* Functions of an instance and up to two arrays over clocks or variables. */
#define NO_CLOCK(name, type)                                   \
  fmi3Status name(fmi3Instance c, REFERENCES, type values[]) { \
    IGNORE(references), IGNORE(values);                        \
    return c && n == 0 ? fmi3OK : fmi3Error;                   \
  }
#define NO_CLOCK_PAIR(name, type, other)                                       \
  fmi3Status name(fmi3Instance c, REFERENCES, type values[], other others[]) { \
    IGNORE(references), IGNORE(values), IGNORE(others);                        \
    return c && n == 0 ? fmi3OK : fmi3Error;                                   \
  }
NO_CLOCK(fmi3GetClock, fmi3Clock)
NO_CLOCK(fmi3SetClock, const fmi3Clock)
NO_CLOCK(fmi3GetShiftDecimal, fmi3Float64)
NO_CLOCK(fmi3SetShiftDecimal, const fmi3Float64)
NO_CLOCK(fmi3SetIntervalDecimal, const fmi3Float64)
NO_CLOCK_PAIR(fmi3GetIntervalDecimal, fmi3Float64, fmi3IntervalQualifier)
NO_CLOCK_PAIR(fmi3GetShiftFraction, fmi3UInt64, fmi3UInt64)
NO_CLOCK_PAIR(fmi3SetShiftFraction, const fmi3UInt64, const fmi3UInt64)
NO_CLOCK_PAIR(fmi3SetIntervalFraction, const fmi3UInt64, const fmi3UInt64)

fmi3Status fmi3GetIntervalFraction(fmi3Instance c, REFERENCES, fmi3UInt64 counters[],
                                   fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]) {
  IGNORE(references), IGNORE(counters), IGNORE(resolutions), IGNORE(qualifiers);
  return c && n == 0 ? fmi3OK : fmi3Error;
}

/* Modes that Co-Simulation without events does not have. */
#define NO_MODE(name)               \
  fmi3Status name(fmi3Instance c) { \
    IGNORE(c);                      \
    return fmi3Error;               \
  }
NO_MODE(fmi3EnterEventMode)
NO_MODE(fmi3EnterStepMode)
NO_MODE(fmi3EnterConfigurationMode)
NO_MODE(fmi3ExitConfigurationMode)
NO_MODE(fmi3EvaluateDiscreteStates)
NO_MODE(fmi3EnterContinuousTimeMode)

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *needUpdate, fmi3Boolean *terminate,
                                    fmi3Boolean *nominals, fmi3Boolean *states,
                                    fmi3Boolean *nextEvent, fmi3Float64 *time) {
  IGNORE(c), IGNORE(needUpdate), IGNORE(terminate), IGNORE(nominals), IGNORE(states);
  IGNORE(nextEvent), IGNORE(time);
  return fmi3Error;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean noSet, fmi3Boolean *event,
                                       fmi3Boolean *terminate) {
  IGNORE(c), IGNORE(noSet), IGNORE(event), IGNORE(terminate);
  return fmi3Error;
}

fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) {
  IGNORE(c), IGNORE(time);
  return fmi3Error;
}

/* There are no continuous states and no event indicators. */
#define NO_STATES(name, type)                                \
  fmi3Status name(fmi3Instance c, type values[], size_t n) { \
    IGNORE(values);                                          \
    return c && n == 0 ? fmi3OK : fmi3Error;                 \
  }
NO_STATES(fmi3SetContinuousStates, const fmi3Float64)
NO_STATES(fmi3GetContinuousStateDerivatives, fmi3Float64)
NO_STATES(fmi3GetEventIndicators, fmi3Float64)
NO_STATES(fmi3GetContinuousStates, fmi3Float64)
NO_STATES(fmi3GetNominalsOfContinuousStates, fmi3Float64)

#define NONE(name)                                  \
  fmi3Status name(fmi3Instance c, size_t *number) { \
    if (!c || !number) return fmi3Error;            \
    *number = 0;                                    \
    return fmi3OK;                                  \
  }
NONE(fmi3GetNumberOfEventIndicators)
NONE(fmi3GetNumberOfContinuousStates)

/* Derivatives and dependencies, none of which modelDescription.xml offers. */
#define NO_DERIVATIVE(name)                                                                       \
  fmi3Status name(fmi3Instance c, REFERENCES, const fmi3ValueReference known[], size_t nKnown,    \
                  const fmi3Float64 seed[], size_t nSeed, fmi3Float64 result[], size_t nResult) { \
    IGNORE(c), IGNORE(references), IGNORE(n), IGNORE(known), IGNORE(nKnown), IGNORE(seed);        \
    IGNORE(nSeed), IGNORE(result), IGNORE(nResult);                                               \
    return fmi3Error;                                                                             \
  }
NO_DERIVATIVE(fmi3GetDirectionalDerivative)
NO_DERIVATIVE(fmi3GetAdjointDerivative)

fmi3Status fmi3GetOutputDerivatives(fmi3Instance c, REFERENCES, const fmi3Int32 orders[],
                                    fmi3Float64 values[], size_t nValues) {
  IGNORE(c), IGNORE(references), IGNORE(n), IGNORE(orders), IGNORE(values), IGNORE(nValues);
  return fmi3Error;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance c, fmi3ValueReference reference,
                                               size_t *number) {
  IGNORE(c), IGNORE(reference), IGNORE(number);
  return fmi3Error;
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance c, fmi3ValueReference dependent,
                                       size_t elements[], fmi3ValueReference independents[],
                                       size_t others[], fmi3DependencyKind kinds[], size_t n) {
  IGNORE(c), IGNORE(dependent), IGNORE(elements), IGNORE(independents), IGNORE(others);
  IGNORE(kinds), IGNORE(n);
  return fmi3Error;
}

/* The two other kinds of FMU. */
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                          fmi3Boolean visible, fmi3Boolean logging,
                                          fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
  IGNORE(name), IGNORE(token), IGNORE(resources), IGNORE(visible), IGNORE(logging);
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for Co-Simulation only");
  return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) {
  IGNORE(name), IGNORE(token), IGNORE(resources), IGNORE(visible), IGNORE(logging);
  IGNORE(update), IGNORE(lock), IGNORE(unlock);
  if (log) log(environment, fmi3Error, "logStatusError", "this FMU is for Co-Simulation only");
  return NULL;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time) {
  IGNORE(c), IGNORE(clock), IGNORE(time);
  return fmi3Error;
}
