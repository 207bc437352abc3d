#include "servotwin_decision.h"

#include "servotwin_math.h"
#include "servotwin_tables.h"

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

static servotwin_real limited(servotwin_real value, servotwin_real least, servotwin_real most)
{
    servotwin_real result = (value < least) ? least : value;
    if (result > most) {
        result = most;
    }
    return result;
}

/* Adds nats to a statistic, within 0 and a number of limits. */
static servotwin_real gathered(servotwin_real statistic, servotwin_real nats, servotwin_real limit)
{
    const servotwin_real clipped = limited(nats, -servotwin_tuning.clip_nats, servotwin_tuning.clip_nats);
    const servotwin_real most = servotwin_tuning.evidence_cap * limit;
    return limited(statistic + clipped, 0.0, most);
}

static servotwin_real log_odds(servotwin_real probability)
{
    const servotwin_real p = limited(probability, LEAST_PROBABILITY, SERVOTWIN_MOST_PROBABILITY);
    const servotwin_real against = 1.0 - p;
    return servotwin_log(p / against);
}

/* The logarithm of the probability of each hypothesis. */
static void find_logarithms(const servotwin_judgement *judgement, servotwin_real *logarithms)
{
    for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
        if (judgement->is_in_band) {
            logarithms[i] = (i == SERVOTWIN_HEALTHY) ? servotwin_tuning.in_band_nats : 0.0;
        } else {
            const servotwin_real p = judgement->probabilities[i];
            logarithms[i] = servotwin_log((p > LEAST_PROBABILITY) ? p : LEAST_PROBABILITY);
        }
    }
}

void servotwin_evidence_take(servotwin_evidence *evidence, int32_t length, const servotwin_judgement *judgement)
{
    const servotwin_length *of_length = &servotwin_lengths[length];
    servotwin_real logarithms[SERVOTWIN_HYPOTHESES];
    find_logarithms(judgement, logarithms);
    for (int32_t claim = 0; claim < SERVOTWIN_HYPOTHESES; claim++) {
        for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
            const int32_t place = (claim * SERVOTWIN_HYPOTHESES) + other;
            const servotwin_real ratio = logarithms[claim] - logarithms[other];
            const servotwin_real nats = ratio - of_length->allowances[place];
            evidence->of_pairs[claim][other] =
                gathered(evidence->of_pairs[claim][other], nats, of_length->limits[place]);
        }
        /* Evidence against similar hypotheses counts only while there is evidence against health. */
        if ((claim != SERVOTWIN_HEALTHY) && (evidence->of_pairs[claim][SERVOTWIN_HEALTHY] == 0.0)) {
            for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
                evidence->of_pairs[claim][other] = 0.0;
            }
        }
    }
    servotwin_real change = -servotwin_tuning.in_band_nats;
    servotwin_real unknown = -servotwin_tuning.in_band_nats;
    if (!judgement->is_in_band) {
        const servotwin_real odds = log_odds(1.0 - judgement->probabilities[SERVOTWIN_HEALTHY]);
        change = odds - of_length->allowed_change;
        unknown = judgement->is_novel ? of_length->novel_nats : of_length->known_nats;
    }
    evidence->change =
        gathered(evidence->change, change - of_length->allowance, of_length->limit_of_change);
    evidence->unknown =
        gathered(evidence->unknown, unknown - of_length->allowance, of_length->limit_of_change);
}

servotwin_real servotwin_margin(const servotwin_evidence *evidence, int32_t length, int32_t claim)
{
    const servotwin_real *limits = &servotwin_lengths[length].limits[claim * SERVOTWIN_HYPOTHESES];
    servotwin_real least = SERVOTWIN_REAL_MAX;
    for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
        const servotwin_real part = evidence->of_pairs[claim][other] / limits[other];
        if ((other != claim) && (part < least)) {
            least = part;
        }
    }
    return least;
}

servotwin_real servotwin_margin_of_actuator(const servotwin_evidence *evidence, int32_t length, int32_t actuator)
{
    servotwin_real largest = 0.0;
    for (int32_t action = 0; action < SERVOTWIN_ACTIONS; action++) {
        const int32_t claim = servotwin_hypothesis_of(actuator, action);
        const servotwin_real *limits = &servotwin_lengths[length].limits[claim * SERVOTWIN_HYPOTHESES];
        servotwin_real least = SERVOTWIN_REAL_MAX;
        for (int32_t other = 0; other < SERVOTWIN_HYPOTHESES; other++) {
            const bool is_own = (other != SERVOTWIN_HEALTHY) && (servotwin_actuator_of(other) == actuator);
            const servotwin_real part = evidence->of_pairs[claim][other] / limits[other];
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

servotwin_real servotwin_evidence_of_change(const servotwin_evidence *evidence, int32_t length)
{
    return evidence->change / servotwin_lengths[length].limit_of_change;
}

servotwin_real servotwin_evidence_of_unknown(const servotwin_evidence *evidence, int32_t length)
{
    return evidence->unknown / servotwin_lengths[length].limit_of_change;
}

bool servotwin_decision_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
