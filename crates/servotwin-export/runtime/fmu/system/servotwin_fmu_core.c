#include "servotwin_fmu.h"

#include "servotwin_random.h"

#include <math.h>
#include <string.h>

#define FIRST_INPUT SERVOTWIN_TWIN_STATES
#define END_OF_INPUTS (SERVOTWIN_TWIN_STATES + SERVOTWIN_TWIN_INPUTS)
#define FIRST_DERIVATIVE (SERVOTWIN_TWIN_SUMS_END - SERVOTWIN_TWIN_STATES)

/* The noise of a sample begins this part of a period early, because a host adds up its steps. */
#define EARLY 1e-6

/* A double of this size has no digits behind the point. */
#define TO_WHOLE 6755399441055744.0

void servotwin_fmu_reset(servotwin_fmu *fmu)
{
    (void)memset(fmu, 0, sizeof *fmu);
    (void)memcpy(fmu->parameters, servotwin_twin_parameters, sizeof fmu->parameters);
    for (int32_t input = 0; input < SERVOTWIN_TWIN_INPUTS; input++) {
        fmu->inputs[input] = servotwin_twin_defaults[input].value;
    }
    fmu->noise = 1.0;
    fmu->is_stale = true;
}

/* The parameters with the faults. */
static void write_parameters(const servotwin_fmu *fmu, double *parameters)
{
    (void)memcpy(parameters, fmu->parameters, sizeof fmu->parameters);
    servotwin_twin_faults(fmu->intensities, parameters);
}

static void take_parameters(servotwin_fmu *fmu)
{
    if (fmu->has_new_parameters) {
        double parameters[SERVOTWIN_TWIN_PARAMETERS];
        write_parameters(fmu, parameters);
        servotwin_twin_load(&fmu->twin, parameters);
        fmu->has_new_parameters = false;
    }
}

/* Before the start, inputs and parameters determine everything. */
static bool settle(servotwin_fmu *fmu)
{
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    double parameters[SERVOTWIN_TWIN_PARAMETERS];
    for (int32_t input = 0; input < SERVOTWIN_TWIN_INPUTS; input++) {
        inputs[input].value = fmu->inputs[input];
        inputs[input].slope_per_s = 0.0;
    }
    write_parameters(fmu, parameters);
    fmu->is_settled = servotwin_twin_start(&fmu->twin, parameters, inputs);
    fmu->has_new_parameters = false;
    return fmu->is_settled;
}

/* Computes all variables if they are stale. */
static bool refresh(servotwin_fmu *fmu)
{
    bool is_well = true;
    if (fmu->is_stale) {
        if (!fmu->is_started) {
            is_well = settle(fmu);
        } else {
            take_parameters(fmu);
            servotwin_twin_refresh(&fmu->twin, fmu->inputs);
        }
        fmu->is_stale = !is_well;
    }
    return is_well;
}

bool servotwin_fmu_begin(servotwin_fmu *fmu)
{
    const bool is_well = refresh(fmu);
    fmu->is_started = is_well;
    return is_well;
}

double servotwin_fmu_time_s(const servotwin_fmu *fmu)
{
    return fmu->twin.time_s + fmu->start_s;
}

/* What a sensor shows of a value: noise that is new at each sample, in the steps of its converter. */
static double shown_by(const servotwin_fmu *fmu, int32_t number, double value)
{
    const servotwin_fmu_sensor *sensor = &servotwin_fmu_sensors[number];
    const double samples = (fmu->twin.time_s / servotwin_twin_control.period_s) + EARLY;
    const uint64_t sample = (samples > 0.0) ? (uint64_t)samples : 0U;
    const uint64_t stream = (sample * (uint64_t)servotwin_fmu_sensor_count) + (uint64_t)number;
    double shown = value;
    if (sensor->noise_parameter >= 0) {
        const double deviation = fmu->parameters[sensor->noise_parameter] * sensor->full_scale;
        const double deviate = servotwin_normal((uint64_t)fmu->seed, stream);
        shown = shown + (deviation * deviate);
    }
    const double bits = (sensor->bits_parameter >= 0) ? fmu->parameters[sensor->bits_parameter] : 0.0;
    if (bits > 0.0) {
        const double step = sensor->range / (double)((uint64_t)1U << (uint32_t)bits);
        /* No digit behind the point is left: the nearest step, of two as near the even one. */
        const double whole = (shown / step) + TO_WHOLE;
        shown = (whole - TO_WHOLE) * step;
    }
    return shown;
}

