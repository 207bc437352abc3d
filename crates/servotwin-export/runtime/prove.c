/* Entry points for `servotwin prove`. Not part of an export. */
#include "servotwin_session.h"
#include "servotwin_tables.h"

#include <stddef.h>

static const servotwin_hierarchy *hierarchy_of(int32_t is_committee, int32_t length)
{
    return (is_committee != 0) ? servotwin_lengths[length].committee : servotwin_lengths[length].trees;
}

int32_t prove_leaf(int32_t is_committee, int32_t length, int32_t stage, int32_t tree, const double *row);
int32_t prove_leaf(int32_t is_committee, int32_t length, int32_t stage, int32_t tree, const double *row)
{
    return servotwin_leaf(&hierarchy_of(is_committee, length)->stages[stage].branches, tree, row);
}

typedef struct {
    int32_t decided;
    double probability;
} prove_answer;

prove_answer prove_decide(int32_t is_committee, int32_t length, int32_t stage, const double *row);
prove_answer prove_decide(int32_t is_committee, int32_t length, int32_t stage, const double *row)
{
    const servotwin_answer said = servotwin_decide(&hierarchy_of(is_committee, length)->stages[stage], row);
    const prove_answer answer = { said.decided, said.probability };
    return answer;
}

void prove_shares(int32_t length, int32_t stage, const double *row, double *shares);
void prove_shares(int32_t length, int32_t stage, const double *row, double *shares)
{
    servotwin_shares(&servotwin_lengths[length].committee->stages[stage], row, shares);
}

typedef struct {
    int32_t actuator;
    int32_t action;
    int32_t detail;
    double confidence;
    double detail_confidence;
} prove_diagnosis;

prove_diagnosis prove_diagnose(int32_t is_committee, int32_t length, const double *const *views);
prove_diagnosis prove_diagnose(int32_t is_committee, int32_t length, const double *const *views)
{
    const servotwin_diagnosis said = servotwin_diagnose(hierarchy_of(is_committee, length), views[0], views);
    const prove_diagnosis diagnosis = { said.actuator, said.action, said.detail, said.confidence,
        said.detail_confidence };
    return diagnosis;
}

void prove_probabilities(int32_t length, const double *const *views, double *into);
void prove_probabilities(int32_t length, const double *const *views, double *into)
{
    servotwin_probabilities(servotwin_lengths[length].committee, views[0], views, into);
}

double prove_value(int32_t length, int32_t stage, int32_t leaf, int32_t output);
double prove_value(int32_t length, int32_t stage, int32_t leaf, int32_t output)
{
    const servotwin_boosted *boosted = servotwin_lengths[length].committee->stages[stage].boosted;
    return boosted->values[(leaf * boosted->outputs) + output];
}

double prove_novelty(int32_t length, int32_t known, const double *row);
double prove_novelty(int32_t length, int32_t known, const double *row)
{
    return servotwin_novelty(length, known, row);
}

/* The numbers that prove_push writes: of the outcome, and of each length. */
#define OUTCOME_INTEGERS 18
#define OUTCOME_NUMBERS 4
#define LENGTH_NUMBERS (1 + (2 * SERVOTWIN_HYPOTHESES) + (2 * SERVOTWIN_ACTUATORS) + (6 * SERVOTWIN_BOUNDARIES))

uint64_t prove_session_size(void);
uint64_t prove_session_size(void)
{
    return (uint64_t)sizeof(servotwin_session);
}

int32_t prove_start(servotwin_session *session);
int32_t prove_start(servotwin_session *session)
{
    return servotwin_session_start(session) ? 1 : 0;
}

