/*
 * The virtual twin: the simulated actuators, stepped from sample to sample by a linearly implicit (Rosenbrock) method. It
 * needs no iteration; with error control it adapts its steps, and with a fixed step it always does the same work. All
 * state is in one struct, so there may be several, and a copy of the struct continues with the same bits.
 */
#ifndef SERVOTWIN_TWIN_H
#define SERVOTWIN_TWIN_H

#include "servotwin_exact.h"
#include "servotwin_equations.h"

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* An input at a sample. */
typedef struct {
    double value; /* SI */
    double slope_per_s; /* only inputs that are cubic use it */
} servotwin_knot;

/* The course of an input between samples. */
typedef enum {
    SERVOTWIN_HOLD, /* the value of the preceding sample */
    SERVOTWIN_LINE,
    SERVOTWIN_CUBIC /* with the slopes at the samples */
} servotwin_between;

typedef enum {
    SERVOTWIN_SETTLING, /* search for the steady state, with the inputs of time zero */
    SERVOTWIN_FOLLOWING, /* the search has failed: the system itself is simulated, with the inputs of time zero */
    SERVOTWIN_SETTLED,
    SERVOTWIN_RUNNING,
    SERVOTWIN_STEP_TOO_SMALL, /* the error stayed too large down to the smallest step */
    SERVOTWIN_BECAME_INFINITE /* a value became infinite or not a number */
} servotwin_phase;

/* The range and the turns of a state in a window, over its scale. */
typedef struct {
    double low;
    double high;
    uint32_t turns;
} servotwin_swing;

/* The progress of following a system that finds no rest. */
typedef struct {
    uint32_t attempts;
    double window_end_s;
    servotwin_swing window[SERVOTWIN_TWIN_STATES];
    servotwin_swing window_before[SERVOTWIN_TWIN_STATES];
    bool rises[SERVOTWIN_TWIN_STATES];
    /* States, inputs and held values at the end of the search. */
    double states[SERVOTWIN_TWIN_STATES];
    double held[SERVOTWIN_TWIN_HELD];
} servotwin_following;

typedef struct {
    /* The arrays of a step. */
    double constants[SERVOTWIN_TWIN_CONSTANTS];
    double variables[SERVOTWIN_TWIN_VARIABLES];
    double gradients[SERVOTWIN_TWIN_GRADIENTS];
    double factors[SERVOTWIN_TWIN_FACTORS];
    double stages[SERVOTWIN_TWIN_STAGES * SERVOTWIN_TWIN_STATES];
    double states[SERVOTWIN_TWIN_STATES]; /* at the beginning of the step */
    double new_states[SERVOTWIN_TWIN_STATES];
    /* Inputs: from this sample on, and in the time since the step began. */
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    double from_s;
    double pieces[SERVOTWIN_TWIN_INPUTS][4];
    double cubics[SERVOTWIN_TWIN_INPUTS][4];
    /* The step. */
    servotwin_phase phase;
    double time_s;
    double wanted_s; /* the step that the error control requests */
    double step_s;
    double end_s;
    double target_s; /* the time to be reached, and the one after it */
    double after_s;
    uint64_t next_sample;
    uint64_t next_tick[SERVOTWIN_TWIN_MOST_CLOCKS];
    uint32_t rejections;
    uint32_t settling_steps;
    double attempt_rate_per_s;
    servotwin_following following;
    /* Parameters that apply from the next sample on. */
    bool has_loaded;
    double parameters[SERVOTWIN_TWIN_PARAMETERS];
} servotwin_twin;

/* The control of the steps. */
typedef struct {
    double period_s; /* of samples */
    bool is_fixed;
    double fixed_step_s;
    double tolerance; /* permitted error over scale */
    double max_step_s;
    double attempt_rate_limit_per_s; /* above it, a larger error is accepted */
    double reciprocal_gamma;
    double growth_exponent; /* of the error over the permitted one */
    double alpha[SERVOTWIN_TWIN_STAGES];
    double gamma_sum[SERVOTWIN_TWIN_STAGES];
} servotwin_step_control;

