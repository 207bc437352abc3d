#include "servotwin_twin.h"

#include "servotwin_math.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#define STATES SERVOTWIN_TWIN_STATES
#define INPUTS SERVOTWIN_TWIN_INPUTS
#define CLOCKS SERVOTWIN_TWIN_CLOCKS
#define FIRST_INPUT STATES
#define FIRST_DERIVATIVE (SERVOTWIN_TWIN_SUMS_END - STATES)
#define LAST_STAGE ((SERVOTWIN_TWIN_STAGES - 1) * STATES)

/* Events closer together than this count as one, s. */
#define SAME_TIME_S 1e-9
/* Shortest and first step, s. */
#define MIN_STEP_S 1e-11
#define FIRST_STEP_S 1e-4
/* Rejections in a row after which the twin fails. */
#define MAX_REJECTIONS 60U
/* The search for the steady state: its steps, the change over scale that it accepts and aims at, and its end. */
#define MAX_SETTLING_STEPS 2000U
#define MAX_SETTLING_CHANGE 0.5
#define WANTED_SETTLING_CHANGE 0.1
#define MAX_SETTLING_STEP_S 1e4
#define MAX_SETTLING_S 1e5
/* At rest no state changes faster than this part of its scale, 1/s. */
#define AT_REST_PER_S 1e-9
/* Largest factor on the tolerance at a high rate of attempts. */
#define MAX_RELAXATION 1024.0
/* Following: error, attempts and time, first window; a limit cycle has this many turns, change and least swing. */
#define FOLLOWING_TOLERANCE 1e-5
#define MAX_FOLLOWING_ATTEMPTS 20000U
#define MAX_FOLLOWING_S 1e5
#define FIRST_WINDOW_S 1.0
#define MIN_TURNS 8U
#define MAX_CHANGE 0.02
#define MIN_SWING 1e-6
/* Samples of the start test. */
#define KNOWN_SAMPLES 8

static const servotwin_swing no_swing = { HUGE_VAL, -HUGE_VAL, 0U };

static bool seeks_rest(const servotwin_twin *twin)
{
    return (twin->phase == SERVOTWIN_SETTLING) || (twin->phase == SERVOTWIN_FOLLOWING);
}

static bool is_finite(double number)
{
    return fabs(number) <= DBL_MAX;
}

/* ---------------------------------------------------------------- Inputs. */

/* The course of an input in the time since the step began. */
static void move_input(servotwin_twin *twin, int32_t input)
{
    const double *piece = twin->pieces[input];
    double *cubic = twin->cubics[input];
    const double t = twin->time_s - twin->from_s;
    cubic[0] = piece[0];
    cubic[1] = 0.0;
    cubic[2] = 0.0;
    cubic[3] = 0.0;
    if ((twin->phase == SERVOTWIN_RUNNING) && (t >= -SAME_TIME_S)) {
        const double last = t * piece[3];
        const double bend = piece[2] + last;
        const double bend_change = t * bend;
        const double slope = piece[1] + bend_change;
        const double change = t * slope;
        const double tripled = t * 3.0;
        const double last_tripled = tripled * piece[3];
        const double doubled = 2.0 * piece[2];
        const double bend_of_slope = doubled + last_tripled;
        const double slope_change = t * bend_of_slope;
        cubic[0] = piece[0] + change;
        cubic[1] = piece[1] + slope_change;
        cubic[2] = piece[2] + last_tripled;
        cubic[3] = piece[3];
    }
}

static void move_inputs(servotwin_twin *twin)
{
    for (int32_t input = 0; input < INPUTS; input++) {
        twin->gradients[servotwin_twin_slopes[input]] = 0.0;
        move_input(twin, input);
    }
}

/* Writes the inputs at a time after the beginning of the step to the variables. */
static void write_inputs(servotwin_twin *twin, double offset_s)
{
    for (int32_t input = 0; input < INPUTS; input++) {
        const double *cubic = twin->cubics[input];
        const double last = offset_s * cubic[3];
        const double bend = cubic[2] + last;
        const double bend_change = offset_s * bend;
        const double slope = cubic[1] + bend_change;
        const double change = offset_s * slope;
        twin->variables[FIRST_INPUT + input] = cubic[0] + change;
    }
}

/* ------------------------------------------------------------ Evaluations. */

