/* The interface of FMI 2.0 for co-simulation and model exchange. */
#include "servotwin_fmu.h"
#include "servotwin_token.h"

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);

typedef struct {
    fmi2CallbackLogger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;

typedef struct {
    servotwin_fmu fmu;
    fmi2CallbackFunctions callbacks;
    char name[64];
    bool has_warned;
} instance;

static fmi2Status logged(const instance *of, fmi2Status status, const char *why)
{
    if (of->callbacks.logger != NULL) {
        const char *category = (status == fmi2Warning) ? "warning" : "error";
        of->callbacks.logger(of->callbacks.componentEnvironment, of->name, status, category, "%s", why);
    }
    return status;
}

#define NAME(name) fmi2##name
#define STATE(verb) fmi2##verb##FMUstate
#define DESERIALIZE fmi2DeSerializeFMUstate
#include "servotwin_fmi.h"

NOTHING_TO_DO(fmi2EnterInitializationMode)

FUNCTION(const char *, fmi2GetTypesPlatform, void)
{
    return "default";
}

FUNCTION(const char *, fmi2GetVersion, void)
{
    return "2.0";
}

FUNCTION(fmi2Status, fmi2SetDebugLogging,
    fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    return fmi2OK;
}

FUNCTION(fmi2Component, fmi2Instantiate,
    fmi2String name, fmi2Type type, fmi2String token, fmi2String resources, const fmi2CallbackFunctions *callbacks,
    fmi2Boolean visible, fmi2Boolean logging)
{
    instance *of = NULL;
    const bool is_provided = (type == fmi2CoSimulation) || SERVOTWIN_FMU_HAS_MODEL_EXCHANGE;
    if (is_provided && (token != NULL) && (strcmp(token, SERVOTWIN_TOKEN) == 0)) {
        of = calloc(1U, sizeof *of);
    }
    if (of != NULL) {
        servotwin_fmu_reset(&of->fmu);
        if (callbacks != NULL) {
            of->callbacks = *callbacks;
        }
        (void)strncpy(of->name, (name != NULL) ? name : "", sizeof of->name - 1U);
    }
    return of;
}

FUNCTION(fmi2Status, fmi2SetupExperiment,
    fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
    fmi2Real stop)
{
    instance *of = c;
    return well(of, servotwin_fmu_start_at(&of->fmu, start), SERVOTWIN_FMU_NO_TIME);
}

FUNCTION(fmi2Status, fmi2GetReal, fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2Real value[])
{
    instance *of = c;
    return well(of, servotwin_fmu_get(&of->fmu, vr, count, value), SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi2Status, fmi2SetReal,
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Real value[])
{
    instance *of = c;
    return well(of, servotwin_fmu_set(&of->fmu, vr, count, value), SERVOTWIN_FMU_NOT_SET);
}

/* There are no variables of other types. */
#define NO_VARIABLES(type) \
    FUNCTION(fmi2Status, fmi2Get##type, fmi2Component c, const fmi2ValueReference vr[], size_t count, fmi2##type value[]) \
    { \
        return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN); \
    } \
    FUNCTION(fmi2Status, fmi2Set##type, fmi2Component c, const fmi2ValueReference vr[], size_t count, \
        const fmi2##type value[]) \
    { \
        return well(c, count == 0U, SERVOTWIN_FMU_UNKNOWN); \
    }

NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

FUNCTION(fmi2Status, fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate saved, size_t *size)
{
    *size = SERVOTWIN_FMU_BYTES;
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetDirectionalDerivative,
    fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count, const fmi2ValueReference knowns[],
    size_t known_count, const fmi2Real seeds[], fmi2Real sensitivities[])
{
    instance *of = c;
    return well(of,
        servotwin_fmu_directional(&of->fmu, unknowns, unknown_count, knowns, known_count, seeds, sensitivities),
        SERVOTWIN_FMU_NO_DERIVATIVE);
}

/* ------------------------------------------------------------ Model exchange. */

FUNCTION(fmi2Status, fmi2NewDiscreteStates, fmi2Component c, fmi2EventInfo *info)
{
    instance *of = c;
    (void)memset(info, 0, sizeof *info);
    info->nextEventTimeDefined = servotwin_fmu_tick(&of->fmu, &info->nextEventTime) ? 1 : 0;
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2CompletedIntegratorStep,
    fmi2Component c, fmi2Boolean no_set_before, fmi2Boolean *enter_event_mode, fmi2Boolean *terminate)
{
    *enter_event_mode = 0;
    *terminate = 0;
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetDerivatives, fmi2Component c, fmi2Real derivatives[], size_t count)
{
    instance *of = c;
    return well(of, servotwin_fmu_derivatives(&of->fmu, derivatives, count), SERVOTWIN_FMU_UNKNOWN);
}

FUNCTION(fmi2Status, fmi2GetEventIndicators, fmi2Component c, fmi2Real indicators[], size_t count)
{
    return well(c, count == 0U, "there are no event indicators");
}

/* ------------------------------------------------------------- Co-simulation. */

FUNCTION(fmi2Status, fmi2SetRealInputDerivatives,
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer order[], const fmi2Real value[])
{
    return well(c, count == 0U, "inputs are held over a step");
}

FUNCTION(fmi2Status, fmi2GetRealOutputDerivatives,
    fmi2Component c, const fmi2ValueReference vr[], size_t count, const fmi2Integer order[], fmi2Real value[])
{
    return well(c, count == 0U, "outputs have no derivatives");
}

FUNCTION(fmi2Status, fmi2DoStep, fmi2Component c, fmi2Real time_s, fmi2Real step_s, fmi2Boolean no_set_before)
{
    return stepped(c, time_s, step_s);
}

FUNCTION(fmi2Status, fmi2CancelStep, fmi2Component c)
{
    return failed(c, "no step is pending");
}

FUNCTION(fmi2Status, fmi2GetStatus, fmi2Component c, fmi2StatusKind kind, fmi2Status *value)
{
    return fmi2Discard;
}

FUNCTION(fmi2Status, fmi2GetRealStatus, fmi2Component c, fmi2StatusKind kind, fmi2Real *value)
{
    const instance *of = c;
    *value = servotwin_fmu_time_s(&of->fmu);
    return (kind == fmi2LastSuccessfulTime) ? fmi2OK : fmi2Discard;
}

FUNCTION(fmi2Status, fmi2GetIntegerStatus, fmi2Component c, fmi2StatusKind kind, fmi2Integer *value)
{
    return fmi2Discard;
}

FUNCTION(fmi2Status, fmi2GetBooleanStatus, fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value)
{
    *value = 0;
    return (kind == fmi2Terminated) ? fmi2OK : fmi2Discard;
}

FUNCTION(fmi2Status, fmi2GetStringStatus, fmi2Component c, fmi2StatusKind kind, fmi2String *value)
{
    return fmi2Discard;
}
