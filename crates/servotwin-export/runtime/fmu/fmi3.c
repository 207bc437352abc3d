/* The interface of FMI 3.0 for co-simulation and model exchange. */
#include "servotwin_fmu.h"
#include "servotwin_token.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

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
typedef char fmi3Char;
typedef const fmi3Char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef int fmi3DependencyKind;
typedef int fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean,
    fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3Callback)(fmi3InstanceEnvironment);
typedef void (*fmi3PlainCallback)(void);

typedef struct {
    servotwin_fmu fmu;
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
    bool has_warned;
} instance;

static fmi3Status logged(const instance *of, fmi3Status status, const char *why)
{
    if (of->log != NULL) {
        of->log(of->environment, status, (status == fmi3Warning) ? "warning" : "error", why);
    }
    return status;
}

#define NAME(name) fmi3##name
#define STATE(verb) fmi3##verb##FMUState
#define DESERIALIZE fmi3DeserializeFMUState
#include "servotwin_fmi.h"

static const char no_clock[] = "there are no clocks";

FUNCTION(const char *, fmi3GetVersion, void)
{
    return "3.0";
}

FUNCTION(fmi3Status, fmi3SetDebugLogging, fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    return fmi3OK;
}

static fmi3Instance instantiate(fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    instance *of = NULL;
    if ((token != NULL) && (strcmp(token, SERVOTWIN_TOKEN) == 0)) {
        of = calloc(1U, sizeof *of);
    }
    if (of != NULL) {
        servotwin_fmu_reset(&of->fmu);
        of->environment = environment;
        of->log = log;
    }
    return of;
}

FUNCTION(fmi3Instance, fmi3InstantiateModelExchange, fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return SERVOTWIN_FMU_HAS_MODEL_EXCHANGE ? instantiate(token, environment, log) : NULL;
}

