/*
 * A running diagnosis: one call for each sample. All state is in one struct, so there may be several. Nothing is allocated,
 * and every call ends after a bounded number of steps.
 *
 * Measured and twin values are in SI units, in the order of servotwin_sensors; NaN is a missing value. Inputs are in the
 * order of servotwin_inputs.
 */
#ifndef SERVOTWIN_SESSION_H
#define SERVOTWIN_SESSION_H

#include "servotwin_exact.h"
#include "servotwin_boundary.h"
#include "servotwin_decision.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    SERVOTWIN_UNJUDGED, /* too few samples, or the twin is settling */
    SERVOTWIN_NO_FAULT,
    SERVOTWIN_DETECTED, /* a deviation of unclear cause */
    SERVOTWIN_ACTUATOR, /* a fault in an actuator, but the action is unclear */
    SERVOTWIN_ACTION,
    SERVOTWIN_DETAIL,
    SERVOTWIN_UNKNOWN, /* a deviation that resembles no training data */
    SERVOTWIN_ENVIRONMENT_INVALID /* an input is implausible */
} servotwin_finding;

typedef enum {
    SERVOTWIN_MISSING,
    SERVOTWIN_NOT_FINITE,
    SERVOTWIN_OUT_OF_RANGE,
    SERVOTWIN_FROZEN,
    SERVOTWIN_CONTRADICTS,
    SERVOTWIN_DOUBTFUL /* a wrong reading would explain all deviations, and so would a fault */
} servotwin_why;

typedef enum {
    SERVOTWIN_NORMAL,
    SERVOTWIN_PENDING, /* there is evidence, but not enough for an action */
    SERVOTWIN_RAISED,
    SERVOTWIN_RECOVERING, /* the evidence for the raised action has ended */
    SERVOTWIN_NO_DATA,
    SERVOTWIN_ERROR
} servotwin_alarm;

typedef struct {
    bool is_raised; /* the other members have a meaning */
    int32_t actuator;
    int32_t action;
    int32_t detail; /* or SERVOTWIN_NONE */
    uint64_t sample; /* the sample that raised it */
    int32_t length; /* the window length that confirmed it last */
    servotwin_real confidence; /* the probability of all of this, in the last window that named it */
    servotwin_real lead; /* the confidence of windows that named the detail, less that of those that named another one */
} servotwin_raised;

/* The result after a sample. */
typedef struct {
    uint64_t sample;
    uint64_t since_sample; /* since when finding and alarm are these: the next sample, if a command changed them */
    servotwin_finding finding;
    int32_t actuator; /* of the finding; here and below SERVOTWIN_NONE where it has none */
    int32_t action;
    int32_t detail;
    int32_t input; /* the implausible input */
    servotwin_why why;
    servotwin_alarm alarm;
    servotwin_raised raised; /* the action to carry out, whatever the finding; a shutdown before everything else */
    servotwin_real confidence; /* probability of the finding */
    int32_t length; /* the window length that found it */
    int32_t worst_sensor; /* the largest residual, in parts of its band */
    servotwin_real worst;
    int32_t lost; /* number of lost sensors */
} servotwin_outcome;

