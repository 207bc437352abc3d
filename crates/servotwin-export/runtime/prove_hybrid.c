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
