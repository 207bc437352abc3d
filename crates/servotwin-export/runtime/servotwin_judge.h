/* The judgement of one window: bands, trees and boosted trees. */
#ifndef SERVOTWIN_JUDGE_H
#define SERVOTWIN_JUDGE_H

#include "servotwin_exact.h"
#include "servotwin_models.h"
#include "servotwin_windows.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A hypothesis is healthy (0), or an action of an actuator. */
#define SERVOTWIN_HEALTHY 0

/* The last window of a length. */
typedef struct {
    bool has_judged; /* the other members have a meaning */
    bool is_in_band; /* every residual is in its band */
    bool is_novel; /* the window is unlike all training data */
    int32_t worst_sensor; /* the largest residual in parts of its band */
    servotwin_real worst;
    int32_t of_trees; /* hypothesis of the trees; SERVOTWIN_NONE in band */
    int32_t detail_of_trees;
    int32_t likeliest; /* hypothesis of the boosted trees */
    int32_t detail; /* their detail of it, and its probability */
    servotwin_real detail_probability;
    servotwin_real probabilities[SERVOTWIN_HYPOTHESES]; /* of each hypothesis by the boosted trees */
} servotwin_judgement;

/* Working memory; nothing in it lasts from one window to the next. */
typedef struct {
    servotwin_real rows[SERVOTWIN_VIEWS][SERVOTWIN_FEATURES];
    servotwin_real paired[SERVOTWIN_FEATURES]; /* the row that reads no unpaired sensor */
    servotwin_window reordered;
} servotwin_scratch;

/* The actuator of a hypothesis other than healthy, and its action. */
int32_t servotwin_actuator_of(int32_t hypothesis);
int32_t servotwin_action_of(int32_t hypothesis);
int32_t servotwin_hypothesis_of(int32_t actuator, int32_t action);

void servotwin_forget(servotwin_judgement *judgement);

/* Judges a full window. Masked actuators are no possible answers; another actuator lacks each unpaired sensor. */
void servotwin_judge(servotwin_judgement *judgement, servotwin_scratch *scratch, int32_t length,
    const servotwin_window *window, const bool *is_masked, const bool *stands_in, const bool *unpaired);

/* Whether trees and boosted trees agree on a hypothesis, and the window is not novel. */
bool servotwin_agrees_on(const servotwin_judgement *judgement, int32_t length, int32_t hypothesis);

/* The largest share of a deviation that an actuator has in common with another one. */
servotwin_real servotwin_common_mode(int32_t actuator, const servotwin_window *window, int32_t length);

/* Distance of a row from the training data of healthy (0) or an action (1 ...), in parts of what counts as known. */
servotwin_real servotwin_novelty(int32_t length, int32_t known, const servotwin_real *row);

/* The detail on which trees and boosted trees agree; SERVOTWIN_NONE otherwise. */
int32_t servotwin_agreed_detail(const servotwin_judgement *judgement);

#ifdef __cplusplus
}
#endif

#endif