static void write_beginning(servotwin_twin *twin)
{
    (void)memcpy(twin->variables, twin->states, sizeof twin->states);
    write_inputs(twin, 0.0);
}

static void evaluate_with_jacobian(servotwin_twin *twin)
{
    write_beginning(twin);
    for (int32_t input = 0; input < INPUTS; input++) {
        twin->gradients[servotwin_twin_slopes[input]] = twin->cubics[input][1];
    }
    servotwin_twin_begin(twin->constants, twin->variables, twin->gradients);
}

/* The largest rate of a state over its scale, 1/s. */
static double largest_rate_per_s(const servotwin_twin *twin)
{
    double largest = 0.0;
    for (int32_t state = 0; state < STATES; state++) {
        const double relative = twin->variables[FIRST_DERIVATIVE + state] * servotwin_twin_scales[state];
        const double rate = fabs(relative);
        largest = (rate < largest) ? largest : rate;
    }
    return largest;
}

/* The largest error of the last step over these scales; NaN if any is NaN. */
static double largest_error(const servotwin_twin *twin, const double *reciprocal_scales)
{
    double largest = 0.0;
    double poison = 0.0;
    for (int32_t state = 0; state < STATES; state++) {
        const double relative = fabs(twin->stages[LAST_STAGE + state]) * reciprocal_scales[state];
        const double nothing = relative * 0.0;
        largest = (largest < relative) ? relative : largest;
        poison = poison + nothing;
    }
    return largest + poison;
}

/* Tries the step; returns its error over scale. */
static double rosenbrock(servotwin_twin *twin)
{
    const servotwin_step_control *control = &servotwin_twin_control;
    const double reciprocal = 1.0 / twin->step_s;
    const double diagonal = reciprocal * control->reciprocal_gamma;
    servotwin_twin_factor(&diagonal, twin->gradients, twin->factors);
    for (int32_t stage = 0; stage < SERVOTWIN_TWIN_STAGES; stage++) {
        double *right = &twin->stages[stage * STATES];
        const double slope_factor = twin->step_s * control->gamma_sum[stage];
        if (stage == 0) {
            servotwin_twin_solve_first(twin->variables, &slope_factor, twin->gradients, twin->factors, right);
        } else {
            servotwin_twin_sums(stage, &reciprocal, twin->states, twin->stages, twin->variables, right);
            /* The last two stages have the same time. */
            if (control->alpha[stage] != control->alpha[stage - 1]) {
                const double offset_s = twin->step_s * control->alpha[stage];
                write_inputs(twin, offset_s);
            }
            servotwin_twin_motion(twin->constants, twin->variables);
            servotwin_twin_solve(twin->variables, &slope_factor, twin->gradients, twin->factors, right);
        }
    }
    for (int32_t state = 0; state < STATES; state++) {
        twin->new_states[state] = twin->variables[state] + twin->stages[LAST_STAGE + state];
    }
    return largest_error(twin, servotwin_twin_allowances);
}

/*
 * Reduces the step to its first stage: a step of the implicit Euler method. In the search for the steady state accuracy
 * does not matter, and this method also converges where the system itself would oscillate.
 */
static double keep_first_stage(servotwin_twin *twin)
{
    for (int32_t state = 0; state < STATES; state++) {
        const double change = twin->stages[state];
        const double new_state = twin->states[state] + change;
        const double lowest = servotwin_twin_lowest[state];
        twin->new_states[state] = (lowest < new_state) ? new_state : lowest;
        twin->stages[LAST_STAGE + state] = change;
    }
    return largest_error(twin, servotwin_twin_scales);
}

static double attempt(servotwin_twin *twin)
{
    const double error = rosenbrock(twin);
    return (twin->phase == SERVOTWIN_SETTLING) ? keep_first_stage(twin) : error;
}

/* ---------------------------------------------------------- Time and step. */

static void aim_at_sample(servotwin_twin *twin)
{
    const uint64_t following = twin->next_sample + 1U;
    twin->target_s = (double)twin->next_sample * servotwin_twin_control.period_s;
    twin->after_s = (double)following * servotwin_twin_control.period_s;
}

static bool is_at_target(const servotwin_twin *twin)
{
    return (twin->phase == SERVOTWIN_RUNNING) && (twin->target_s <= (twin->time_s + SAME_TIME_S));
}

