#include "servotwin_hybrid.h"

#include "servotwin_tables.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* The slope of a signal from its last two differences, such that it does not swing over. */
static double slope_of(double now, double before)
{
    const double size = fabs(now);
    const double size_before = fabs(before);
    const double most = 3.0 * ((size < size_before) ? size : size_before);
    const double of_now = 1.5 * now;
    const double of_before = 0.5 * before;
    const double slope = of_now - of_before;
    const double at_least = (slope < -most) ? -most : slope;
    return (at_least > most) ? most : at_least;
}

/* Takes an input from its bus. The twin keeps the previous value of one that is not plausible. */
static void accept_input(servotwin_hybrid *hybrid, int32_t input, double told)
{
    const servotwin_input *known = &servotwin_inputs[input];
    const bool fits = (told >= known->least) && (told <= known->largest) && (fabs(told) <= DBL_MAX);
    const double value = fits ? told : hybrid->accepted[input].value;
    const double last = hybrid->has_last[input] ? hybrid->last[input] : value;
    const double before = hybrid->difference_per_s[input];
    const double rise = value - last;
    const double difference = rise / servotwin_tuning.period_s;
    hybrid->difference_per_s[input] = difference;
    hybrid->has_last[input] = true;
    hybrid->last[input] = value;
    hybrid->accepted[input].value = value;
    hybrid->accepted[input].slope_per_s = slope_of(difference, before);
}

bool servotwin_hybrid_start(servotwin_hybrid *hybrid)
{
    (void)memset(hybrid, 0, sizeof *hybrid);
    (void)memcpy(hybrid->parameters, servotwin_twin_parameters, sizeof hybrid->parameters);
    (void)memcpy(hybrid->accepted, servotwin_twin_defaults, sizeof hybrid->accepted);
    return servotwin_session_start(&hybrid->session);
}

const servotwin_outcome *servotwin_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured)
{
    const servotwin_outcome *outcome = NULL;
    for (int32_t input = 0; input < SERVOTWIN_TWIN_INPUTS; input++) {
        accept_input(hybrid, input, inputs[input]);
    }
    if (hybrid->is_settled) {
        hybrid->is_settled = servotwin_twin_step(&hybrid->twin, hybrid->accepted);
    } else {
        hybrid->is_settled = servotwin_twin_start(&hybrid->twin, hybrid->parameters, hybrid->accepted);
    }
    if (hybrid->is_settled) {
        for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
            hybrid->expected[sensor] = hybrid->twin.variables[servotwin_twin_sensors[sensor]];
        }
        outcome = servotwin_session_push(&hybrid->session, inputs, measured, hybrid->expected);
    }
    return outcome;
}

void servotwin_hybrid_set_parameter(servotwin_hybrid *hybrid, int32_t parameter, double value)
{
    hybrid->parameters[parameter] = value;
    servotwin_twin_load(&hybrid->twin, hybrid->parameters);
}