/* The value of a variable of the twin; that of an output is what its sensor shows. */
static double variable_of(const servotwin_fmu *fmu, uint32_t reference)
{
    double value = fmu->twin.variables[reference];
    if (fmu->noise != 0.0) {
        int32_t number = 0;
        while ((number < servotwin_fmu_sensor_count) && (servotwin_fmu_sensors[number].variable != reference)) {
            number++;
        }
        value = (number < servotwin_fmu_sensor_count) ? shown_by(fmu, number, value) : value;
    }
    return value;
}

bool servotwin_fmu_value(servotwin_fmu *fmu, uint32_t reference, double *value)
{
    bool is_known = true;
    if (reference == SERVOTWIN_FMU_TIME) {
        *value = servotwin_fmu_time_s(fmu);
    } else if (reference < (uint32_t)SERVOTWIN_TWIN_SUMS_END) {
        const bool is_input = (reference >= (uint32_t)FIRST_INPUT) && (reference < (uint32_t)END_OF_INPUTS);
        is_known = is_input || refresh(fmu);
        *value = is_input ? fmu->inputs[reference - (uint32_t)FIRST_INPUT] : variable_of(fmu, reference);
    } else if (reference == SERVOTWIN_FMU_NOISE) {
        *value = fmu->noise;
    } else if (reference == SERVOTWIN_FMU_SEED) {
        *value = fmu->seed;
    } else if ((reference - SERVOTWIN_FMU_PARAMETER) < (uint32_t)SERVOTWIN_TWIN_PARAMETERS) {
        *value = fmu->parameters[reference - SERVOTWIN_FMU_PARAMETER];
    } else if ((reference - SERVOTWIN_FMU_FAULT) < (uint32_t)SERVOTWIN_TWIN_FAULTS) {
        *value = fmu->intensities[reference - SERVOTWIN_FMU_FAULT];
    } else {
        is_known = false;
    }
    return is_known;
}

bool servotwin_fmu_change(servotwin_fmu *fmu, uint32_t reference, double value)
{
    bool is_set = isfinite(value) != 0;
    const uint32_t input = reference - (uint32_t)FIRST_INPUT;
    const uint32_t parameter = reference - SERVOTWIN_FMU_PARAMETER;
    const uint32_t fault = reference - SERVOTWIN_FMU_FAULT;
    if (!is_set) {
        /* No variable can take it. */
    } else if (reference < (uint32_t)SERVOTWIN_TWIN_STATES) {
        /* Some hosts set states one by one. Before the start they follow from inputs and parameters. */
        is_set = fmu->is_started;
        fmu->twin.states[reference] = is_set ? value : fmu->twin.states[reference];
    } else if (input < (uint32_t)SERVOTWIN_TWIN_INPUTS) {
        is_set = servotwin_fmu_is_within(value, servotwin_fmu_input_ranges[input]);
        fmu->inputs[input] = is_set ? value : fmu->inputs[input];
    } else if (parameter < (uint32_t)SERVOTWIN_TWIN_PARAMETERS) {
        is_set = servotwin_fmu_is_within(value, servotwin_fmu_parameter_ranges[parameter]);
        fmu->parameters[parameter] = is_set ? value : fmu->parameters[parameter];
        fmu->has_new_parameters = true;
    } else if (reference == SERVOTWIN_FMU_NOISE) {
        is_set = (value == 0.0) || (value == 1.0);
        fmu->noise = is_set ? value : fmu->noise;
    } else if (reference == SERVOTWIN_FMU_SEED) {
        is_set = (value >= 0.0) && (value <= SERVOTWIN_FMU_LARGEST_SEED) && ((double)(uint64_t)value == value);
        fmu->seed = is_set ? value : fmu->seed;
    } else if (fault < (uint32_t)SERVOTWIN_TWIN_FAULTS) {
        is_set = (value >= 0.0) && (value <= 1.0);
        fmu->intensities[fault] = is_set ? value : fmu->intensities[fault];
        fmu->has_new_parameters = true;
    } else {
        is_set = false;
    }
    fmu->is_stale = true;
    return is_set;
}