static double tick_time_s(const servotwin_twin *twin, int32_t clock)
{
    return (double)twin->next_tick[clock] * servotwin_twin_clock_periods_s[clock];
}

/* During the search for the steady state a clock ticks at every step. */
static bool is_due(const servotwin_twin *twin, int32_t clock)
{
    return (twin->phase == SERVOTWIN_SETTLING) || (tick_time_s(twin, clock) <= (twin->time_s + SAME_TIME_S));
}

static void tick_due_clocks(servotwin_twin *twin)
{
    for (int32_t clock = 0; clock < CLOCKS; clock++) {
        if (is_due(twin, clock)) {
            write_beginning(twin);
            servotwin_twin_evaluate(twin->constants, twin->variables);
            servotwin_twin_tick(clock, twin->constants, twin->variables);
            if (twin->phase != SERVOTWIN_SETTLING) {
                twin->next_tick[clock]++;
            }
        }
    }
}

static double earlier(const servotwin_twin *twin, double event_s, double time_s)
{
    return ((time_s > (twin->time_s + SAME_TIME_S)) && (time_s < event_s)) ? time_s : event_s;
}

/* The next time that no step may cross, s. */
static double next_event_s(const servotwin_twin *twin)
{
    double event_s = HUGE_VAL;
    if (twin->phase == SERVOTWIN_RUNNING) {
        event_s = earlier(twin, event_s, twin->target_s);
        event_s = earlier(twin, event_s, twin->after_s);
    }
    for (int32_t clock = 0; clock < CLOCKS; clock++) {
        event_s = earlier(twin, event_s, tick_time_s(twin, clock));
    }
    return event_s;
}

/* Whether the step is fixed; the search for the steady state always has error control. */
static bool has_fixed_step(const servotwin_twin *twin)
{
    return servotwin_twin_control.is_fixed && !seeks_rest(twin);
}

/* In the search, sampled controllers act once a step, so the step is at most one period. */
static void choose_settling_step(servotwin_twin *twin)
{
    double longest_s = HUGE_VAL;
    for (int32_t clock = 0; clock < CLOCKS; clock++) {
        const double period_s = servotwin_twin_clock_periods_s[clock];
        longest_s = (period_s < longest_s) ? period_s : longest_s;
    }
    twin->step_s = (twin->wanted_s < longest_s) ? twin->wanted_s : longest_s;
    twin->end_s = twin->time_s + twin->step_s;
}

/* Chooses the step that the error control requests, but ends it on the next event and avoids a tiny one before it. */
static void choose_running_step(servotwin_twin *twin)
{
    const bool is_fixed = has_fixed_step(twin);
    const double wanted_s = is_fixed ? servotwin_twin_control.fixed_step_s : twin->wanted_s;
    const double event_s = next_event_s(twin);
    const double left_s = event_s - twin->time_s;
    if (wanted_s >= (left_s * 0.999)) {
        twin->step_s = left_s;
        twin->end_s = event_s;
    } else if (((wanted_s * 2.0) > left_s) && !is_fixed) {
        twin->step_s = left_s * 0.5;
        twin->end_s = twin->time_s + twin->step_s;
    } else {
        twin->step_s = wanted_s;
        twin->end_s = twin->time_s + wanted_s;
    }
}

/* The permitted error at this rate of attempts: at order four it brings the rate back to its limit. */
static double relaxed_tolerance(const servotwin_twin *twin)
{
    const double busy = twin->attempt_rate_per_s / servotwin_twin_control.attempt_rate_limit_per_s;
    const double squared = busy * busy;
    const double wanted = squared * squared;
    const double atleast = (wanted < 1.0) ? 1.0 : wanted;
    const double factor = (atleast > MAX_RELAXATION) ? MAX_RELAXATION : atleast;
    return servotwin_twin_control.tolerance * factor;
}

/* The permitted error over scale; 1 for a fixed step. */
static double allowed_error(const servotwin_twin *twin)
{
    double allowed = 1.0;
    if (twin->phase == SERVOTWIN_SETTLING) {
        allowed = WANTED_SETTLING_CHANGE;
    } else if (twin->phase == SERVOTWIN_FOLLOWING) {
        allowed = FOLLOWING_TOLERANCE;
    } else if (!servotwin_twin_control.is_fixed) {
        allowed = relaxed_tolerance(twin);
    } else {
        /* No error control. */
    }
    return allowed;
}

