/* Entry points for the hybrid twin in `servotwin prove`. Not part of an export. */
#include "servotwin_hybrid.h"

#include <stddef.h>

uint64_t prove_hybrid_size(void);
uint64_t prove_hybrid_size(void)
{
    return (uint64_t)sizeof(servotwin_hybrid);
}

int32_t prove_hybrid_start(servotwin_hybrid *hybrid);
int32_t prove_hybrid_start(servotwin_hybrid *hybrid)
{
    return servotwin_hybrid_start(hybrid) ? 1 : 0;
}

/* Writes finding, alarm and since when, and the confidence. Returns what the twin expects, or a null pointer without one. */
const double *prove_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured, int64_t *integers, double *confidence);
const double *prove_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured, int64_t *integers, double *confidence)
{
    const servotwin_outcome *outcome = servotwin_hybrid_push(hybrid, inputs, measured);
    if (outcome != NULL) {
        integers[0] = (int64_t)outcome->finding;
        integers[1] = (int64_t)outcome->alarm;
        integers[2] = (int64_t)outcome->since_sample;
        *confidence = outcome->confidence;
    }
    return (outcome != NULL) ? hybrid->expected : NULL;
}

/* The flight control computer follows the reaction to an action; without one (-1) it undoes those of the actuator. */
void prove_hybrid_command(servotwin_hybrid *hybrid, int32_t actuator, int32_t action, int32_t detail);
void prove_hybrid_command(servotwin_hybrid *hybrid, int32_t actuator, int32_t action, int32_t detail)
{
    if (action < 0) {
        (void)servotwin_hybrid_release(hybrid, actuator);
    } else {
        (void)servotwin_hybrid_follow(hybrid, servotwin_reaction_to(actuator, action, detail));
    }
}

int32_t prove_hybrid_set(servotwin_hybrid *hybrid, int32_t parameter, double value);
int32_t prove_hybrid_set(servotwin_hybrid *hybrid, int32_t parameter, double value)
{
    return servotwin_hybrid_set_parameter(hybrid, parameter, value) ? 1 : 0;
}