bool servotwin_fmu_advance(servotwin_fmu *fmu, double time_s, double step_s)
{
    take_parameters(fmu);
    const bool is_well = servotwin_twin_advance(&fmu->twin, fmu->inputs, (time_s + step_s) - fmu->start_s);
    fmu->is_stale = !is_well;
    return is_well;
}

const char *servotwin_fmu_step_warning(double step_s)
{
    (void)step_s;
    return NULL;
}

bool servotwin_fmu_set_time(servotwin_fmu *fmu, double time_s)
{
    const bool is_time = isfinite(time_s) != 0;
    fmu->twin.time_s = is_time ? (time_s - fmu->start_s) : fmu->twin.time_s;
    return is_time;
}

static bool is_of_states(size_t count)
{
    return count == (size_t)SERVOTWIN_TWIN_STATES;
}

bool servotwin_fmu_set_states(servotwin_fmu *fmu, const double *states, size_t count)
{
    bool fits = is_of_states(count);
    for (size_t i = 0U; fits && (i < count); i++) {
        fits = isfinite(states[i]) != 0;
    }
    if (fits) {
        (void)memcpy(fmu->twin.states, states, sizeof fmu->twin.states);
        fmu->is_stale = true;
    }
    return fits;
}

bool servotwin_fmu_states(servotwin_fmu *fmu, double *states, size_t count)
{
    const bool is_well = is_of_states(count) && refresh(fmu);
    if (is_well) {
        (void)memcpy(states, fmu->twin.variables, sizeof fmu->twin.states);
    }
    return is_well;
}

bool servotwin_fmu_derivatives(servotwin_fmu *fmu, double *derivatives, size_t count)
{
    const bool is_well = is_of_states(count) && refresh(fmu);
    if (is_well) {
        (void)memcpy(derivatives, &fmu->twin.variables[FIRST_DERIVATIVE], sizeof fmu->twin.states);
    }
    return is_well;
}

void servotwin_fmu_nominals(double *nominals, size_t count)
{
    for (size_t i = 0U; i < count; i++) {
        nominals[i] = 1.0 / servotwin_twin_scales[i];
    }
}

bool servotwin_fmu_tick(servotwin_fmu *fmu, double *next_s)
{
    take_parameters(fmu);
    const double next = servotwin_twin_tick_clocks(&fmu->twin, fmu->inputs);
    fmu->is_stale = true;
    *next_s = next + fmu->start_s;
    return isfinite(next) != 0;
}

bool servotwin_fmu_directional(servotwin_fmu *fmu, const uint32_t *unknowns, size_t unknown_count,
    const uint32_t *knowns, size_t known_count, const double *seeds, double *sensitivities)
{
    double directions[END_OF_INPUTS] = { 0.0 };
    double tangents[SERVOTWIN_TWIN_VARIABLES] = { 0.0 };
    bool is_well = refresh(fmu);
    for (size_t i = 0U; is_well && (i < known_count); i++) {
        is_well = knowns[i] < (uint32_t)END_OF_INPUTS;
        if (is_well) {
            directions[knowns[i]] = seeds[i];
        }
    }
    if (is_well) {
        servotwin_twin_tangent(fmu->twin.constants, fmu->twin.variables, directions, tangents);
        (void)memcpy(tangents, directions, sizeof directions);
    }
    for (size_t i = 0U; is_well && (i < unknown_count); i++) {
        is_well = unknowns[i] < (uint32_t)SERVOTWIN_TWIN_SUMS_END;
        if (is_well) {
            sensitivities[i] = tangents[unknowns[i]];
        }
    }
    return is_well;
}