/* The factor by which the step could grow for its error. */
static double growth_of(const servotwin_twin *twin, double error)
{
    const double relative = error / allowed_error(twin);
    const double ratio = (1e-6 < relative) ? relative : 1e-6;
    return servotwin_twin_power(ratio, servotwin_twin_control.growth_exponent) * 0.9;
}

static bool accepts(const servotwin_twin *twin, double error)
{
    bool is_accepted = false;
    if (twin->phase == SERVOTWIN_SETTLING) {
        is_accepted = error <= MAX_SETTLING_CHANGE;
    } else if (has_fixed_step(twin)) {
        is_accepted = is_finite(error);
    } else {
        is_accepted = error <= allowed_error(twin);
    }
    return is_accepted;
}

/* Chooses the next step from this step's growth factor. */
static void adapt(servotwin_twin *twin, double factor, bool was_rejected)
{
    const double longest_s = seeks_rest(twin) ? MAX_SETTLING_STEP_S : servotwin_twin_control.max_step_s;
    const double most = ((twin->rejections > 0U) || was_rejected) ? 1.0 : 6.0;
    const double at_least = (factor < 0.1) ? 0.1 : factor;
    const double clamped = (at_least > most) ? most : at_least;
    double next_s = twin->step_s * clamped;
    /* A step that an event cut short allows no conclusion about longer ones. */
    if ((twin->rejections == 0U) && (next_s < twin->wanted_s) && (factor >= 1.0)) {
        next_s = twin->wanted_s;
    }
    twin->wanted_s = (next_s < longest_s) ? next_s : longest_s;
}

static void accept(servotwin_twin *twin)
{
    const double left = 1.0 - twin->step_s;
    twin->attempt_rate_per_s = twin->attempt_rate_per_s * ((left > 0.0) ? left : 0.0);
    twin->time_s = twin->end_s;
    twin->rejections = 0U;
    if (seeks_rest(twin)) {
        twin->settling_steps++;
    }
    (void)memcpy(twin->states, twin->new_states, sizeof twin->states);
}

/* -------------------------------------------------- Search for the steady state. */

static void start_step(servotwin_twin *twin)
{
    twin->time_s = 0.0;
    twin->wanted_s = FIRST_STEP_S;
    twin->rejections = 0U;
}

static void begin_following(servotwin_twin *twin)
{
    servotwin_following *following = &twin->following;
    following->attempts = 0U;
    following->window_end_s = FIRST_WINDOW_S;
    for (int32_t state = 0; state < STATES; state++) {
        following->window[state] = no_swing;
        following->window_before[state] = no_swing;
        following->rises[state] = false;
    }
    (void)memcpy(following->states, twin->states, sizeof twin->states);
    (void)memcpy(following->held, &twin->variables[FIRST_INPUT], sizeof following->held);
    twin->phase = SERVOTWIN_FOLLOWING;
    (void)memset(twin->next_tick, 0, sizeof twin->next_tick);
    start_step(twin);
    twin->step_s = FIRST_STEP_S;
    twin->end_s = FIRST_STEP_S;
}

static void end_search(servotwin_twin *twin)
{
    twin->phase = SERVOTWIN_SETTLED;
    (void)memset(twin->next_tick, 0, sizeof twin->next_tick);
}

/* Ends the search without a steady state: the run begins where the search ended. */
static void begin_on_the_move(servotwin_twin *twin)
{
    end_search(twin);
    (void)memcpy(twin->states, twin->following.states, sizeof twin->states);
    (void)memcpy(&twin->variables[FIRST_INPUT], twin->following.held, sizeof twin->following.held);
}

/* Whether the state that swings most turns at least eight times in each of two windows, with nearly the same swing. */
static bool has_limit_cycle(const servotwin_following *following)
{
    int32_t largest = 0;
    double size = following->window[0].high - following->window[0].low;
    for (int32_t state = 1; state < STATES; state++) {
        const double other = following->window[state].high - following->window[state].low;
        if (other >= size) {
            largest = state;
            size = other;
        }
    }
    const servotwin_swing *before = &following->window_before[largest];
    const double size_before = before->high - before->low;
    const double larger = (size_before > size) ? size_before : size;
    const uint32_t turns = following->window[largest].turns;
    const double change = fabs(size - size_before);
    const double most = MAX_CHANGE * larger;
    return (turns >= MIN_TURNS) && (before->turns >= MIN_TURNS) && (larger > MIN_SWING) && (change <= most);
}

