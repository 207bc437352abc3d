#include "servotwin_decision.h"

#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <float.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* Lower limit of probabilities before a logarithm is taken. */
#define LEAST_PROBABILITY 1e-12

void servotwin_evidence_clear(servotwin_evidence *evidence)
{
    for (int32_t claim = 0; claim < SERVOTWIN_HYPOTHESES; claim++) {
        for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
            evidence->of_pairs[claim][other] = 0.0;
        }
    }
    evidence->change = 0.0;
    evidence->unknown = 0.0;
}

static double limited(double value, double least, double most)
{
    double result = (value < least) ? least : value;
    if (result > most) {
        result = most;
    }
    return result;
}

/* Adds nats to a statistic, within 0 and a number of limits. */
static double gathered(double statistic, double nats, double limit, double weight)
{
    const double clipped = limited(nats, -servotwin_tuning.clip_nats, servotwin_tuning.clip_nats);
    const double weighted = clipped * weight;
    const double most = servotwin_tuning.evidence_cap * limit;
    return limited(statistic + weighted, 0.0, most);
}

static double log_odds(double probability)
{
    const double p = limited(probability, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY);
    const double against = 1.0 - p;
    return servotwin_log(p / against);
}

/* The logarithm of the probability of each hypothesis. */
static void find_logarithms(const servotwin_judgement *judgement, double *logarithms)
{
    for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
        if (judgement->is_in_band) {
            logarithms[i] = (i == SERVOTWIN_HEALTHY) ? servotwin_tuning.in_band_nats : 0.0;
        } else {
            const double p = judgement->probabilities[i];
            logarithms[i] = servotwin_log((p > LEAST_PROBABILITY) ? p : LEAST_PROBABILITY);
        }
    }
}

void servotwin_evidence_take(servotwin_evidence *evidence, int32_t length, const servotwin_judgement *judgement)
{
    const servotwin_length *of_length = &servotwin_lengths[length];
    double logarithms[SERVOTWIN_HYPOTHESES];
    find_logarithms(judgement, logarithms);
    for (int32_t claim = 0; claim < SERVOTWIN_HYPOTHESES; claim++) {
        for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
            const int32_t place = (claim * SERVOTWIN_HYPOTHESES) + other;
            const double ratio = logarithms[claim] - logarithms[other];
            const double nats = ratio - of_length->allowances[place];
            evidence->of_pairs[claim][other] =
                gathered(evidence->of_pairs[claim][other], nats, of_length->limits[place], of_length->weight);
        }
        /* Evidence against similar hypotheses counts only while there is evidence against health. */
        if ((claim != SERVOTWIN_HEALTHY) && (evidence->of_pairs[claim][SERVOTWIN_HEALTHY] == 0.0)) {
            for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
                evidence->of_pairs[claim][other] = 0.0;
            }
        }
    }
    double change = -servotwin_tuning.in_band_nats;
    double unknown = -servotwin_tuning.in_band_nats;
    if (!judgement->is_in_band) {
        const double odds = log_odds(1.0 - judgement->probabilities[SERVOTWIN_HEALTHY]);
        change = odds - of_length->allowed_change;
        unknown = judgement->is_novel ? of_length->novel_nats : of_length->known_nats;
    }
    evidence->change =
        gathered(evidence->change, change - of_length->allowance, of_length->limit_of_change, of_length->weight);
    evidence->unknown =
        gathered(evidence->unknown, unknown - of_length->allowance, of_length->limit_of_change, of_length->weight);
}

double servotwin_margin(const servotwin_evidence *evidence, int32_t length, int32_t claim)
{
    const double *limits = &servotwin_lengths[length].limits[claim * SERVOTWIN_HYPOTHESES];
    double least = DBL_MAX;
    for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
        const double part = evidence->of_pairs[claim][other] / limits[other];
        if ((other != claim) && (part < least)) {
            least = part;
        }
    }
    return least;
}

double servotwin_margin_of_actuator(const servotwin_evidence *evidence, int32_t length, int32_t actuator)
{
    double largest = 0.0;
    for (int32_t action = 0; action < SERVOTWIN_ACTIONS; action++) {
        const int32_t claim = servotwin_hypothesis_of(actuator, action);
        const double *limits = &servotwin_lengths[length].limits[claim * SERVOTWIN_HYPOTHESES];
        double least = DBL_MAX;
        for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
            const bool is_own = (other != SERVOTWIN_HEALTHY) && (servotwin_actuator_of(other) == actuator);
            const double part = evidence->of_pairs[claim][other] / limits[other];
            if (!is_own && (part < least)) {
                least = part;
            }
        }
        if (least > largest) {
            largest = least;
        }
    }
    return largest;
}

double servotwin_evidence_of_change(const servotwin_evidence *evidence, int32_t length)
{
    return evidence->change / servotwin_lengths[length].limit_of_change;
}

double servotwin_evidence_of_unknown(const servotwin_evidence *evidence, int32_t length)
{
    return evidence->unknown / servotwin_lengths[length].limit_of_change;
}