FUNCTION(fmi3Instance, fmi3InstantiateCoSimulation, fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean uses_events, fmi3Boolean may_return_early,
    const fmi3ValueReference intermediate[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return instantiate(token, environment, log);
}

FUNCTION(fmi3Instance, fmi3InstantiateScheduledExecution, fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3Callback update, fmi3PlainCallback lock, fmi3PlainCallback unlock)
{
    return NULL;
}

FUNCTION(fmi3Status, fmi3EnterInitializationMode, fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    instance *of = c;
    return well(of, servotwin_fmu_start_at(&of->fmu, start), SERVOTWIN_FMU_NO_TIME);
}

NOTHING_TO_DO(fmi3EnterConfigurationMode)
NOTHING_TO_DO(fmi3ExitConfigurationMode)
NOTHING_TO_DO(fmi3EnterStepMode)
NOTHING_TO_DO(fmi3EvaluateDiscreteStates)

FUNCTION(fmi3Status, fmi3GetFloat64, fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3Float64 values[],
    size_t value_count)
{
    instance *of = c;
    const bool fits = count == value_count;
    return well(of, fits && servotwin_fmu_get(&of->fmu, vr, count, values), SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi3Status, fmi3SetFloat64, fmi3Instance c, const fmi3ValueReference vr[], size_t count,
    const fmi3Float64 values[], size_t value_count)
{
    instance *of = c;
    const bool fits = count == value_count;
    return well(of, fits && servotwin_fmu_set(&of->fmu, vr, count, values), SERVOTWIN_FMU_NOT_SET);
}

/* There are no variables of other types. */
#define NO_VARIABLES(type) \
    FUNCTION(fmi3Status, fmi3Get##type, fmi3Instance c, const fmi3ValueReference vr[], size_t count, \
        fmi3##type values[], size_t value_count) \
    { \
        return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN); \
    } \
    FUNCTION(fmi3Status, fmi3Set##type, fmi3Instance c, const fmi3ValueReference vr[], size_t count, \
        const fmi3##type values[], size_t value_count) \
    { \
        return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN); \
    }

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

FUNCTION(fmi3Status, fmi3GetBinary, fmi3Instance c, const fmi3ValueReference vr[], size_t count, size_t sizes[],
    fmi3Binary values[], size_t value_count)
{
    return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi3Status, fmi3SetBinary, fmi3Instance c, const fmi3ValueReference vr[], size_t count, const size_t sizes[],
    const fmi3Binary values[], size_t value_count)
{
    return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi3Status, fmi3GetClock, fmi3Instance c, const fmi3ValueReference vr[], size_t count, fmi3Clock values[])
{
    return well(c, count == 0U, no_clock);
}

FUNCTION(fmi3Status, fmi3SetClock, fmi3Instance c, const fmi3ValueReference vr[], size_t count, const fmi3Clock values[])
{
    return well(c, count == 0U, no_clock);
}

/* The dependencies of the model description hold always. */
FUNCTION(fmi3Status, fmi3GetNumberOfVariableDependencies, fmi3Instance c, fmi3ValueReference vr, size_t *count)
{
    return failed(c, "dependencies do not change: see the model description");
}

FUNCTION(fmi3Status, fmi3GetVariableDependencies, fmi3Instance c, fmi3ValueReference dependent,
    size_t dependent_elements[], fmi3ValueReference independents[], size_t independent_elements[],
    fmi3DependencyKind kinds[], size_t count)
{
    return failed(c, "dependencies do not change: see the model description");
}

FUNCTION(fmi3Status, fmi3SerializedFMUStateSize, fmi3Instance c, fmi3FMUState saved, size_t *size)
{
    *size = SERVOTWIN_FMU_BYTES;
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3GetDirectionalDerivative, fmi3Instance c, const fmi3ValueReference unknowns[],
    size_t unknown_count, const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seeds[],
    size_t seed_count, fmi3Float64 sensitivities[], size_t sensitivity_count)
{
    instance *of = c;
    const bool fits = (unknown_count == sensitivity_count) && (known_count == seed_count);
    return well(of,
        fits && servotwin_fmu_directional(&of->fmu, unknowns, unknown_count, knowns, known_count, seeds, sensitivities),
        SERVOTWIN_FMU_NO_DERIVATIVE);
}

FUNCTION(fmi3Status, fmi3GetAdjointDerivative, fmi3Instance c, const fmi3ValueReference unknowns[], size_t unknown_count,
    const fmi3ValueReference knowns[], size_t known_count, const fmi3Float64 seeds[], size_t seed_count,
    fmi3Float64 sensitivities[], size_t sensitivity_count)
{
    return failed(c, "adjoint derivatives are not provided");
}

/* Clocks of the interface; those of sampled controllers are time events. */
#define NO_CLOCKS(name, ...) \
    FUNCTION(fmi3Status, name, fmi3Instance c, const fmi3ValueReference vr[], size_t count, __VA_ARGS__) \
    { \
        return well(c, count == 0U, no_clock); \
    }

NO_CLOCKS(fmi3GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(fmi3GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(fmi3GetShiftDecimal, fmi3Float64 shifts[])
NO_CLOCKS(fmi3GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetIntervalDecimal, const fmi3Float64 intervals[])
NO_CLOCKS(fmi3SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(fmi3SetShiftDecimal, const fmi3Float64 shifts[])
NO_CLOCKS(fmi3SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])

FUNCTION(fmi3Status, fmi3ActivateModelPartition, fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time_s)
{
    return failed(c, no_clock);
}

FUNCTION(fmi3Status, fmi3UpdateDiscreteStates, fmi3Instance c, fmi3Boolean *needs_update, fmi3Boolean *terminates,
    fmi3Boolean *changed_nominals, fmi3Boolean *changed_states, fmi3Boolean *has_next, fmi3Float64 *next_s)
{
    instance *of = c;
    *needs_update = false;
    *terminates = false;
    *changed_nominals = false;
    *changed_states = false;
    *has_next = servotwin_fmu_tick(&of->fmu, next_s);
    return fmi3OK;
}

/* ------------------------------------------------------------ Model exchange. */

FUNCTION(fmi3Status, fmi3CompletedIntegratorStep, fmi3Instance c, fmi3Boolean no_set_before,
    fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
{
    *enter_event_mode = false;
    *terminate = false;
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3GetContinuousStateDerivatives, fmi3Instance c, fmi3Float64 derivatives[], size_t count)
{
    instance *of = c;
    return well(of, servotwin_fmu_derivatives(&of->fmu, derivatives, count), SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi3Status, fmi3GetEventIndicators, fmi3Instance c, fmi3Float64 indicators[], size_t count)
{
    return well(c, count == 0U, SERVOTWIN_FMU_OTHER_LENGTH);
}

FUNCTION(fmi3Status, fmi3GetNumberOfEventIndicators, fmi3Instance c, size_t *count)
{
    *count = 0U;
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3GetNumberOfContinuousStates, fmi3Instance c, size_t *count)
{
    *count = (size_t)SERVOTWIN_FMU_STATES;
    return fmi3OK;
}

/* ------------------------------------------------------------- Co-simulation. */

FUNCTION(fmi3Status, fmi3GetOutputDerivatives, fmi3Instance c, const fmi3ValueReference vr[], size_t count,
    const fmi3Int32 orders[], fmi3Float64 values[], size_t value_count)
{
    return well(c, count == 0U, "outputs have no derivatives");
}

FUNCTION(fmi3Status, fmi3DoStep, fmi3Instance c, fmi3Float64 time_s, fmi3Float64 step_s, fmi3Boolean no_set_before,
    fmi3Boolean *needs_event, fmi3Boolean *terminate, fmi3Boolean *returns_early, fmi3Float64 *last_time_s)
{
    instance *of = c;
    *needs_event = false;
    *terminate = false;
    *returns_early = false;
    const fmi3Status status = stepped(of, time_s, step_s);
    *last_time_s = (status == fmi3Error) ? servotwin_fmu_time_s(&of->fmu) : (time_s + step_s);
    return status;
}