static void begin_window(servotwin_following *following)
{
    following->window_end_s = following->window_end_s * 2.0;
    for (int32_t state = 0; state < STATES; state++) {
        following->window_before[state] = following->window[state];
        following->window[state] = no_swing;
    }
}

static void observe_states(servotwin_twin *twin)
{
    for (int32_t state = 0; state < STATES; state++) {
        servotwin_swing *swing = &twin->following.window[state];
        const double value = twin->states[state] * servotwin_twin_scales[state];
        const double rate = twin->variables[FIRST_DERIVATIVE + state] * servotwin_twin_scales[state];
        const bool rises = rate > 0.0;
        swing->low = (value < swing->low) ? value : swing->low;
        swing->high = (value > swing->high) ? value : swing->high;
        swing->turns += (twin->following.rises[state] != rises) ? 1U : 0U;
        twin->following.rises[state] = rises;
    }
}

/* Observes the states; returns whether the system has been followed long enough. */
static bool observe(servotwin_twin *twin)
{
    servotwin_following *following = &twin->following;
    const bool is_end_of_window = twin->time_s >= following->window_end_s;
    const bool is_cycle = is_end_of_window && has_limit_cycle(following);
    following->attempts++;
    if (!is_cycle) {
        if (is_end_of_window) {
            begin_window(following);
        }
        observe_states(twin);
    }
    return is_cycle || (following->attempts >= MAX_FOLLOWING_ATTEMPTS) || (twin->time_s > MAX_FOLLOWING_S);
}

static void look_for_rest(servotwin_twin *twin)
{
    if (largest_rate_per_s(twin) < AT_REST_PER_S) {
        end_search(twin);
    } else if (twin->phase == SERVOTWIN_FOLLOWING) {
        if (observe(twin)) {
            begin_on_the_move(twin);
        }
    } else if ((twin->settling_steps >= MAX_SETTLING_STEPS) || (twin->time_s > MAX_SETTLING_S)) {
        begin_following(twin);
    } else {
        /* The search goes on. */
    }
}

/* ----------------------------------------------------------------- Steps. */

/* Ticks clocks that are due, chooses the step and evaluates all equations. */
static void begin(servotwin_twin *twin)
{
    move_inputs(twin);
    tick_due_clocks(twin);
    if (twin->phase == SERVOTWIN_SETTLING) {
        choose_settling_step(twin);
    } else {
        choose_running_step(twin);
    }
    evaluate_with_jacobian(twin);
    if (seeks_rest(twin)) {
        look_for_rest(twin);
    }
}

static void give_up_if_stuck(servotwin_twin *twin, double error)
{
    const bool is_fixed = has_fixed_step(twin);
    const bool is_out = (twin->rejections > MAX_REJECTIONS) || (twin->wanted_s < MIN_STEP_S);
    if ((twin->rejections > 0U) && (is_fixed || is_out)) {
        if (twin->phase == SERVOTWIN_FOLLOWING) {
            begin_on_the_move(twin);
        } else {
            twin->phase = (is_finite(error) && !is_fixed) ? SERVOTWIN_STEP_TOO_SMALL : SERVOTWIN_BECAME_INFINITE;
        }
    }
}

/* Tries the step, accepts or rejects it, and plans the next. Returns false if there is none. */
static bool try_step(servotwin_twin *twin)
{
    const double error = attempt(twin);
    const double growth = is_finite(error) ? growth_of(twin, error) : 0.1;
    const bool is_accepted = accepts(twin, error);
    const bool was_rejected = twin->rejections > 0U;
    twin->attempt_rate_per_s = twin->attempt_rate_per_s + 1.0;
    if (is_accepted) {
        accept(twin);
    } else {
        twin->rejections++;
    }
    if (!has_fixed_step(twin)) {
        adapt(twin, growth, was_rejected);
    }
    give_up_if_stuck(twin, error);
    return (twin->phase != SERVOTWIN_STEP_TOO_SMALL) && (twin->phase != SERVOTWIN_BECAME_INFINITE);
}

