#include "servotwin_session.h"

#include "servotwin_math.h"
#include "servotwin_random.h"
#include "servotwin_tables.h"

#include <math.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* Upper limit of residuals and twin signals in parts of scale; larger ones are no measurements. */
#define PLAUSIBLE 1e6

/* A sensor is quiet if its variance is below the declared one by this factor. */
#define QUIET 4.0

/* The largest square of a difference that counts, in parts of its mean by the declared noise, and their number. */
#define LARGEST_DIFFERENCE 4.0
#define NOISE_DIFFERENCES 100U

/* Panes of the start test after its first full window. */
#define KNOWN_PANES 3

/*
 * ---- The alarm. An action is active while it has evidence and for some time after. A shutdown also stands until it is
 * withdrawn: neither a gap nor healthy residuals nor a switch take it back. ----
 */

static bool is_actuator(int32_t actuator)
{
    return (actuator >= 0) && (actuator < SERVOTWIN_ACTUATORS);
}

static bool is_masked(const servotwin_session *session, int32_t actuator)
{
    /* Without the first condition, gcc 12 warns at -O3 of indices that do not occur, if there is one actuator. */
    return is_actuator(actuator) && (session->is_off[actuator] || session->is_inhibited[actuator]);
}

static bool switches_off(int32_t action)
{
    return servotwin_switches_off[action] != 0U;
}

static void drop_active(servotwin_session *session)
{
    session->active.is_raised = false;
    session->is_recovering = false;
}

static void drop_active_of(servotwin_session *session, int32_t actuator)
{
    if (session->active.is_raised && (session->active.actuator == actuator)) {
        drop_active(session);
    }
}

/* The first shutdown that stands for a judged actuator; NULL if there is none. */
static const servotwin_raised *shutdown_to_carry_out(const servotwin_session *session)
{
    const servotwin_raised *found = NULL;
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        if ((found == NULL) && session->stands[actuator].is_raised && !is_masked(session, actuator)) {
            found = &session->stands[actuator];
        }
    }
    return found;
}

/* The action to carry out. */
static const servotwin_raised *raised_action(const servotwin_session *session)
{
    const servotwin_raised *raised = shutdown_to_carry_out(session);
    return (raised != NULL) ? raised : &session->active;
}

static bool is_another(const servotwin_raised *raised, int32_t actuator)
{
    return raised->is_raised && (raised->actuator != actuator);
}

/*
 * Whether a hypothesis may be raised at all. For a shutdown, enough other actuators must be on without a shutdown that
 * stands, and no other actuator may have an alarm.
 */
static bool allows(const servotwin_session *session, int32_t claim)
{
    const int32_t actuator = servotwin_actuator_of(claim);
    int32_t others = 0;
    for (int32_t other = 0; other < SERVOTWIN_ACTUATORS; other++) {
        if ((other != actuator) && !session->is_off[other] && !session->stands[other].is_raised) {
            others++;
        }
    }
    const bool is_another_raised =
        is_another(raised_action(session), actuator) || is_another(&session->active, actuator);
    const bool may_switch_off = (others >= servotwin_tuning.least_on) && !is_another_raised;
    return !is_masked(session, actuator) && (!switches_off(servotwin_action_of(claim)) || may_switch_off);
}

static bool is_same_action(const servotwin_raised *a, const servotwin_raised *b)
{
    return a->is_raised && b->is_raised && (a->actuator == b->actuator) && (a->action == b->action);
}

/* Confirms a known action by a newer window. Another detail needs more confidence in sum than the known one. */
static void confirm(servotwin_raised *raised, const servotwin_raised *known)
{
    raised->sample = known->sample;
    if (known->detail != SERVOTWIN_NONE) {
        if (raised->detail == known->detail) {
            raised->lead = known->lead + raised->lead;
        } else if (raised->lead > known->lead) {
            raised->lead = raised->lead - known->lead;
        } else {
            raised->lead = known->lead - raised->lead;
            raised->detail = known->detail;
            raised->confidence = known->confidence;
        }
    }
}

/*
 * Raises an allowed action, or updates the active one; a shutdown with evidence gives way to no other. Returns whether the
 * action is active.
 */
static bool raise_action(servotwin_session *session, const servotwin_raised *candidate)
{
    const int32_t actuator = candidate->actuator;
    const int32_t claim = servotwin_hypothesis_of(actuator, candidate->action);
    const bool is_active = is_same_action(&session->active, candidate);
    const bool is_standing = is_same_action(&session->stands[actuator], candidate);
    const bool is_held = session->active.is_raised && !session->is_recovering && !is_active
        && switches_off(session->active.action);
    const bool is_allowed = is_active || is_standing || allows(session, claim);
    const bool is_raised = is_allowed && !is_held && !is_masked(session, actuator);
    if (is_raised) {
        servotwin_raised raised = *candidate;
        if (is_active || is_standing) {
            const servotwin_raised *known = is_active ? &session->active : &session->stands[actuator];
            confirm(&raised, known);
        }
        session->active = raised;
        if (switches_off(raised.action)) {
            session->stands[actuator] = raised;
        }
        session->is_recovering = false;
    }
    return is_raised;
}

/* Without evidence for long enough, an action is active no more. */
static void hold(servotwin_session *session, bool has_evidence)
{
    if (has_evidence || !session->active.is_raised) {
        session->is_recovering = false;
    } else {
        if (!session->is_recovering) {
            session->is_recovering = true;
            session->recovering_since = session->outcome.sample;
        }
        if ((session->outcome.sample - session->recovering_since) >= servotwin_tuning.recover_samples) {
            drop_active(session);
        }
    }
}

static void withdraw(servotwin_session *session, int32_t actuator)
{
    session->stands[actuator].is_raised = false;
    drop_active_of(session, actuator);
}

