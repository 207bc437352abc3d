#include "servotwin_models.h"

#include "servotwin_math.h"

#include <stdbool.h>
#include <stddef.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* Lower limit of a probability before its logarithm is taken. */
#define LEAST_PROBABILITY 1e-15

int32_t servotwin_leaf(const servotwin_branches *branches, int32_t tree, const servotwin_real *row)
{
    int32_t node = branches->roots[tree];
    for (int32_t test = 0; (test < branches->depth) && (node >= 0); test++) {
        const uint32_t feature = branches->features[node];
        const servotwin_real value = row[feature & (SERVOTWIN_MISSING_LEFT - 1U)];
        bool goes_left = (value <= branches->thresholds[node]);
        if (value != value) {
            goes_left = (feature & SERVOTWIN_MISSING_LEFT) != 0U;
        }
        node = goes_left ? branches->left[node] : branches->right[node];
    }
    return -1 - node;
}

int32_t servotwin_largest(const servotwin_real *values, int32_t count)
{
    int32_t place = 0;
    for (int32_t i = 1; i < count; i++) {
        if (values[i] > values[place]) {
            place = i;
        }
    }
    return place;
}

/* Turns logarithms, of which at least one is finite, into shares that sum to one. */
static void softmax(servotwin_real *values, int32_t count)
{
    const servotwin_real largest = values[servotwin_largest(values, count)];
    servotwin_real sum = 0.0;
    for (int32_t i = 0; i < count; i++) {
        const servotwin_real below = values[i] - largest;
        values[i] = servotwin_exp(below);
        sum = sum + values[i];
    }
    for (int32_t i = 0; i < count; i++) {
        values[i] = values[i] / sum;
    }
}

/* Makes probabilities more or less certain: p^(1/T), normalized. */
static void scale(servotwin_real *shares, int32_t count, servotwin_real inverse_temperature)
{
    servotwin_real largest = shares[servotwin_largest(shares, count)];
    servotwin_real sum = 0.0;
    if (largest < LEAST_PROBABILITY) {
        largest = LEAST_PROBABILITY;
    }
    for (int32_t i = 0; i < count; i++) {
        const servotwin_real share = (shares[i] > LEAST_PROBABILITY) ? shares[i] : LEAST_PROBABILITY;
        const servotwin_real relative = share / largest;
        const servotwin_real logarithm = servotwin_log(relative);
        const servotwin_real scaled = logarithm * inverse_temperature;
        shares[i] = servotwin_exp(scaled);
        sum = sum + shares[i];
    }
    for (int32_t i = 0; i < count; i++) {
        shares[i] = shares[i] / sum;
    }
}

/* Shares as the trees give them. */
static void boost(const servotwin_stage *stage, const servotwin_real *row, servotwin_real *shares)
{
    const servotwin_boosted *boosted = stage->boosted;
    for (int32_t class_place = 0; class_place < stage->classes; class_place++) {
        shares[class_place] = boosted->start[class_place];
    }
    for (int32_t tree = 0; tree < stage->branches.trees; tree++) {
        const int32_t leaf = servotwin_leaf(&stage->branches, tree, row);
        const servotwin_real *values = &boosted->values[leaf * boosted->outputs];
        for (int32_t output = 0; output < boosted->outputs; output++) {
            const int32_t class_place = boosted->output_classes[output];
            shares[class_place] = shares[class_place] + values[output];
        }
    }
    softmax(shares, stage->classes);
}

void servotwin_shares(const servotwin_stage *stage, const servotwin_real *row, servotwin_real *shares)
{
    boost(stage, row, shares);
    scale(shares, stage->classes, stage->boosted->inverse_temperature);
}

servotwin_answer servotwin_decide(const servotwin_stage *stage, const servotwin_real *row)
{
    servotwin_answer answer;
    if (stage->cart != NULL) {
        const int32_t leaf = servotwin_leaf(&stage->branches, 0, row);
        answer.decided = stage->names[stage->cart->decisions[leaf]];
        answer.probability = stage->cart->probabilities[leaf];
    } else {
        servotwin_real shares[SERVOTWIN_MOST_CLASSES] = { 0 };
        boost(stage, row, shares);
        const int32_t likeliest = servotwin_largest(shares, stage->classes);
        scale(shares, stage->classes, stage->boosted->inverse_temperature);
        answer.decided = stage->names[likeliest];
        answer.probability = shares[likeliest];
    }
    return answer;
}