static void take_loaded(servotwin_twin *twin)
{
    if (twin->has_loaded) {
        servotwin_twin_constants(twin->parameters, twin->constants);
        servotwin_twin_stand_ins(twin->parameters, twin->variables);
        twin->has_loaded = false;
    }
}

static void hold_input(servotwin_twin *twin, int32_t input, double value)
{
    twin->pieces[input][0] = value;
    twin->pieces[input][1] = 0.0;
    twin->pieces[input][2] = 0.0;
    twin->pieces[input][3] = 0.0;
}

/* Evaluates at the sample just reached, with the known values and slopes of the inputs. */
static void stand(servotwin_twin *twin)
{
    take_loaded(twin);
    if (twin->phase == SERVOTWIN_SETTLED) {
        twin->phase = SERVOTWIN_RUNNING;
        start_step(twin);
        twin->attempt_rate_per_s = 0.0;
    }
    twin->from_s = twin->target_s;
    for (int32_t input = 0; input < INPUTS; input++) {
        const bool is_cubic = servotwin_twin_between[input] == SERVOTWIN_CUBIC;
        hold_input(twin, input, twin->inputs[input].value);
        twin->pieces[input][1] = is_cubic ? twin->inputs[input].slope_per_s : 0.0;
    }
    begin(twin);
    twin->next_sample++;
    aim_at_sample(twin);
}

/* The course of an input up to its next value. */
static void lead_input(servotwin_twin *twin, int32_t input, const servotwin_knot *to, double length_s)
{
    double *piece = twin->pieces[input];
    const servotwin_knot *from = &twin->inputs[input];
    const double rise = to->value - from->value;
    hold_input(twin, input, from->value);
    if (servotwin_twin_between[input] == SERVOTWIN_LINE) {
        piece[1] = rise / length_s;
    } else if (servotwin_twin_between[input] == SERVOTWIN_CUBIC) {
        const double mean = rise / length_s;
        const double mean_tripled = 3.0 * mean;
        const double slope_doubled = 2.0 * from->slope_per_s;
        const double excess = mean_tripled - slope_doubled;
        const double bend = excess - to->slope_per_s;
        const double slopes = from->slope_per_s + to->slope_per_s;
        const double mean_doubled = 2.0 * mean;
        const double last = slopes - mean_doubled;
        const double square = length_s * length_s;
        piece[1] = from->slope_per_s;
        piece[2] = bend / length_s;
        piece[3] = last / square;
    } else {
        /* It holds its value. */
    }
}

/* The course of all inputs up to the next sample. The last evaluation stays valid unless a slope was unknown then. */
static void lead_to(servotwin_twin *twin, const servotwin_knot *next)
{
    const double length_s = twin->target_s - twin->from_s;
    bool is_surprised = false;
    for (int32_t input = 0; input < INPUTS; input++) {
        const double value = twin->pieces[input][0];
        const double slope = twin->pieces[input][1];
        lead_input(twin, input, &next[input], length_s);
        is_surprised =
            is_surprised || (value != twin->pieces[input][0]) || (slope != twin->pieces[input][1]);
    }
    if (is_surprised) {
        begin(twin);
    } else {
        move_inputs(twin);
    }
}

static void take_inputs(servotwin_twin *twin, const servotwin_knot *inputs)
{
    for (int32_t input = 0; input < INPUTS; input++) {
        twin->inputs[input] = inputs[input];
    }
}

static void write_first_guess(servotwin_twin *twin)
{
    for (int32_t state = 0; state < STATES; state++) {
        const servotwin_guess *guess = &servotwin_twin_guesses[state];
        twin->states[state] = (guess->parameter < 0) ? guess->value : twin->parameters[guess->parameter];
    }
}

/* Steps until the target is reached. */
static bool reach_target(servotwin_twin *twin)
{
    bool is_well = true;
    while (is_well && !is_at_target(twin)) {
        is_well = try_step(twin);
        if (is_well && !is_at_target(twin)) {
            begin(twin);
        }
    }
    return is_well;
}