/* The alarm of the raised action, or of none. */
static servotwin_alarm alarm_of(const servotwin_session *session, bool is_pending)
{
    servotwin_alarm alarm = is_pending ? SERVOTWIN_PENDING : SERVOTWIN_NORMAL;
    if (shutdown_to_carry_out(session) != NULL) {
        alarm = SERVOTWIN_RAISED;
    } else if (session->active.is_raised) {
        alarm = session->is_recovering ? SERVOTWIN_RECOVERING : SERVOTWIN_RAISED;
    } else {
        /* Nothing is raised. */
    }
    return alarm;
}

/* ---- What is said. ---- */

static bool is_same_finding(const servotwin_outcome *a, const servotwin_outcome *b)
{
    return (a->finding == b->finding) && (a->alarm == b->alarm) && (a->actuator == b->actuator)
        && (a->action == b->action) && (a->detail == b->detail) && (a->input == b->input) && (a->why == b->why);
}

/* A finding without parts. */
static servotwin_outcome finding_of(servotwin_finding finding, servotwin_alarm alarm)
{
    servotwin_outcome said;
    (void)memset(&said, 0, sizeof said);
    said.finding = finding;
    said.alarm = alarm;
    said.actuator = SERVOTWIN_NONE;
    said.action = SERVOTWIN_NONE;
    said.detail = SERVOTWIN_NONE;
    said.input = SERVOTWIN_NONE;
    said.why = SERVOTWIN_MISSING;
    return said;
}

/* Copies finding and alarm. */
static void say(servotwin_session *session, const servotwin_outcome *said)
{
    servotwin_outcome *outcome = &session->outcome;
    if (!is_same_finding(outcome, said)) {
        outcome->since_sample = session->samples;
    }
    outcome->finding = said->finding;
    outcome->alarm = said->alarm;
    outcome->actuator = said->actuator;
    outcome->action = said->action;
    outcome->detail = said->detail;
    outcome->input = said->input;
    outcome->why = said->why;
    outcome->raised = *raised_action(session);
    if ((said->finding == SERVOTWIN_UNJUDGED) || (said->finding == SERVOTWIN_ENVIRONMENT_INVALID)) {
        outcome->confidence = 0.0;
        outcome->length = SERVOTWIN_NONE;
        outcome->worst_sensor = SERVOTWIN_NONE;
        outcome->worst = 0.0;
    }
}

static void say_unjudged(servotwin_session *session, servotwin_alarm alarm)
{
    const servotwin_outcome said = finding_of(SERVOTWIN_UNJUDGED, alarm);
    say(session, &said);
}

/* ---- Starting again. ---- */

static void clear_windows(servotwin_session *session)
{
    for (int32_t stream = 0; stream < 2; stream++) {
        servotwin_stream_clear(&session->streams[stream], session->rings, &servotwin_stream_plans[stream]);
    }
    servotwin_baseline_clear(&session->baseline);
    session->spreads.has_last = false;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        servotwin_evidence_clear(&session->evidence[length]);
        servotwin_forget(&session->judgements[length]);
        for (int32_t boundary = 0; boundary < SERVOTWIN_BOUNDARIES; boundary++) {
            servotwin_doubt_clear(&session->doubts[length][boundary]);
        }
    }
    session->has_judged = false;
}

void servotwin_session_restart(servotwin_session *session)
{
    clear_windows(session);
    session->settling = servotwin_tuning.settle_samples;
    say_unjudged(session, alarm_of(session, false));
}

static void clear_session(servotwin_session *session)
{
    const servotwin_raised nothing_raised = {
        false, SERVOTWIN_NONE, SERVOTWIN_NONE, SERVOTWIN_NONE, 0U, SERVOTWIN_NONE, 0.0, 0.0};
    session->samples = 0U;
    session->settling = servotwin_tuning.settle_samples;
    session->gap = 0U;
    for (int32_t input = 0; input < SERVOTWIN_INPUTS; input++) {
        session->last_input[input] = (servotwin_real)NAN;
        session->repeats[input] = 0U;
    }
    session->missing = 0U;
    session->recovering = 0U;
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        session->is_taken_out[sensor] = false;
        session->is_lost[sensor] = false;
        session->against[sensor] = 0U;
        session->has_last[sensor] = false;
        session->last_residual[sensor] = 0.0;
        session->differences[sensor] = 0U;
        session->variance[sensor] = 0.0;
        session->stands_in[sensor] = false;
        session->unpaired[sensor] = false;
        session->measured[sensor] = 0.0;
        session->corrected[sensor] = 0.0;
    }
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        session->stands[actuator] = nothing_raised;
        session->is_off[actuator] = false;
        session->is_inhibited[actuator] = false;
    }
    session->active = nothing_raised;
    session->recovering_since = 0U;
    session->outcome = finding_of(SERVOTWIN_UNJUDGED, SERVOTWIN_NORMAL);
    session->outcome.sample = 0U;
    session->outcome.since_sample = 0U;
    session->outcome.confidence = 0.0;
    session->outcome.length = SERVOTWIN_NONE;
    session->outcome.worst_sensor = SERVOTWIN_NONE;
    session->outcome.worst = 0.0;
    session->outcome.lost = 0;
    session->outcome.raised = nothing_raised;
    session->is_recovering = false;
    (void)memset(&session->scratch, 0, sizeof session->scratch);
    clear_windows(session);
}

void servotwin_session_at_rest(servotwin_session *session)
{
    session->settling = 0U;
}

static bool switch_actuator(servotwin_session *session, int32_t actuator, bool is_off)
{
    const bool is_known = is_actuator(actuator);
    if (is_known) {
        session->is_off[actuator] = is_off;
        drop_active_of(session, actuator);
        servotwin_session_restart(session);
    }
    return is_known;
}

