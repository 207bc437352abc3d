#include "servotwin_fmu.h"

#include "servotwin_tables.h"

#include <math.h>
#include <string.h>

#define FIRST_INPUT ((uint32_t)SERVOTWIN_TWIN_STATES)

/* A sample is due this part of a period early, because a host adds up its steps. */
#define EARLY 1e-6

void servotwin_fmu_reset(servotwin_fmu *fmu)
{
    (void)memset(fmu, 0, sizeof *fmu);
    fmu->is_exact = servotwin_hybrid_start(&fmu->hybrid);
    for (int32_t input = 0; input < SERVOTWIN_TWIN_INPUTS; input++) {
        fmu->inputs[input] = servotwin_twin_defaults[input].value;
    }
}

bool servotwin_fmu_begin(servotwin_fmu *fmu)
{
    fmu->time_s = fmu->start_s;
    fmu->is_started = fmu->is_exact;
    return fmu->is_exact;
}

double servotwin_fmu_time_s(const servotwin_fmu *fmu)
{
    return fmu->time_s;
}

bool servotwin_fmu_value(servotwin_fmu *fmu, uint32_t reference, double *value)
{
    bool is_known = true;
    if (reference == SERVOTWIN_FMU_TIME) {
        *value = fmu->time_s;
    } else if ((reference - FIRST_INPUT) < (uint32_t)SERVOTWIN_TWIN_INPUTS) {
        *value = fmu->inputs[reference - FIRST_INPUT];
    } else if ((reference - SERVOTWIN_FMU_MEASURED) < (uint32_t)SERVOTWIN_SENSORS) {
        *value = fmu->measured[reference - SERVOTWIN_FMU_MEASURED];
    } else if ((reference - SERVOTWIN_FMU_SWITCHED_OFF) < (uint32_t)SERVOTWIN_ACTUATORS) {
        *value = fmu->hybrid.session.is_off[reference - SERVOTWIN_FMU_SWITCHED_OFF] ? 1.0 : 0.0;
    } else if (reference == SERVOTWIN_FMU_RESET_ALARM) {
        *value = fmu->reset_alarm;
    } else if ((reference - SERVOTWIN_FMU_EXPECTED) < (uint32_t)SERVOTWIN_SENSORS) {
        *value = fmu->hybrid.expected[reference - SERVOTWIN_FMU_EXPECTED];
    } else if ((reference - SERVOTWIN_FMU_DIAGNOSIS) < (uint32_t)SERVOTWIN_FMU_RESULTS) {
        *value = fmu->results[reference - SERVOTWIN_FMU_DIAGNOSIS];
    } else if ((reference - SERVOTWIN_FMU_PARAMETER) < (uint32_t)SERVOTWIN_TWIN_PARAMETERS) {
        *value = fmu->hybrid.parameters[reference - SERVOTWIN_FMU_PARAMETER];
    } else {
        is_known = false;
    }
    return is_known;
}

static void switch_actuator(servotwin_session *session, int32_t actuator, bool is_off)
{
    if (is_off && !session->is_off[actuator]) {
        servotwin_session_switched_off(session, actuator);
    } else if (!is_off && session->is_off[actuator]) {
        servotwin_session_release(session, actuator);
    } else {
        /* Nothing changes. */
    }
}

bool servotwin_fmu_change(servotwin_fmu *fmu, uint32_t reference, double value)
{
    const uint32_t input = reference - FIRST_INPUT;
    const uint32_t measured = reference - SERVOTWIN_FMU_MEASURED;
    const uint32_t actuator = reference - SERVOTWIN_FMU_SWITCHED_OFF;
    const uint32_t parameter = reference - SERVOTWIN_FMU_PARAMETER;
    bool is_set = true;
    if (input < (uint32_t)SERVOTWIN_TWIN_INPUTS) {
        fmu->inputs[input] = value;
    } else if (measured < (uint32_t)SERVOTWIN_SENSORS) {
        fmu->measured[measured] = value;
    } else if ((actuator < (uint32_t)SERVOTWIN_ACTUATORS) && ((value == 0.0) || (value == 1.0))) {
        switch_actuator(&fmu->hybrid.session, (int32_t)actuator, value == 1.0);
    } else if ((reference == SERVOTWIN_FMU_RESET_ALARM) && ((value == 0.0) || (value == 1.0))) {
        if (value > fmu->reset_alarm) {
            servotwin_session_reset_alarm(&fmu->hybrid.session);
        }
        fmu->reset_alarm = value;
    } else if ((parameter < (uint32_t)SERVOTWIN_TWIN_PARAMETERS)
        && servotwin_fmu_is_within(value, servotwin_fmu_parameter_ranges[parameter])) {
        servotwin_hybrid_set_parameter(&fmu->hybrid, (int32_t)parameter, value);
    } else {
        is_set = false;
    }
    return is_set;
}