bool servotwin_twin_start(servotwin_twin *twin, const double *parameters, const servotwin_knot *inputs)
{
    bool is_well = true;
    (void)memset(twin, 0, sizeof *twin);
    twin->phase = SERVOTWIN_SETTLING;
    start_step(twin);
    twin->step_s = FIRST_STEP_S;
    aim_at_sample(twin);
    take_inputs(twin, inputs);
    servotwin_twin_load(twin, parameters);
    take_loaded(twin);
    write_first_guess(twin);
    for (int32_t input = 0; input < INPUTS; input++) {
        hold_input(twin, input, inputs[input].value);
        twin->variables[FIRST_INPUT + input] = inputs[input].value;
    }
    while (is_well && seeks_rest(twin)) {
        begin(twin);
        if (seeks_rest(twin)) {
            is_well = try_step(twin);
        }
    }
    if (is_well) {
        stand(twin);
    }
    return is_well;
}

bool servotwin_twin_step(servotwin_twin *twin, const servotwin_knot *inputs)
{
    bool is_well = twin->phase == SERVOTWIN_RUNNING;
    if (is_well) {
        lead_to(twin, inputs);
        is_well = reach_target(twin);
    }
    if (is_well) {
        take_inputs(twin, inputs);
        stand(twin);
    }
    return is_well;
}

bool servotwin_twin_advance(servotwin_twin *twin, const double *values, double to_s)
{
    bool is_well = twin->phase == SERVOTWIN_RUNNING;
    if (is_well) {
        take_loaded(twin);
        twin->from_s = twin->time_s;
        twin->target_s = to_s;
        twin->after_s = HUGE_VAL;
        for (int32_t input = 0; input < INPUTS; input++) {
            hold_input(twin, input, values[input]);
        }
        begin(twin);
        is_well = reach_target(twin);
    }
    if (is_well) {
        begin(twin);
    }
    return is_well;
}

void servotwin_twin_refresh(servotwin_twin *twin, const double *values)
{
    take_loaded(twin);
    (void)memcpy(twin->variables, twin->states, sizeof twin->states);
    (void)memcpy(&twin->variables[FIRST_INPUT], values, (size_t)INPUTS * sizeof(double));
    servotwin_twin_evaluate(twin->constants, twin->variables);
}

double servotwin_twin_tick_clocks(servotwin_twin *twin, const double *values)
{
    double next_s = HUGE_VAL;
    for (int32_t input = 0; input < INPUTS; input++) {
        hold_input(twin, input, values[input]);
    }
    move_inputs(twin);
    tick_due_clocks(twin);
    for (int32_t clock = 0; clock < CLOCKS; clock++) {
        next_s = earlier(twin, next_s, tick_time_s(twin, clock));
    }
    return next_s;
}

void servotwin_twin_load(servotwin_twin *twin, const double *parameters)
{
    (void)memcpy(twin->parameters, parameters, sizeof twin->parameters);
    twin->has_loaded = true;
}

/* -------------------------------------------------------- Start test. */

static void mix_variable(uint64_t *mixture, double number)
{
    uint64_t bits = 0x7ff8000000000000U;
    if (number == number) {
        (void)memcpy(&bits, &number, sizeof bits);
    }
    *mixture = (*mixture ^ bits) * 0x100000001b3U;
}

bool servotwin_twin_is_exact(servotwin_twin *twin)
{
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    uint64_t mixture = 0xcbf29ce484222325U;
    (void)memcpy(inputs, servotwin_twin_defaults, sizeof inputs);
    bool is_well = servotwin_twin_start(twin, servotwin_twin_parameters, inputs);
    for (int32_t sample = 0; (sample < KNOWN_SAMPLES) && is_well; sample++) {
        for (int32_t input = 0; input < INPUTS; input++) {
            const double size = fabs(inputs[input].value) + 0.125;
            const double rise = size * 0x1p-7;
            inputs[input].value = inputs[input].value + rise;
            inputs[input].slope_per_s = rise / servotwin_twin_control.period_s;
            mix_variable(&mixture, inputs[input].value);
            mix_variable(&mixture, inputs[input].slope_per_s);
        }
        is_well = servotwin_twin_step(twin, inputs);
    }
    for (int32_t slot = 0; (slot < SERVOTWIN_TWIN_SUMS_END) && is_well; slot++) {
        mix_variable(&mixture, twin->variables[slot]);
    }
    (void)memset(twin, 0, sizeof *twin);
    return (mixture == servotwin_twin_known_answer) && servotwin_equations_keeps_rules() && servotwin_keeps_rules();
}