bool servotwin_session_switched_off(servotwin_session *session, int32_t actuator)
{
    return switch_actuator(session, actuator, true);
}

bool servotwin_session_switched_on(servotwin_session *session, int32_t actuator)
{
    return switch_actuator(session, actuator, false);
}

bool servotwin_session_release(servotwin_session *session, int32_t actuator)
{
    const bool is_known = is_actuator(actuator);
    if (is_known) {
        withdraw(session, actuator);
        (void)switch_actuator(session, actuator, false);
    }
    return is_known;
}

void servotwin_session_reset_alarm(servotwin_session *session)
{
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        withdraw(session, actuator);
    }
    clear_windows(session);
    say_unjudged(session, SERVOTWIN_NORMAL);
}

bool servotwin_session_inhibit(servotwin_session *session, int32_t actuator, bool is_inhibited)
{
    const bool is_known = is_actuator(actuator);
    if (is_known) {
        session->is_inhibited[actuator] = is_inhibited;
        if (is_inhibited) {
            drop_active_of(session, actuator);
        }
        servotwin_session_restart(session);
    }
    return is_known;
}

bool servotwin_session_take_out(servotwin_session *session, int32_t sensor, bool is_out)
{
    const bool is_known = (sensor >= 0) && (sensor < SERVOTWIN_SENSORS);
    if (is_known) {
        session->is_taken_out[sensor] = is_out;
        servotwin_session_restart(session);
    }
    return is_known;
}

/* ---- Inputs. ---- */

static bool is_within(servotwin_real value, servotwin_real least, servotwin_real largest)
{
    return (value >= least) && (value <= largest);
}

static bool is_frozen(servotwin_session *session, int32_t input, servotwin_real value)
{
    const uint32_t limit = servotwin_inputs[input].frozen_after;
    if (servotwin_bits_of(session->last_input[input]) != servotwin_bits_of(value)) {
        session->repeats[input] = 0U;
    } else if (session->repeats[input] < UINT32_MAX) {
        session->repeats[input]++;
    } else {
        /* It has been the same for over a year. */
    }
    session->last_input[input] = value;
    return (limit > 0U) && (session->repeats[input] >= limit);
}

/* Counts the samples in which an input is missing. */
static void count_missing(servotwin_session *session, const servotwin_real *inputs)
{
    bool is_any = false;
    for (int32_t input = 0; input < SERVOTWIN_INPUTS; input++) {
        is_any = is_any || isnan(inputs[input]);
    }
    if (!is_any) {
        session->missing = 0U;
    } else if (session->missing < UINT32_MAX) {
        session->missing++;
    } else {
        /* It has been missing for over a year. */
    }
}

/* A value, or the one before if it is missing and was not for long. */
static servotwin_real held(const servotwin_session *session, int32_t input, servotwin_real told)
{
    const bool is_held = isnan(told) && (session->missing <= servotwin_tuning.held_samples);
    return is_held ? session->last_input[input] : told;
}

/* Checks all inputs; writes the first implausible one. */
static bool is_plausible(servotwin_session *session, const servotwin_real *inputs, servotwin_outcome *said)
{
    bool holds = true;
    count_missing(session, inputs);
    for (int32_t input = 0; input < SERVOTWIN_INPUTS; input++) {
        const servotwin_real value = held(session, input, inputs[input]);
        const bool frozen = !isnan(inputs[input]) && is_frozen(session, input, inputs[input]);
        servotwin_why why = SERVOTWIN_FROZEN;
        bool is_wrong = frozen;
        if (isnan(value) != 0) {
            why = SERVOTWIN_MISSING;
            is_wrong = true;
        } else if (SERVOTWIN_ABS(value) > SERVOTWIN_REAL_MAX) {
            why = SERVOTWIN_NOT_FINITE;
            is_wrong = true;
        } else if (!is_within(value, servotwin_inputs[input].least, servotwin_inputs[input].largest)) {
            why = SERVOTWIN_OUT_OF_RANGE;
            is_wrong = true;
        } else {
            /* Frozen, or in order. */
        }
        if (is_wrong && holds) {
            holds = false;
            said->input = input;
            said->why = why;
        }
    }
    for (int32_t i = 0; (i < SERVOTWIN_DIFFERENCES) && holds; i++) {
        const servotwin_difference *difference = &servotwin_differences[i];
        const servotwin_real of = held(session, difference->of, inputs[difference->of]);
        const servotwin_real minus = held(session, difference->minus, inputs[difference->minus]);
        const servotwin_real value = of - minus;
        if (!is_within(value, difference->least, difference->largest)) {
            holds = false;
            said->input = difference->of;
            said->why = SERVOTWIN_CONTRADICTS;
        }
    }
    return holds;
}

/* Handles an implausible input: what the twin says since then means nothing. */
static void distrust(servotwin_session *session, const servotwin_outcome *said)
{
    servotwin_outcome whole = *said;
    whole.alarm = session->outcome.alarm;
    if (!is_same_finding(&session->outcome, &whole) || session->has_judged) {
        servotwin_session_restart(session);
    }
    session->settling = servotwin_tuning.settle_samples;
    session->recovering = 0U;
    whole.alarm = (said->why == SERVOTWIN_MISSING) ? SERVOTWIN_NO_DATA : SERVOTWIN_ERROR;
    say(session, &whole);
}

/* ---- Sensors. ---- */

typedef enum { USABLE, MISSING_VALUE, WRONG_VALUE } usability;

