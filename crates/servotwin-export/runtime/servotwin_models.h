/*
 * Trained models: decision trees (CART), boosted trees, and the hierarchy that asks first for the actuator, then for the
 * action, then for the detail. All data are constant tables; there is no state, no recursion and no allocation.
 *
 * A row is an array of features. A view of a row shows the actuators rotated: view k has actuator k in the first place.
 */
#ifndef SERVOTWIN_MODELS_H
#define SERVOTWIN_MODELS_H

#include "servotwin_exact.h"
#include "servotwin_real.h"

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Most classes of a stage, and most hypotheses: healthy and each action of each actuator. */
#define SERVOTWIN_MOST_CLASSES 32

/* Stands for an actuator, action or detail that is not known. */
#define SERVOTWIN_NONE (-1)

/* Set in the feature of a node where a row without a value (NaN) goes left. */
#define SERVOTWIN_MISSING_LEFT 0x8000U

/* The trees of a stage. A child is another node, or the leaf -1 - child. */
typedef struct {
    int32_t trees;
    int32_t depth; /* most tests on the way to a leaf */
    const int16_t *roots;
    const uint16_t *features;
    const servotwin_real *thresholds; /* a value goes left unless it is larger */
    const int16_t *left;
    const int16_t *right;
} servotwin_branches;

/* One tree that decides: for each leaf its class and the probability of that class. */
typedef struct {
    const uint8_t *decisions;
    const servotwin_real *probabilities;
} servotwin_cart;

/* Trees whose leaves add to the scores of the classes. */
typedef struct {
    int32_t outputs;
    const uint8_t *output_classes; /* the class of each output */
    const servotwin_real *start; /* score of each class before the first tree */
    const servotwin_real *values; /* of each leaf, for each output */
    servotwin_real inverse_temperature;
} servotwin_boosted;

/* One question. Exactly one of `cart` and `boosted` is there. */
typedef struct {
    servotwin_branches branches;
    const servotwin_cart *cart;
    const servotwin_boosted *boosted;
    int32_t classes;
    const uint8_t *names; /* the actuator, action or detail of each class */
    int32_t reads_own_view; /* 1: reads the view of the accused actuator; 0: reads view 0 */
} servotwin_stage;

typedef struct {
    const servotwin_stage *stages;
    int32_t actuators;
    int32_t actions;
    int32_t actuator_stage; /* here and below: the stage, or SERVOTWIN_NONE */
    const int8_t *action_stages; /* of each actuator */
    const int8_t *detail_stages; /* of each actuator and action */
} servotwin_hierarchy;

typedef struct {
    int32_t decided; /* SERVOTWIN_NONE where nothing was asked */
    servotwin_real probability;
} servotwin_answer;

/* Indices of names, or SERVOTWIN_NONE. Healthy is no actuator. */
typedef struct {
    int32_t actuator;
    int32_t action;
    int32_t detail;
    servotwin_real confidence; /* probability that actuator and action are right */
    servotwin_real detail_confidence; /* probability of the detail, given the action */
} servotwin_diagnosis;

/* Index of the largest value; the first of a tie. */
int32_t servotwin_largest(const servotwin_real *values, int32_t count);

/* The leaf that a row reaches in a tree. */
int32_t servotwin_leaf(const servotwin_branches *branches, int32_t tree, const servotwin_real *row);

/* Writes the probability of each class of a stage of boosted trees. */
void servotwin_shares(const servotwin_stage *stage, const servotwin_real *row, servotwin_real *shares);

/* The class that a stage decides. */
servotwin_answer servotwin_decide(const servotwin_stage *stage, const servotwin_real *row);

/*
 * Asks for actuator, action and detail of a row, given in every view. `paired` is the row that tells actuators apart: it
 * reads of none what another one lacks.
 */
servotwin_diagnosis servotwin_diagnose(
    const servotwin_hierarchy *hierarchy, const servotwin_real *paired, const servotwin_real *const *views);

/* Writes the probability of healthy, then of each action actuator by actuator, by boosted trees. */
void servotwin_probabilities(const servotwin_hierarchy *hierarchy, const servotwin_real *paired,
    const servotwin_real *const *views, servotwin_real *into);

/* The detail of a fault with known actuator and action. */
servotwin_answer servotwin_detail(
    const servotwin_hierarchy *hierarchy, const servotwin_real *const *views, int32_t actuator, int32_t action);

#ifdef __cplusplus
}
#endif

#endif