/* The first guess of a state: the parameter with this index, or without one (-1) the value. */
typedef struct {
    int32_t parameter;
    double value;
} servotwin_guess;

/* Possible values, SI. Others count as missing. */
typedef struct {
    double low;
    double high;
} servotwin_range;

/* What the flight control computer changes: an input, a parameter of the twin, or a sensor that it ignores. */
typedef enum {
    SERVOTWIN_SETS_INPUT,
    SERVOTWIN_SETS_PARAMETER,
    SERVOTWIN_TAKES_OUT
} servotwin_kind_of_change;

typedef struct {
    servotwin_kind_of_change kind;
    int32_t place; /* of the input, the parameter or the sensor */
    double value; /* SI */
} servotwin_change;

/* What the study does after an action. */
typedef struct {
    int32_t actuator;
    int32_t action;
    int32_t detail; /* -1 for all others */
    bool switches_off;
    bool is_seen; /* the inputs show that the actuator is off */
    int32_t first_change; /* of servotwin_twin_changes */
    int32_t end_of_changes;
} servotwin_reaction;

/* servotwin_twin_tables.c holds these. */
extern const servotwin_step_control servotwin_twin_control;
extern const servotwin_guess servotwin_twin_guesses[SERVOTWIN_TWIN_STATES];
extern const double servotwin_twin_scales[SERVOTWIN_TWIN_STATES]; /* reciprocal */
extern const double servotwin_twin_allowances[SERVOTWIN_TWIN_STATES]; /* the same with error weights */
extern const double servotwin_twin_lowest[SERVOTWIN_TWIN_STATES]; /* in the search for the steady state */
extern const servotwin_between servotwin_twin_between[SERVOTWIN_TWIN_INPUTS];
extern const int32_t servotwin_twin_slopes[SERVOTWIN_TWIN_INPUTS]; /* places among the gradients */
extern const double servotwin_twin_clock_periods_s[SERVOTWIN_TWIN_MOST_CLOCKS];
extern const double servotwin_twin_parameters[SERVOTWIN_TWIN_PARAMETERS]; /* of the healthy system */
extern const servotwin_knot servotwin_twin_defaults[SERVOTWIN_TWIN_INPUTS];
extern const servotwin_range servotwin_twin_possible[]; /* of inputs, then of sensors */
extern const servotwin_change servotwin_twin_changes[];
extern const servotwin_reaction servotwin_twin_reactions[];
extern const uint64_t servotwin_twin_known_answer;

/*
 * Simulates a few samples and compares their bits with those of training; leaves the twin before its start. Returns false
 * if this build computes otherwise.
 */
bool servotwin_twin_is_exact(servotwin_twin *twin);

/* Searches for the steady state at constant inputs and places the twin on sample 0. Returns false on a failure. */
bool servotwin_twin_start(servotwin_twin *twin, const double *parameters, const servotwin_knot *inputs);

/*
 * Simulates up to the next sample, at which the inputs are these. Returns false on a failure, which only
 * servotwin_twin_start clears.
 */
bool servotwin_twin_step(servotwin_twin *twin, const servotwin_knot *inputs);

/*
 * Simulates up to any later time with constant inputs, for hosts with steps of their own. A twin that has been advanced is
 * not stepped any more. Returns false on a failure.
 */
bool servotwin_twin_advance(servotwin_twin *twin, const double *values, double to_s);

/*
 * For hosts that integrate the states themselves: evaluates all equations for the twin's states, held values and these
 * inputs; and ticks the clocks that are due at the twin's time. Returns the time of the next tick, infinite without clocks.
 */
void servotwin_twin_refresh(servotwin_twin *twin, const double *values);
double servotwin_twin_tick_clocks(servotwin_twin *twin, const double *values);

/* Other parameters, from the next sample on. */
void servotwin_twin_load(servotwin_twin *twin, const double *parameters);

#ifdef __cplusplus
}
#endif

#endif