static usability usability_of(servotwin_real value, servotwin_real expected, servotwin_real scale)
{
    usability result = USABLE;
    const servotwin_real difference = value - expected;
    if (isnan(value) != 0) {
        result = MISSING_VALUE;
    } else if (SERVOTWIN_ABS(difference / scale) > PLAUSIBLE) {
        result = WRONG_VALUE;
    } else {
        /* It is a measurement. */
    }
    return result;
}

/* Counts a sample with or without a usable value of a sensor. */
static void notice(servotwin_session *session, int32_t sensor, bool is_there)
{
    if (is_there != session->is_lost[sensor]) {
        session->against[sensor] = 0U;
    } else {
        const uint32_t limit =
            session->is_lost[sensor] ? servotwin_tuning.until_back_samples : servotwin_tuning.until_lost_samples;
        session->against[sensor]++;
        if (session->against[sensor] >= limit) {
            session->is_lost[sensor] = !session->is_lost[sensor];
            session->against[sensor] = 0U;
        }
    }
}

/* A value with the noise of a healthy sensor. */
static servotwin_real with_noise(const servotwin_session *session, int32_t sensor, servotwin_real value)
{
    const servotwin_real scaled = servotwin_sensors[sensor].scale * servotwin_sensors[sensor].stand_in_noise;
    const servotwin_real noise = scaled * servotwin_normal((uint64_t)sensor, session->samples + 1U);
    return value + noise;
}

/* Takes a measurement into the noise of a sensor, by the difference of successive residuals. */
static void measure_noise(servotwin_session *session, int32_t sensor, bool is_there, servotwin_real residual)
{
    if (is_there && session->has_last[sensor]) {
        const servotwin_real noise = servotwin_sensors[sensor].stand_in_noise;
        const servotwin_real difference = residual - session->last_residual[sensor];
        const servotwin_real of_declared = LARGEST_DIFFERENCE * noise;
        const servotwin_real largest = of_declared * noise;
        const servotwin_real half_difference = 0.5 * difference;
        servotwin_real half = half_difference * difference;
        if (half > largest) {
            half = largest;
        }
        if (session->differences[sensor] < NOISE_DIFFERENCES) {
            session->differences[sensor]++;
        }
        const servotwin_real change = half - session->variance[sensor];
        const servotwin_real step = change / (servotwin_real)session->differences[sensor];
        session->variance[sensor] = session->variance[sensor] + step;
    }
    session->has_last[sensor] = is_there;
    session->last_residual[sensor] = is_there ? residual : 0.0;
}

/* Whether a sensor is much quieter than declared. */
static bool is_quiet(const servotwin_session *session, int32_t sensor)
{
    const servotwin_real noise = servotwin_sensors[sensor].stand_in_noise;
    const servotwin_real declared = noise * noise;
    const servotwin_real own = QUIET * session->variance[sensor];
    return (session->differences[sensor] >= NOISE_DIFFERENCES) && (own < declared);
}

/* Counts the lost sensors. When one comes back, windows without it are cleared. */
static void count_lost(servotwin_session *session)
{
    int32_t lost = 0;
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        if (session->is_lost[sensor]) {
            lost++;
        }
    }
    if (lost < session->outcome.lost) {
        clear_windows(session);
    }
    session->outcome.lost = lost;
}

/* Whether most sensors of an actuator, or of all for SERVOTWIN_NONE, are lost. */
static bool has_lost_most(const servotwin_session *session, int32_t actuator)
{
    int32_t count = 0;
    int32_t lost = 0;
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        if ((actuator == SERVOTWIN_NONE) || (servotwin_sensors[sensor].actuator == actuator)) {
            count++;
            if (session->is_lost[sensor]) {
                lost++;
            }
        }
    }
    return (servotwin_real)lost > (servotwin_tuning.most_lost * (servotwin_real)count);
}

static bool is_blind(const servotwin_session *session)
{
    bool blind = has_lost_most(session, SERVOTWIN_NONE);
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        blind = blind || has_lost_most(session, actuator);
    }
    return blind;
}

/* Whether a sensor is one of an actuator that is off or not judged. */
static bool has_masked_actuator(const servotwin_session *session, int32_t sensor)
{
    const int32_t actuator = servotwin_sensors[sensor].actuator;
    return (actuator != SERVOTWIN_NONE) && is_masked(session, actuator);
}

/* Whether a sensor gives no value. */
static bool gives_no_value(const servotwin_session *session, int32_t sensor)
{
    return session->is_taken_out[sensor] || session->is_lost[sensor];
}

/* Whether a corresponding sensor of another actuator gives no value. */
static bool lacks_peer(const servotwin_session *session, int32_t sensor)
{
    bool lacks = false;
    for (int32_t view = 1; view < SERVOTWIN_VIEWS; view++) {
        const int32_t peer = servotwin_orders[view][sensor];
        lacks = lacks || (gives_no_value(session, peer) && !has_masked_actuator(session, peer));
    }
    return lacks;
}

static bool is_sound(int32_t sensor, const servotwin_real *twin)
{
    return SERVOTWIN_ABS(twin[sensor] / servotwin_sensors[sensor].scale) <= PLAUSIBLE;
}

/* Looks which sensors are there, and how large their noise is. */
static void notice_sensors(servotwin_session *session, const servotwin_real *measured, const servotwin_real *twin)
{
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        const servotwin_real scale = servotwin_sensors[sensor].scale;
        const servotwin_real value = measured[sensor];
        const servotwin_real expected = twin[sensor];
        const bool is_there = is_sound(sensor, twin) && (usability_of(value, expected, scale) == USABLE);
        const servotwin_real difference = value - expected;
        if (session->is_taken_out[sensor] || has_masked_actuator(session, sensor)) {
            session->is_lost[sensor] = false;
            session->against[sensor] = 0U;
        } else if (is_sound(sensor, twin)) {
            notice(session, sensor, is_there);
        } else {
            /* Nobody knows what the value should be. */
        }
        measure_noise(session, sensor, is_there, difference / scale);
    }
}

