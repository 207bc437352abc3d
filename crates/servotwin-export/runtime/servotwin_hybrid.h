/*
 * The hybrid twin: the virtual twin and the diagnosis beside an actuator, one call for each sample. All state is in one
 * struct, so there may be several.
 */
#ifndef SERVOTWIN_HYBRID_H
#define SERVOTWIN_HYBRID_H

#include "servotwin_exact.h"
#include "servotwin_session.h"
#include "servotwin_twin.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    servotwin_twin twin;
    servotwin_session session;
    bool is_settled; /* the twin has found a beginning */
    double parameters[SERVOTWIN_TWIN_PARAMETERS]; /* of the twin while no reaction stands */
    double parameters_in_force[SERVOTWIN_TWIN_PARAMETERS];
    /* The reactions that stand, in the order of actuators, and the actuators that the inputs show as off. */
    int32_t standing;
    int32_t reactions[SERVOTWIN_TWIN_MOST_REACTIONS];
    bool is_seen_off[SERVOTWIN_ACTUATORS];
    /* Inputs as the twin received them, and the last value and difference of each on its bus. */
    servotwin_knot accepted[SERVOTWIN_TWIN_INPUTS];
    bool has_last[SERVOTWIN_TWIN_INPUTS];
    double last[SERVOTWIN_TWIN_INPUTS];
    double difference_per_s[SERVOTWIN_TWIN_INPUTS];
    double expected[SERVOTWIN_SENSORS]; /* what the twin expects of the sensors, SI */
} servotwin_hybrid;

/* The variables of the twin that the sensors show. */
extern const int32_t servotwin_twin_sensors[];

/*
 * Runs a sample with a known answer through twin and diagnosis, then clears everything; takes as long as a first sample.
 * The actuator may be in motion, but the twin begins at rest: at first it settles, without judgement.
 * Returns false, and nothing may be used, if this build computes otherwise than in training.
 */
bool servotwin_hybrid_start(servotwin_hybrid *hybrid);

/*
 * Takes one sample: the inputs of the system and the values of the sensors, SI. NaN is a missing value, and so is one that
 * its sensor cannot have. Returns the result, or a null pointer if the twin cannot be simulated: what is raised stands,
 * and the next sample starts the twin anew. The first sample searches for the steady state and takes longer. Where the
 * inputs are those of a reaction that switches off, the actuator counts as off.
 */
const servotwin_outcome *servotwin_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured);

/* What the study does after an action: a place in servotwin_twin_reactions, or SERVOTWIN_NONE if it does nothing. */
int32_t servotwin_reaction_to(int32_t actuator, int32_t action, int32_t detail);

/*
 * The flight control computer has done what a reaction says: from the next sample on, twin and diagnosis expect it. Returns
 * false, and does nothing, if there is no such reaction.
 */
bool servotwin_hybrid_follow(servotwin_hybrid *hybrid, int32_t reaction);

/* It has undone all reactions of an actuator, which is on. Returns false if there is no such actuator. */
bool servotwin_hybrid_release(servotwin_hybrid *hybrid, int32_t actuator);

/*
 * From the next sample on, a parameter of the twin has this value while no reaction changes it. Returns false, and changes
 * nothing, if there is no such parameter or the value is not finite.
 */
bool servotwin_hybrid_set_parameter(servotwin_hybrid *hybrid, int32_t parameter, double value);

#ifdef __cplusplus
}
#endif

#endif