/* The number of something that may be none. */
static double number_of(int32_t place)
{
    return (place == SERVOTWIN_NONE) ? 0.0 : ((double)place + 1.0);
}

/* What is raised: of an actuator that is judged, or else the first shutdown that stands for one that is off. */
static const servotwin_raised *what_is_raised(const servotwin_fmu *fmu, const servotwin_outcome *outcome)
{
    const servotwin_raised *raised = &outcome->raised;
    for (int32_t actuator = 0; (actuator < SERVOTWIN_ACTUATORS) && !raised->is_raised; actuator++) {
        raised = &fmu->hybrid.session.stands[actuator];
    }
    return raised;
}

static void take_sample(servotwin_fmu *fmu)
{
    const servotwin_outcome *outcome = servotwin_hybrid_push(&fmu->hybrid, fmu->inputs, fmu->measured);
    double *results = fmu->results;
    fmu->samples++;
    results[SERVOTWIN_FMU_IS_SIMULATED] = (outcome != NULL) ? 1.0 : 0.0;
    if (outcome != NULL) {
        const servotwin_raised *raised = what_is_raised(fmu, outcome);
        results[SERVOTWIN_FMU_FINDING] = (double)outcome->finding;
        results[SERVOTWIN_FMU_ACTUATOR] = number_of(outcome->actuator);
        results[SERVOTWIN_FMU_ACTION] = number_of(outcome->action);
        results[SERVOTWIN_FMU_DETAIL] = number_of(outcome->detail);
        results[SERVOTWIN_FMU_CONFIDENCE] = outcome->confidence;
        results[SERVOTWIN_FMU_ALARM] = (double)outcome->alarm;
        results[SERVOTWIN_FMU_RAISED_ACTUATOR] = raised->is_raised ? number_of(raised->actuator) : 0.0;
        results[SERVOTWIN_FMU_RAISED_ACTION] = raised->is_raised ? number_of(raised->action) : 0.0;
        results[SERVOTWIN_FMU_RAISED_DETAIL] = raised->is_raised ? number_of(raised->detail) : 0.0;
        results[SERVOTWIN_FMU_WORST] = outcome->worst;
        results[SERVOTWIN_FMU_WORST_SENSOR] = number_of(outcome->worst_sensor);
        results[SERVOTWIN_FMU_LOST] = (double)outcome->lost;
    }
}

bool servotwin_fmu_advance(servotwin_fmu *fmu, double time_s, double step_s)
{
    const double period_s = servotwin_tuning.period_s;
    const double samples_at_end = ((time_s + step_s) - fmu->start_s) / period_s;
    while ((double)fmu->samples < (samples_at_end - EARLY)) {
        take_sample(fmu);
    }
    fmu->time_s = time_s + step_s;
    return true;
}

const char *servotwin_fmu_step_warning(double step_s)
{
    const bool is_long = step_s > (servotwin_tuning.period_s * (1.0 + EARLY));
    return is_long ? "a step is longer than the time between samples: measured values are held over several samples, which "
                     "the diagnosis takes for faults of sensors or for something unknown; use the stepSize of DefaultExperiment"
                   : NULL;
}

/* Model exchange is not provided. */

bool servotwin_fmu_set_time(servotwin_fmu *fmu, double time_s)
{
    (void)fmu;
    return isfinite(time_s) != 0;
}

bool servotwin_fmu_set_states(servotwin_fmu *fmu, const double *states, size_t count)
{
    (void)fmu;
    (void)states;
    return count == 0U;
}

bool servotwin_fmu_states(servotwin_fmu *fmu, double *states, size_t count)
{
    (void)fmu;
    (void)states;
    return count == 0U;
}

bool servotwin_fmu_derivatives(servotwin_fmu *fmu, double *derivatives, size_t count)
{
    (void)fmu;
    (void)derivatives;
    return count == 0U;
}

void servotwin_fmu_nominals(double *nominals, size_t count)
{
    (void)nominals;
    (void)count;
}

bool servotwin_fmu_tick(servotwin_fmu *fmu, double *next_s)
{
    (void)fmu;
    (void)next_s;
    return false;
}

bool servotwin_fmu_directional(servotwin_fmu *fmu, const uint32_t *unknowns, size_t unknown_count,
    const uint32_t *knowns, size_t known_count, const double *seeds, double *sensitivities)
{
    (void)fmu;
    (void)unknowns;
    (void)knowns;
    (void)known_count;
    (void)seeds;
    (void)sensitivities;
    return unknown_count == 0U;
}