/* Checks the values and copies them, with stand-ins. */
static usability copy_measured(servotwin_session *session, const servotwin_real *measured, const servotwin_real *twin)
{
    usability all = USABLE;
    notice_sensors(session, measured, twin);
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        const servotwin_real expected = twin[sensor];
        servotwin_real value = measured[sensor];
        session->stands_in[sensor] = has_masked_actuator(session, sensor) || gives_no_value(session, sensor);
        session->unpaired[sensor] = lacks_peer(session, sensor);
        if (session->stands_in[sensor]) {
            value = with_noise(session, sensor, expected);
        } else if (is_quiet(session, sensor)) {
            value = with_noise(session, sensor, value);
        } else {
            /* It has its own noise. */
        }
        if (!is_sound(sensor, twin)) {
            all = WRONG_VALUE;
        } else if (all == USABLE) {
            all = usability_of(value, expected, servotwin_sensors[sensor].scale);
        } else {
            /* One sensor is enough. */
        }
        session->measured[sensor] = value;
    }
    count_lost(session);
    if ((all == USABLE) && (session->outcome.lost > 0) && is_blind(session)) {
        all = MISSING_VALUE;
    }
    return all;
}

/* Handles a sample without usable values. A few are only counted; more clear the windows. */
static void lack(servotwin_session *session, servotwin_alarm alarm)
{
    const uint32_t limit = servotwin_tuning.until_lost_samples;
    if (session->gap < UINT32_MAX) {
        session->gap++;
    }
    if (session->gap >= limit) {
        if (session->has_judged || (session->gap == limit)) {
            clear_windows(session);
        }
        say_unjudged(session, alarm);
    }
}

/* ---- Decision. ---- */

static servotwin_real margin(const servotwin_session *session, int32_t length, int32_t claim)
{
    return servotwin_margin(&session->evidence[length], length, claim);
}

/* Whether an actuator may be accused: where actuators are not alike, no other judged one lacks a sensor. */
static bool is_comparable(const servotwin_session *session, int32_t actuator)
{
    bool holds = true;
    for (int32_t sensor = 0; (sensor < SERVOTWIN_SENSORS) && (SERVOTWIN_VIEWS == 1); sensor++) {
        const int32_t own = servotwin_sensors[sensor].actuator;
        const bool is_elsewhere = (own != SERVOTWIN_NONE) && (own != actuator) && !has_masked_actuator(session, sensor);
        holds = holds && !(is_elsewhere && gives_no_value(session, sensor));
    }
    return holds;
}

/* Whether the sensor next to a return line has fallen in windows that no baseline corrects. */
static bool has_fallen(const servotwin_session *session, int32_t boundary)
{
    bool holds = false;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        holds = holds || (!servotwin_lengths[length].is_corrected && session->doubts[length][boundary].has_fallen);
    }
    return holds && servotwin_boundaries[boundary].is_return;
}

/* The input whose wrong reading would explain all that an actuator shows; SERVOTWIN_NONE if there is none. */
static int32_t doubtful_input(const servotwin_session *session, int32_t actuator)
{
    int32_t input = SERVOTWIN_NONE;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        for (int32_t boundary = 0; boundary < SERVOTWIN_BOUNDARIES; boundary++) {
            const servotwin_boundary *known = &servotwin_boundaries[boundary];
            if ((input == SERVOTWIN_NONE) && (servotwin_sensors[known->sensor].actuator == actuator)
                && servotwin_is_doubtful(&session->doubts[length][boundary], boundary)
                && !has_fallen(session, boundary)) {
                input = known->input;
            }
        }
    }
    return input;
}

/* The input that a shutdown waits for. */
static int32_t doubtful_shutdown(const servotwin_session *session, int32_t claim)
{
    return switches_off(servotwin_action_of(claim)) ? doubtful_input(session, servotwin_actuator_of(claim))
                                                    : SERVOTWIN_NONE;
}

/* The doubtful input of a shutdown for which there would be enough evidence. */
static int32_t withheld_input(const servotwin_session *session)
{
    int32_t input = SERVOTWIN_NONE;
    for (int32_t claim = 1; claim < SERVOTWIN_HYPOTHESES; claim++) {
        bool is_claimed = false;
        for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
            is_claimed = is_claimed || (margin(session, length, claim) >= 1.0);
        }
        if (is_claimed && (input == SERVOTWIN_NONE)) {
            input = doubtful_shutdown(session, claim);
        }
    }
    return input;
}

/* Whether another length claims another actuator, or a longer one another action. */
static bool is_contradicted(const servotwin_session *session, int32_t length, int32_t claim)
{
    bool contradicted = false;
    for (int32_t other = 0; other < SERVOTWIN_LENGTHS; other++) {
        const bool is_longer = session->rings[other].window.samples > session->rings[length].window.samples;
        for (int32_t rival = 1; rival < SERVOTWIN_HYPOTHESES; rival++) {
            const bool is_elsewhere = servotwin_actuator_of(rival) != servotwin_actuator_of(claim);
            if ((other != length) && (rival != claim) && (is_elsewhere || is_longer)) {
                contradicted = contradicted || (margin(session, other, rival) >= 1.0);
            }
        }
    }
    return contradicted;
}

static bool may_raise(const servotwin_session *session, int32_t length, int32_t claim)
{
    return allows(session, claim) && is_comparable(session, servotwin_actuator_of(claim))
        && servotwin_agrees_on(&session->judgements[length], length, claim)
        && (servotwin_evidence_of_unknown(&session->evidence[length], length) < 1.0)
        && !is_contradicted(session, length, claim) && (doubtful_shutdown(session, claim) == SERVOTWIN_NONE);
}

