/*
 * The sequential test that raises actions (matrix CuSum): evidence for each hypothesis against every other one gathers
 * from window to window, and an action may be raised where all of it reaches its limits.
 */
#ifndef SERVOTWIN_DECISION_H
#define SERVOTWIN_DECISION_H

#include "servotwin_exact.h"
#include "servotwin_judge.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The evidence of one window length, nats. */
typedef struct {
    servotwin_real of_pairs[SERVOTWIN_HYPOTHESES][SERVOTWIN_HYPOTHESES];
    servotwin_real change; /* for any change */
    servotwin_real unknown; /* for a change that resembles no training data */
} servotwin_evidence;

void servotwin_evidence_clear(servotwin_evidence *evidence);

/* Adds the evidence of a new window. */
void servotwin_evidence_take(servotwin_evidence *evidence, int32_t length, const servotwin_judgement *judgement);

/* The smallest evidence for a hypothesis against any other, in parts of its limit. It may be raised from 1 on. */
servotwin_real servotwin_margin(const servotwin_evidence *evidence, int32_t length, int32_t claim);

/* The same for a fault of an actuator, whatever the action. */
servotwin_real servotwin_margin_of_actuator(const servotwin_evidence *evidence, int32_t length, int32_t actuator);

/* Evidence of any change, and of an unknown change, in parts of the limit. */
servotwin_real servotwin_evidence_of_change(const servotwin_evidence *evidence, int32_t length);
servotwin_real servotwin_evidence_of_unknown(const servotwin_evidence *evidence, int32_t length);

#ifdef __cplusplus
}
#endif

#endif
