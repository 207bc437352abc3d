#include "servotwin_judge.h"

#include "servotwin_features.h"
#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#define LEAST_BAND 1e-12
#define LEAST_BAND_PRODUCT 1e-24

int32_t servotwin_actuator_of(int32_t hypothesis)
{
    return (hypothesis - 1) / SERVOTWIN_ACTIONS;
}

int32_t servotwin_action_of(int32_t hypothesis)
{
    return (hypothesis - 1) % SERVOTWIN_ACTIONS;
}

int32_t servotwin_hypothesis_of(int32_t actuator, int32_t action)
{
    return 1 + (actuator * SERVOTWIN_ACTIONS) + action;
}

void servotwin_forget(servotwin_judgement *judgement)
{
    judgement->has_judged = false;
    judgement->is_in_band = true;
    judgement->is_novel = false;
    judgement->worst_sensor = 0;
    judgement->worst = 0.0;
    judgement->of_trees = SERVOTWIN_NONE;
    judgement->detail_of_trees = SERVOTWIN_NONE;
    judgement->likeliest = SERVOTWIN_HEALTHY;
    judgement->detail = SERVOTWIN_NONE;
    judgement->detail_probability = 0.0;
    for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
        judgement->probabilities[i] = 0.0;
    }
}

/* Finds the sensor with the largest residual in parts of its band. */
static void find_worst(servotwin_judgement *judgement, const servotwin_window *window, const servotwin_real *bands)
{
    for (int32_t i = 0; i < SERVOTWIN_WATCHED; i++) {
        const servotwin_real band = (bands[i] > LEAST_BAND) ? bands[i] : LEAST_BAND;
        const servotwin_real size = window->largest[i] / band;
        if (size > judgement->worst) {
            judgement->worst = size;
            judgement->worst_sensor = i;
        }
    }
}

/* Removes masked actuators from the probabilities. */
static void mask(servotwin_real *probabilities, const bool *is_masked)
{
    bool any = false;
    servotwin_real sum = 0.0;
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        if (is_masked[actuator]) {
            any = true;
            for (int32_t action = 0; action < SERVOTWIN_ACTIONS; action++) {
                probabilities[servotwin_hypothesis_of(actuator, action)] = 0.0;
            }
        }
    }
    for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
        sum = sum + probabilities[i];
    }
    if (any && (sum > 0.0)) {
        for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
            probabilities[i] = probabilities[i] / sum;
        }
    }
    if (any && !(sum > 0.0)) {
        probabilities[SERVOTWIN_HEALTHY] = 1.0;
    }
}

/* The share of a deviation that the corresponding sensors of two actuators have in common. */
static servotwin_real common_share(
    const servotwin_common_pair *pair, const servotwin_window *window, const servotwin_real *bands)
{
    servotwin_real sum = 0.0;
    servotwin_real difference = 0.0;
    for (int32_t i = 0; i < pair->sensors; i++) {
        const int32_t a = pair->of_first[i];
        const int32_t b = pair->of_second[i];
        const servotwin_real product = bands[a] * bands[b];
        const servotwin_real weight = 1.0 / ((product > LEAST_BAND_PRODUCT) ? product : LEAST_BAND_PRODUCT);
        const servotwin_real mean_sum = window->mean[a] + window->mean[b];
        const servotwin_real mean_difference = window->mean[a] - window->mean[b];
        const servotwin_real of_sum = mean_sum * mean_sum;
        const servotwin_real of_difference = mean_difference * mean_difference;
        const servotwin_real own = servotwin_covariance(window, a, a) + servotwin_covariance(window, b, b);
        const servotwin_real common = 2.0 * servotwin_covariance(window, a, b);
        const servotwin_real own_and_common = own + common;
        const servotwin_real square_of_sum = own_and_common + of_sum;
        const servotwin_real weighted_sum = weight * square_of_sum;
        const servotwin_real own_less_common = own - common;
        const servotwin_real square_of_difference = own_less_common + of_difference;
        const servotwin_real weighted_difference = weight * square_of_difference;
        sum = sum + weighted_sum;
        difference = difference + weighted_difference;
    }
    const servotwin_real whole = sum + difference;
    return (whole > 0.0) ? (sum / whole) : 0.0;
}

servotwin_real servotwin_common_mode(int32_t actuator, const servotwin_window *window, int32_t length)
{
    servotwin_real largest = 0.0;
    for (int32_t i = 0; i < SERVOTWIN_COMMON_PAIRS; i++) {
        const servotwin_common_pair *pair = &servotwin_common_pairs[i];
        if ((pair->first == actuator) || (pair->second == actuator)) {
            const servotwin_real share = common_share(pair, window, servotwin_lengths[length].bands);
            if (share > largest) {
                largest = share;
            }
        }
    }
    return largest;
}

servotwin_real servotwin_novelty(int32_t length, int32_t known, const servotwin_real *row)
{
    const servotwin_known *of_class = &servotwin_lengths[length].known[known];
    servotwin_real sum = 0.0;
    for (int32_t i = 0; i < of_class->features; i++) {
        const servotwin_real x = row[i];
        const bool is_inside = (x >= of_class->lows[i]) && (x <= of_class->highs[i]);
        const servotwin_real excess = (x > of_class->highs[i]) ? (x - of_class->highs[i]) : (of_class->lows[i] - x);
        const servotwin_real part = excess / of_class->widths[i];
        /* A missing value counts as one. */
        const servotwin_real outside = (part < 1.0) ? part : 1.0;
        sum = sum + (is_inside ? 0.0 : outside);
    }
    return sum / of_class->limit;
}