/* The hypothesis that a new window raises: of the longest window first, then the one with the largest margin. */
static bool find_candidate(const servotwin_session *session, servotwin_raised *candidate)
{
    bool is_found = false;
    int32_t best_samples = 0;
    servotwin_real best_margin = 0.0;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        const int32_t samples = session->rings[length].window.samples;
        for (int32_t claim = 1; claim < SERVOTWIN_HYPOTHESES; claim++) {
            const servotwin_real own_margin = margin(session, length, claim);
            const bool is_better =
                !is_found || (samples > best_samples) || ((samples == best_samples) && (own_margin > best_margin));
            const bool is_claimed = session->rings[length].has_ended && (own_margin >= 1.0);
            if (is_claimed && is_better && may_raise(session, length, claim)) {
                const servotwin_judgement *judgement = &session->judgements[length];
                const int32_t detail = servotwin_agreed_detail(judgement);
                const servotwin_real share = (detail != SERVOTWIN_NONE) ? judgement->detail_probability : 1.0;
                const servotwin_real confidence = judgement->probabilities[claim] * share;
                const servotwin_raised own = { true, servotwin_actuator_of(claim), servotwin_action_of(claim), detail,
                    session->outcome.sample, length, confidence, (detail != SERVOTWIN_NONE) ? confidence : 0.0 };
                is_found = true;
                best_samples = samples;
                best_margin = own_margin;
                *candidate = own;
            }
        }
    }
    return is_found;
}

/* Whether any length still has some evidence for the active action. */
static bool has_evidence(const servotwin_session *session)
{
    const servotwin_raised *raised = &session->active;
    bool has = false;
    if (raised->is_raised) {
        const int32_t claim = servotwin_hypothesis_of(raised->actuator, raised->action);
        for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
            has = has || (margin(session, length, claim) >= servotwin_tuning.pending_share);
        }
    }
    return has;
}

/* The actuator that at least one length is sure of, unless two disagree; returns that length, or SERVOTWIN_NONE. */
static int32_t find_actuator(const servotwin_session *session, servotwin_outcome *said)
{
    int32_t found = SERVOTWIN_NONE;
    int32_t found_by = SERVOTWIN_NONE;
    bool disagree = false;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
            if (is_comparable(session, actuator)
                && (servotwin_margin_of_actuator(&session->evidence[length], length, actuator) >= 1.0)) {
                disagree = disagree || ((found != SERVOTWIN_NONE) && (found != actuator));
                if (found == SERVOTWIN_NONE) {
                    found = actuator;
                    found_by = length;
                }
            }
        }
    }
    if ((found != SERVOTWIN_NONE) && !disagree) {
        said->finding = SERVOTWIN_ACTUATOR;
        said->actuator = found;
    } else {
        found_by = SERVOTWIN_NONE;
    }
    return found_by;
}

/* The first length whose evidence reaches its limit; SERVOTWIN_NONE if there is none. */
static int32_t first_over(
    const servotwin_session *session, servotwin_real (*evidence_of)(const servotwin_evidence *evidence, int32_t length))
{
    int32_t found = SERVOTWIN_NONE;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        if ((found == SERVOTWIN_NONE) && (evidence_of(&session->evidence[length], length) >= 1.0)) {
            found = length;
        }
    }
    return found;
}

/* Writes the finding without a raised action; returns the length that found it. */
static int32_t find_without_action(const servotwin_session *session, servotwin_outcome *said)
{
    int32_t length = first_over(session, servotwin_evidence_of_unknown);
    if (length != SERVOTWIN_NONE) {
        said->finding = SERVOTWIN_UNKNOWN;
    } else {
        length = find_actuator(session, said);
    }
    if (length == SERVOTWIN_NONE) {
        length = first_over(session, servotwin_evidence_of_change);
        said->finding = (length != SERVOTWIN_NONE) ? SERVOTWIN_DETECTED : SERVOTWIN_NO_FAULT;
    }
    for (int32_t first = 0; (first < SERVOTWIN_LENGTHS) && (length == SERVOTWIN_NONE); first++) {
        if (session->judgements[first].has_judged) {
            length = first;
        }
    }
    return (length == SERVOTWIN_NONE) ? 0 : length;
}

static servotwin_real probability_of_actuator(const servotwin_judgement *judgement, int32_t actuator)
{
    servotwin_real sum = -0.0;
    for (int32_t action = 0; action < SERVOTWIN_ACTIONS; action++) {
        sum = sum + judgement->probabilities[servotwin_hypothesis_of(actuator, action)];
    }
    return sum;
}

/* Says a finding of a length with its confidence. */
static void tell(servotwin_session *session, const servotwin_outcome *said, int32_t length)
{
    const servotwin_judgement *judgement = &session->judgements[length];
    servotwin_outcome *outcome = &session->outcome;
    say(session, said);
    switch (said->finding) {
    case SERVOTWIN_NO_FAULT:
        outcome->confidence = judgement->probabilities[SERVOTWIN_HEALTHY];
        break;
    case SERVOTWIN_DETECTED:
    case SERVOTWIN_UNKNOWN:
        outcome->confidence = 1.0 - judgement->probabilities[SERVOTWIN_HEALTHY];
        break;
    case SERVOTWIN_ACTUATOR:
        outcome->confidence = probability_of_actuator(judgement, said->actuator);
        break;
    case SERVOTWIN_ACTION:
    case SERVOTWIN_DETAIL:
        outcome->confidence = session->active.confidence;
        break;
    default: /* not judged */
        outcome->confidence = 0.0;
        break;
    }
    outcome->length = length;
    if (judgement->has_judged) {
        outcome->worst_sensor = judgement->worst_sensor;
        outcome->worst = judgement->worst;
    }
}