typedef struct {
    uint64_t samples;
    uint32_t settling; /* samples that are not judged, because the twin settles */
    uint32_t gap; /* consecutive samples without usable values */
    bool has_judged;
    /* Inputs. */
    servotwin_real last_input[SERVOTWIN_INPUTS]; /* missing before the first */
    uint32_t repeats[SERVOTWIN_INPUTS];
    uint32_t missing; /* consecutive samples in which an input is missing */
    uint32_t recovering; /* samples until the twin has recovered from that */
    /* Sensors. */
    bool is_taken_out[SERVOTWIN_SENSORS];
    bool is_lost[SERVOTWIN_SENSORS];
    uint32_t against[SERVOTWIN_SENSORS]; /* consecutive samples that contradict is_lost */
    bool has_last[SERVOTWIN_SENSORS];
    servotwin_real last_residual[SERVOTWIN_SENSORS]; /* parts of scale */
    uint32_t differences[SERVOTWIN_SENSORS]; /* of successive residuals, up to those that are remembered */
    servotwin_real variance[SERVOTWIN_SENSORS]; /* half of their mean square */
    bool stands_in[SERVOTWIN_SENSORS];
    bool unpaired[SERVOTWIN_SENSORS]; /* another actuator lacks the sensor */
    servotwin_real measured[SERVOTWIN_SENSORS]; /* with stand-ins, SI */
    servotwin_real divided[SERVOTWIN_SENSORS]; /* the measured values by the spreads of their residuals */
    servotwin_real corrected[SERVOTWIN_SENSORS]; /* less the baseline, SI */
    /* Windows. */
    servotwin_spreads spreads;
    servotwin_stream streams[2]; /* of residuals as they are, and beyond the baseline */
    servotwin_ring rings[SERVOTWIN_LENGTHS];
    servotwin_baseline baseline;
    servotwin_judgement judgements[SERVOTWIN_LENGTHS];
    servotwin_evidence evidence[SERVOTWIN_LENGTHS];
    servotwin_doubt doubts[SERVOTWIN_LENGTHS][SERVOTWIN_MOST_BOUNDARIES];
    servotwin_scratch scratch;
    /* Alarm. */
    servotwin_raised active; /* the action whose evidence has not ended for long enough */
    bool is_recovering;
    uint64_t recovering_since;
    servotwin_raised stands[SERVOTWIN_ACTUATORS]; /* shutdowns that were raised and not withdrawn */
    bool is_off[SERVOTWIN_ACTUATORS];
    bool is_inhibited[SERVOTWIN_ACTUATORS];
    servotwin_outcome outcome;
} servotwin_session;

/*
 * Tests the arithmetic of every file, runs a window with a known answer, then clears everything. The
 * actuator may be in motion, but the twin begins at rest: at first it settles, without judgement, as after a restart.
 * Returns false, and the session must not be used, if this build computes otherwise than in training.
 */
bool servotwin_session_start(servotwin_session *session);

/* The actuator begins at rest, as its twin does: after a start, the first sample is judged. */
void servotwin_session_at_rest(servotwin_session *session);

/* Takes one sample and returns the result. */
const servotwin_outcome *servotwin_session_push(
    servotwin_session *session, const servotwin_real *inputs, const servotwin_real *measured,
    const servotwin_real *twin);

/* Starts again with a twin that must settle first, without judgement. What is raised stands. */
void servotwin_session_restart(servotwin_session *session);

/* Takes a sample for which the twin could not be simulated. The next one needs a twin that settles again. */
const servotwin_outcome *servotwin_session_push_without_twin(servotwin_session *session);

/* Here and below, false, and nothing is done, for an actuator or a sensor that is not there. */

/* The flight control computer switched an actuator off; it is no longer judged. A shutdown raised for it stands. */
bool servotwin_session_switched_off(servotwin_session *session, int32_t actuator);

/* An actuator is on and judged again. A shutdown that stands for it is raised again. */
bool servotwin_session_switched_on(servotwin_session *session, int32_t actuator);

/* An actuator is on and judged again, and what was raised for it is withdrawn. */
bool servotwin_session_release(servotwin_session *session, int32_t actuator);

/* Withdraws everything that was raised. All is judged anew, also a fault that lasts. */
void servotwin_session_reset_alarm(servotwin_session *session);

/* Stops or resumes judging an actuator that is on. */
bool servotwin_session_inhibit(servotwin_session *session, int32_t actuator, bool is_inhibited);

/* Takes a sensor out of the diagnosis, or puts it back. */
bool servotwin_session_take_out(servotwin_session *session, int32_t sensor, bool is_out);

#ifdef __cplusplus
}
#endif

#endif
