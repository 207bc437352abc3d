/* The calls of a hybrid twin, recorded for `servotwin prove --vectors`. Not part of an export. */
#include "mcdc_hybrid.h"

#include "mcdc.h"

bool mcdc_hybrid_start(servotwin_hybrid *hybrid)
{
    mcdc_record(true);
    const bool rounds_twice = servotwin_hybrid_start(hybrid);
    mcdc_record(false);
    return rounds_twice;
}

const servotwin_outcome *mcdc_hybrid_push(servotwin_hybrid *hybrid, const double *inputs, const double *measured)
{
    mcdc_record(true);
    const servotwin_outcome *outcome = servotwin_hybrid_push(hybrid, inputs, measured);
    mcdc_record(false);
    return outcome;
}