/* Asks a stage for an actuator; without the stage, the answer is `otherwise`, and certain. */
static servotwin_answer ask(
    const servotwin_hierarchy *hierarchy, int32_t place, int32_t actuator, const servotwin_real *const *views,
    int32_t otherwise)
{
    servotwin_answer answer = { otherwise, 1.0 };
    if (place != SERVOTWIN_NONE) {
        const servotwin_stage *stage = &hierarchy->stages[place];
        answer = servotwin_decide(stage, views[(stage->reads_own_view != 0) ? actuator : 0]);
    }
    return answer;
}

servotwin_diagnosis servotwin_diagnose(
    const servotwin_hierarchy *hierarchy, const servotwin_real *paired, const servotwin_real *const *views)
{
    servotwin_diagnosis said = { SERVOTWIN_NONE, SERVOTWIN_NONE, SERVOTWIN_NONE, 1.0, 1.0 };
    const servotwin_answer first = ask(hierarchy, hierarchy->actuator_stage, 0, &paired, 0);
    said.confidence = first.probability;
    if (first.decided < hierarchy->actuators) {
        const int32_t actuator = first.decided;
        const servotwin_answer action = ask(hierarchy, hierarchy->action_stages[actuator], actuator, views, SERVOTWIN_NONE);
        said.actuator = actuator;
        said.action = action.decided;
        said.confidence = said.confidence * action.probability;
        if (action.decided != SERVOTWIN_NONE) {
            const servotwin_answer detail = servotwin_detail(hierarchy, views, actuator, action.decided);
            said.detail = detail.decided;
            said.detail_confidence = detail.probability;
        }
    }
    return said;
}

servotwin_answer servotwin_detail(
    const servotwin_hierarchy *hierarchy, const servotwin_real *const *views, int32_t actuator, int32_t action)
{
    const int32_t place = (actuator * hierarchy->actions) + action;
    return ask(hierarchy, hierarchy->detail_stages[place], actuator, views, SERVOTWIN_NONE);
}

/* Writes the probability of healthy to the first place, and that of each actuator to the first of its actions. */
static void share_among_actuators(
    const servotwin_hierarchy *hierarchy, const servotwin_real *paired, servotwin_real *into)
{
    if (hierarchy->actuator_stage == SERVOTWIN_NONE) {
        into[1] = 1.0;
    } else {
        const servotwin_stage *stage = &hierarchy->stages[hierarchy->actuator_stage];
        servotwin_real shares[SERVOTWIN_MOST_CLASSES] = { 0 };
        servotwin_shares(stage, paired, shares);
        for (int32_t class_place = 0; class_place < stage->classes; class_place++) {
            const int32_t actuator = stage->names[class_place];
            const int32_t place = (actuator < hierarchy->actuators) ? (1 + (actuator * hierarchy->actions)) : 0;
            into[place] = shares[class_place];
        }
    }
}

/* Divides the probability of an actuator among its actions. */
static void share_among_actions(
    const servotwin_hierarchy *hierarchy, const servotwin_real *const *views, int32_t actuator, servotwin_real *own)
{
    const servotwin_real of_actuator = own[0];
    const int32_t place = hierarchy->action_stages[actuator];
    if (place == SERVOTWIN_NONE) {
        for (int32_t action = 0; action < hierarchy->actions; action++) {
            own[action] = of_actuator / (servotwin_real)hierarchy->actions;
        }
    } else {
        const servotwin_stage *stage = &hierarchy->stages[place];
        servotwin_real shares[SERVOTWIN_MOST_CLASSES] = { 0 };
        own[0] = 0.0;
        servotwin_shares(stage, views[(stage->reads_own_view != 0) ? actuator : 0], shares);
        for (int32_t class_place = 0; class_place < stage->classes; class_place++) {
            own[stage->names[class_place]] = of_actuator * shares[class_place];
        }
    }
}

void servotwin_probabilities(const servotwin_hierarchy *hierarchy, const servotwin_real *paired,
    const servotwin_real *const *views, servotwin_real *into)
{
    const int32_t count = 1 + (hierarchy->actuators * hierarchy->actions);
    for (int32_t place = 0; place < count; place++) {
        into[place] = 0.0;
    }
    share_among_actuators(hierarchy, paired, into);
    for (int32_t actuator = 0; actuator < hierarchy->actuators; actuator++) {
        share_among_actions(hierarchy, views, actuator, &into[1 + (actuator * hierarchy->actions)]);
    }
}

bool servotwin_models_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