static bool is_any_pending(const servotwin_session *session)
{
    bool is_pending = false;
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        const servotwin_real change = servotwin_evidence_of_change(&session->evidence[length], length);
        const servotwin_real unknown = servotwin_evidence_of_unknown(&session->evidence[length], length);
        const servotwin_real most = (change > unknown) ? change : unknown;
        is_pending = is_pending || (most >= servotwin_tuning.pending_share);
    }
    return is_pending;
}

/* Raises, holds or drops an action, and updates the finding. */
static void decide(servotwin_session *session)
{
    const int32_t withheld = withheld_input(session);
    servotwin_raised candidate = session->active;
    if (!find_candidate(session, &candidate) || !raise_action(session, &candidate)) {
        hold(session, has_evidence(session));
    }
    const servotwin_raised *raised = &session->active;
    servotwin_outcome said = finding_of(SERVOTWIN_NO_FAULT, alarm_of(session, is_any_pending(session)));
    int32_t length = 0;
    if (raised->is_raised) {
        said.finding = (raised->detail != SERVOTWIN_NONE) ? SERVOTWIN_DETAIL : SERVOTWIN_ACTION;
        said.actuator = raised->actuator;
        said.action = raised->action;
        said.detail = raised->detail;
        length = raised->length;
    } else if (withheld != SERVOTWIN_NONE) {
        said.finding = SERVOTWIN_ENVIRONMENT_INVALID;
        said.input = withheld;
        said.why = SERVOTWIN_DOUBTFUL;
    } else {
        length = find_without_action(session, &said);
    }
    tell(session, &said, length);
}

/* ---- A sample. ---- */

/* Takes a new window into the doubt about each boundary. */
static void take_doubts(servotwin_session *session, int32_t length)
{
    for (int32_t boundary = 0; boundary < SERVOTWIN_BOUNDARIES; boundary++) {
        const servotwin_real reading = session->last_input[servotwin_boundaries[boundary].input];
        bool agreed = false;
        for (int32_t other = 0; other < SERVOTWIN_LENGTHS; other++) {
            const bool is_alike = servotwin_lengths[other].is_corrected == servotwin_lengths[length].is_corrected;
            agreed = agreed || (is_alike && servotwin_has_agreed(&session->doubts[other][boundary]));
        }
        servotwin_doubt_take(
            &session->doubts[length][boundary], boundary, length, &session->rings[length].window, reading, agreed);
    }
}

static void judge_windows(servotwin_session *session)
{
    bool masked[SERVOTWIN_ACTUATORS];
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        masked[actuator] = is_masked(session, actuator);
    }
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        const servotwin_ring *ring = &session->rings[length];
        if (ring->has_ended && servotwin_is_full(ring, length)) {
            servotwin_judgement *judgement = &session->judgements[length];
            servotwin_judge(judgement, &session->scratch, length, &ring->window, masked, session->stands_in,
                session->unpaired);
            servotwin_evidence_take(&session->evidence[length], length, judgement);
            session->has_judged = true;
            take_doubts(session, length);
        }
    }
}

/* Adds the sample to all windows; says whether any is complete. */
static bool add_to_windows(servotwin_session *session, const servotwin_real *twin)
{
    const bool is_trusted = (session->outcome.alarm == SERVOTWIN_NORMAL);
    servotwin_divided_sample sample = { session->divided, session->measured, twin, session->spreads.spreads };
    servotwin_divide_by_spread(&session->spreads, session->measured, twin, session->divided);
    bool has_new =
        servotwin_stream_add(&session->streams[0], session->rings, &servotwin_stream_plans[0], &sample);
    if (servotwin_stream_plans[1].lengths > 0) {
        const bool is_settled = servotwin_baseline_is_settled(&session->baseline);
        if (!is_settled || is_trusted) {
            servotwin_baseline_learn(&session->baseline, session->divided, twin);
        }
        if (is_settled) {
            for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
                const servotwin_real mean = session->stands_in[sensor] ? 0.0 : session->baseline.means[sensor];
                session->corrected[sensor] = session->divided[sensor] - mean;
            }
            sample.judged = session->corrected;
            const bool has_corrected =
                servotwin_stream_add(&session->streams[1], session->rings, &servotwin_stream_plans[1], &sample);
            has_new = has_new || has_corrected;
        }
    }
    return has_new;
}

static void take_sample(servotwin_session *session, const servotwin_real *twin, bool is_settled)
{
    const bool is_lacking =
        (session->outcome.alarm == SERVOTWIN_NO_DATA) || (session->outcome.alarm == SERVOTWIN_ERROR);
    session->gap = 0U;
    if (!is_settled) {
        say_unjudged(session, alarm_of(session, false));
    } else {
        const bool has_new = add_to_windows(session, twin);
        if (has_new) {
            judge_windows(session);
        }
        if (has_new && session->has_judged) {
            decide(session);
        } else if (is_lacking || !session->has_judged) {
            say_unjudged(session, alarm_of(session, false));
        } else {
            /* What was found stays. */
        }
    }
}

/* A sample whose inputs are there. While the twin recovers from missing ones nothing changes. */
static void push_values(
    servotwin_session *session, const servotwin_real *measured, const servotwin_real *twin, bool is_settled)
{
    switch (copy_measured(session, measured, twin)) {
    case USABLE:
        session->gap = 0U;
        if (session->recovering > 0U) {
            session->recovering--;
        } else {
            take_sample(session, twin, is_settled);
        }
        break;
    case MISSING_VALUE:
        lack(session, SERVOTWIN_NO_DATA);
        break;
    case WRONG_VALUE:
    default:
        lack(session, SERVOTWIN_ERROR);
        break;
    }
}

