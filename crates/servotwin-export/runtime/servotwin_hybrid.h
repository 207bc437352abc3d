/*
 * The hybrid twin: the virtual twin and the diagnosis beside an actuator, one call for each sample. All state is in one
 * struct, so there may be several.
 */
#ifndef SERVOTWIN_HYBRID_H
#define SERVOTWIN_HYBRID_H

#include "servotwin_session.h"
#include "servotwin_twin.h"

typedef struct {
    servotwin_twin twin;
    servotwin_session session;
    bool is_settled; /* the twin has found a beginning */
    double parameters[SERVOTWIN_TWIN_PARAMETERS]; /* of the twin */
    /* Inputs as the twin received them, and the last value and difference of each on its bus. */
    servotwin_knot accepted[SERVOTWIN_TWIN_INPUTS];
    bool has_last[SERVOTWIN_TWIN_INPUTS];
    double last[SERVOTWIN_TWIN_INPUTS];
    double difference_per_s[SERVOTWIN_TWIN_INPUTS];
    double expected[SERVOTWIN_SENSORS]; /* what the twin expects of the sensors, SI */
} servotwin_hybrid;

/* The variables of the twin that the sensors show. */
extern const int32_t servotwin_twin_sensors[];

/* Clears everything. Returns false, and nothing may be used, if this build rounds otherwise than in training. */
bool servotwin_hybrid_start(servotwin_hybrid *hybrid);

/*
 * Takes one sample: the inputs of the system and the values of the sensors, SI; NaN is a missing value. Returns the result,
 * or a null pointer if the twin cannot be simulated; the next sample then starts it anew. The first sample searches for
 * the steady state and takes longer.
 */
const servotwin_outcome *servotwin_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured);

/* From the next sample on, a parameter of the twin has this value. */
void servotwin_hybrid_set_parameter(servotwin_hybrid *hybrid, int32_t parameter, double value);

#endif