/* The features in every view. */
static void compute_rows(
    servotwin_scratch *scratch, const servotwin_window *window, int32_t views, const bool *stands_in)
{
    servotwin_real flags[SERVOTWIN_SENSORS];
    for (int32_t view = 0; view < views; view++) {
        for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
            flags[i] = stands_in[servotwin_orders[view][i]] ? 1.0 : 0.0;
        }
        servotwin_window_reorder(window, servotwin_orders[view], &scratch->reordered);
        servotwin_features(&scratch->reordered, flags, scratch->rows[view]);
    }
}

/* The features of the own view as if the unpaired sensors had stand-in values, too. A stand-in looks healthy. So that no
   actuator looks healthier than another one, this row tells them apart. */
static const servotwin_real *paired_row(
    servotwin_scratch *scratch, const servotwin_window *window, const bool *stands_in, const bool *unpaired)
{
    servotwin_real flags[SERVOTWIN_SENSORS];
    bool is_any = false;
    servotwin_window_reorder(window, servotwin_orders[0], &scratch->reordered);
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        flags[i] = (stands_in[i] || unpaired[i]) ? 1.0 : 0.0;
        if (unpaired[i]) {
            is_any = true;
            servotwin_window_hide(&scratch->reordered, i, servotwin_sensors[i].stand_in_noise);
        }
    }
    if (is_any) {
        servotwin_features(&scratch->reordered, flags, scratch->paired);
    }
    return is_any ? scratch->paired : scratch->rows[0];
}

static void judge_outside_band(servotwin_judgement *judgement, const servotwin_scratch *scratch,
    const servotwin_real *paired, int32_t length, const servotwin_window *window, const bool *is_masked)
{
    const servotwin_length *of_length = &servotwin_lengths[length];
    const servotwin_real *views[SERVOTWIN_VIEWS];
    for (int32_t view = 0; view < SERVOTWIN_VIEWS; view++) {
        views[view] = scratch->rows[view];
    }
    const servotwin_diagnosis said = servotwin_diagnose(of_length->trees, paired, views);
    const bool has_action = (said.actuator != SERVOTWIN_NONE) && (said.action != SERVOTWIN_NONE);
    judgement->of_trees = has_action ? servotwin_hypothesis_of(said.actuator, said.action) : SERVOTWIN_HEALTHY;
    judgement->detail_of_trees = said.detail;
    servotwin_probabilities(of_length->committee, paired, views, judgement->probabilities);
    mask(judgement->probabilities, is_masked);
    judgement->likeliest = servotwin_largest(judgement->probabilities, SERVOTWIN_HYPOTHESES);
    int32_t view = 0;
    int32_t known = 0;
    servotwin_real common = 0.0;
    if (judgement->likeliest != SERVOTWIN_HEALTHY) {
        const int32_t actuator = servotwin_actuator_of(judgement->likeliest);
        const int32_t action = servotwin_action_of(judgement->likeliest);
        const servotwin_answer detail = servotwin_detail(of_length->committee, views, actuator, action);
        judgement->detail = detail.decided;
        judgement->detail_probability = detail.probability;
        view = (actuator < of_length->views) ? actuator : (of_length->views - 1);
        known = action + 1;
        common = servotwin_common_mode(actuator, window, length);
    }
    judgement->is_novel = (common > servotwin_tuning.max_common_mode);
    if (of_length->known_classes > 0) {
        const servotwin_real novelty = servotwin_novelty(length, known, scratch->rows[view]);
        judgement->is_novel = judgement->is_novel || (novelty > 1.0);
    }
}

void servotwin_judge(servotwin_judgement *judgement, servotwin_scratch *scratch, int32_t length,
    const servotwin_window *window, const bool *is_masked, const bool *stands_in, const bool *unpaired)
{
    const servotwin_length *of_length = &servotwin_lengths[length];
    servotwin_forget(judgement);
    judgement->has_judged = true;
    find_worst(judgement, window, of_length->bands);
    judgement->is_in_band = (judgement->worst <= 1.0);
    if (judgement->is_in_band) {
        judgement->probabilities[SERVOTWIN_HEALTHY] = servotwin_tuning.in_band_share;
    } else {
        compute_rows(scratch, window, of_length->views, stands_in);
        const servotwin_real *paired = paired_row(scratch, window, stands_in, unpaired);
        judge_outside_band(judgement, scratch, paired, length, window, is_masked);
    }
}

bool servotwin_agrees_on(const servotwin_judgement *judgement, int32_t length, int32_t hypothesis)
{
    return judgement->has_judged && (judgement->of_trees == judgement->likeliest)
        && (judgement->likeliest == hypothesis) && !judgement->is_novel
        && (judgement->probabilities[hypothesis] >= servotwin_lengths[length].least_confidence);
}

int32_t servotwin_agreed_detail(const servotwin_judgement *judgement)
{
    const bool is_agreed = judgement->has_judged && (judgement->detail_of_trees == judgement->detail)
        && (judgement->detail_probability >= servotwin_tuning.least_detail_confidence);
    return is_agreed ? judgement->detail : SERVOTWIN_NONE;
}

bool servotwin_judge_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