const servotwin_outcome *servotwin_session_push(
    servotwin_session *session, const servotwin_real *inputs, const servotwin_real *measured,
    const servotwin_real *twin)
{
    servotwin_outcome invalid = finding_of(SERVOTWIN_ENVIRONMENT_INVALID, SERVOTWIN_NORMAL);
    session->outcome.sample = session->samples;
    if (!is_plausible(session, inputs, &invalid)) {
        distrust(session, &invalid);
    } else {
        /* The twin settles by its inputs, whether or not all sensors are there. */
        const bool is_settled = (session->settling == 0U);
        if (!is_settled) {
            session->settling--;
        }
        if (session->missing > 0U) {
            session->recovering = servotwin_tuning.recovering_samples;
        } else {
            push_values(session, measured, twin, is_settled);
        }
    }
    session->samples++;
    return &session->outcome;
}

const servotwin_outcome *servotwin_session_push_without_twin(servotwin_session *session)
{
    session->outcome.sample = session->samples;
    servotwin_session_restart(session);
    say_unjudged(session, SERVOTWIN_ERROR);
    session->samples++;
    return &session->outcome;
}

/* ---- Start test. ---- */

static void mix_number(uint64_t *mixture, servotwin_real number)
{
    const servotwin_bits bits = isnan(number) ? SERVOTWIN_BITS_OF_MISSING : servotwin_bits_of(number);
    *mixture = (*mixture ^ (uint64_t)bits) * 0x100000001b3U;
}

/* A sample of the start test, whose residuals are far outside of their bands. Its inputs are part of the answer. */
static void push_known(servotwin_session *session, int32_t k, uint64_t *mixture)
{
    servotwin_real inputs[SERVOTWIN_INPUTS];
    servotwin_real measured[SERVOTWIN_SENSORS];
    servotwin_real twin[SERVOTWIN_SENSORS];
    for (int32_t input = 0; input < SERVOTWIN_INPUTS; input++) {
        const servotwin_real width = servotwin_inputs[input].largest - servotwin_inputs[input].least;
        const servotwin_real step = width * 0x1p-20;
        inputs[input] = servotwin_known_inputs[input];
        if ((k % 2) == 1) {
            inputs[input] = inputs[input] + step;
        }
        mix_number(mixture, inputs[input]);
    }
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        const int32_t of_signal = ((5 * k) + (3 * sensor)) % 17;
        const int32_t of_residual = 1 + (((7 * k) + (11 * sensor)) % 13);
        const servotwin_real signal = (servotwin_real)of_signal * 0x1p-4;
        const servotwin_real residual = (servotwin_real)of_residual * 0x1p-3;
        const servotwin_real deviation = servotwin_sensors[sensor].scale * residual;
        twin[sensor] = servotwin_sensors[sensor].scale * signal;
        measured[sensor] = twin[sensor] + deviation;
    }
    (void)servotwin_session_push(session, inputs, measured, twin);
}

/* Whether the first windows of known samples are judged as in training, to the bit. */
static bool knows_answer(servotwin_session *session)
{
    const servotwin_length *length = &servotwin_lengths[0];
    const int32_t samples = length->span.pane_samples * (length->span.panes + KNOWN_PANES);
    const servotwin_judgement *judgement = &session->judgements[0];
    uint64_t mixture = 0xcbf29ce484222325U;
    servotwin_session_at_rest(session);
    for (int32_t k = 0; k < samples; k++) {
        push_known(session, k, &mixture);
    }
    for (int32_t view = 0; view < length->views; view++) {
        for (int32_t feature = 0; feature < SERVOTWIN_FEATURES; feature++) {
            mix_number(&mixture, session->scratch.rows[view][feature]);
        }
    }
    mix_number(&mixture, judgement->probabilities[SERVOTWIN_HEALTHY]);
    for (int32_t claim = 1; claim < SERVOTWIN_HYPOTHESES; claim++) {
        mix_number(&mixture, judgement->probabilities[claim]);
        mix_number(&mixture, margin(session, 0, claim));
    }
    for (int32_t actuator = 0; actuator < SERVOTWIN_ACTUATORS; actuator++) {
        mix_number(&mixture, servotwin_margin_of_actuator(&session->evidence[0], 0, actuator));
        mix_number(&mixture, servotwin_common_mode(actuator, &session->rings[0].window, 0));
    }
    for (int32_t boundary = 0; boundary < SERVOTWIN_BOUNDARIES; boundary++) {
        mix_number(&mixture, servotwin_boundary_evidence(&session->doubts[0][boundary], boundary));
    }
    if (length->known_classes > 0) {
        mix_number(&mixture, servotwin_novelty(0, 0, session->scratch.rows[0]));
    }
    mix_number(&mixture, servotwin_evidence_of_change(&session->evidence[0], 0));
    mix_number(&mixture, servotwin_evidence_of_unknown(&session->evidence[0], 0));
    return mixture == servotwin_known_answer;
}

/* Whether all files of the diagnosis are compiled with the arithmetic of training. */
static bool keep_rules(void)
{
    return servotwin_math_keeps_rules() && servotwin_random_keeps_rules() && servotwin_models_keeps_rules()
        && servotwin_windows_keeps_rules() && servotwin_features_keeps_rules() && servotwin_judge_keeps_rules()
        && servotwin_decision_keeps_rules() && servotwin_boundary_keeps_rules() && servotwin_keeps_rules();
}

bool servotwin_session_start(servotwin_session *session)
{
    bool is_exact = keep_rules();
    clear_session(session);
    if (servotwin_known_answer != 0U) {
        is_exact = knows_answer(session) && is_exact;
        clear_session(session);
    }
    return is_exact;
}