static void write_outcome(const servotwin_outcome *outcome, int64_t *integers, double *numbers)
{
    const servotwin_raised *raised = &outcome->raised;
    const int64_t all[OUTCOME_INTEGERS] = { (int64_t)outcome->sample, (int64_t)outcome->since_sample,
        (int64_t)outcome->finding, outcome->actuator, outcome->action, outcome->detail, outcome->input,
        (int64_t)outcome->why, (int64_t)outcome->alarm, raised->is_raised ? 1 : 0,
        raised->is_raised ? raised->actuator : 0, raised->is_raised ? raised->action : 0,
        raised->is_raised ? raised->detail : 0, raised->is_raised ? (int64_t)raised->sample : 0,
        raised->is_raised ? raised->length : 0, outcome->length, outcome->worst_sensor, outcome->lost };
    for (int32_t i = 0; i < OUTCOME_INTEGERS; i++) {
        integers[i] = all[i];
    }
    numbers[0] = outcome->confidence;
    numbers[1] = outcome->worst;
    numbers[2] = raised->is_raised ? raised->confidence : 0.0;
    numbers[3] = raised->is_raised ? raised->lead : 0.0;
}

void prove_push(servotwin_session *session, const double *inputs, const double *measured, const double *twin,
    int64_t *integers, double *numbers);
void prove_push(servotwin_session *session, const double *inputs, const double *measured, const double *twin,
    int64_t *integers, double *numbers)
{
    write_outcome(servotwin_session_push(session, inputs, measured, twin), integers, numbers);
    double *next = &numbers[OUTCOME_NUMBERS];
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        const servotwin_evidence *evidence = &session->evidence[length];
        next[0] = servotwin_evidence_of_change(evidence, length);
        next[1] = servotwin_evidence_of_unknown(evidence, length);
        for (int32_t i = 0; i < SERVOTWIN_HYPOTHESES; i++) {
            next[2 + i] = session->judgements[length].probabilities[i];
        }
        for (int32_t i = 1; i < SERVOTWIN_HYPOTHESES; i++) {
            next[1 + SERVOTWIN_HYPOTHESES + i] = servotwin_margin(evidence, length, i);
        }
        double *rest = &next[1 + (2 * SERVOTWIN_HYPOTHESES)];
        for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
            const servotwin_ring *ring = &session->rings[length];
            const bool is_full = servotwin_is_full(ring, length);
            rest[0] = servotwin_margin_of_actuator(evidence, length, actuator);
            rest[1] = is_full ? servotwin_common_mode(actuator, &ring->window, length) : 0.0;
            rest = &rest[2];
        }
        for (int32_t boundary = 0; boundary < SERVOTWIN_BOUNDARIES; boundary++) {
            const servotwin_doubt *doubt = &session->doubts[length][boundary];
            rest[6 * boundary] = servotwin_boundary_evidence(doubt, boundary);
            rest[(6 * boundary) + 1] = (doubt->explained > 0U) ? 1.0 : 0.0;
            rest[(6 * boundary) + 2] = doubt->has_fallen ? 1.0 : 0.0;
            rest[(6 * boundary) + 3] = doubt->fallen;
            rest[(6 * boundary) + 4] = doubt->shared;
            rest[(6 * boundary) + 5] = doubt->value;
        }
        next = &next[LENGTH_NUMBERS];
    }
}

void prove_row(const servotwin_session *session, int32_t view, double *into);
void prove_row(const servotwin_session *session, int32_t view, double *into)
{
    for (int32_t i = 0; i < SERVOTWIN_FEATURES; i++) {
        into[i] = session->scratch.rows[view][i];
    }
}

/*
 * The commands of the flight control computer: 0 switched off, 1 released, 2 not judged, 3 judged, 4 taken out, 5 put back,
 * 6 switched on, 7 the alarm is reset.
 */
void prove_command(servotwin_session *session, int32_t command, int32_t place);
void prove_command(servotwin_session *session, int32_t command, int32_t place)
{
    switch (command) {
    case 0:
        servotwin_session_switched_off(session, place);
        break;
    case 1:
        servotwin_session_release(session, place);
        break;
    case 2:
    case 3:
        servotwin_session_inhibit(session, place, command == 2);
        break;
    case 6:
        servotwin_session_switched_on(session, place);
        break;
    case 7:
        servotwin_session_reset_alarm(session);
        break;
    default:
        servotwin_session_take_out(session, place, command == 4);
        break;
    }
}
