/* The calls of a hybrid twin, recorded for `servotwin prove --vectors`. Not part of an export. */
#ifndef MCDC_HYBRID_H
#define MCDC_HYBRID_H

#include "servotwin_hybrid.h"

bool mcdc_hybrid_start(servotwin_hybrid *hybrid);
const servotwin_outcome *mcdc_hybrid_push(servotwin_hybrid *hybrid, const double *inputs, const double *measured);

#endif
