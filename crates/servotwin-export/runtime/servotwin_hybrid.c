#include "servotwin_hybrid.h"

#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <float.h>
#include <math.h>
#include <stddef.h>
#include <string.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* The slope of a signal from its last two differences, such that it does not swing over. */
static double slope_of(double now, double before)
{
    const double size = fabs(now);
    const double size_before = fabs(before);
    const double most = 3.0 * ((size < size_before) ? size : size_before);
    const double of_now = 1.5 * now;
    const double of_before = 0.5 * before;
    const double slope = of_now - of_before;
    const double at_least = (slope < -most) ? -most : slope;
    return (at_least > most) ? most : at_least;
}

/* Takes an input from its bus. The twin keeps the previous value of one that is not plausible; a missing command goes on
 * with its slope. */
static void accept_input(servotwin_hybrid *hybrid, int32_t input, double told)
{
    const servotwin_input *known = &servotwin_inputs[input];
    const bool goes_on = isnan(told) && (servotwin_twin_between[input] == SERVOTWIN_CUBIC);
    const double step = hybrid->accepted[input].slope_per_s * servotwin_tuning.period_s;
    const double next = goes_on ? (hybrid->accepted[input].value + step) : told;
    const bool fits = (next >= known->least) && (next <= known->largest) && (fabs(next) <= DBL_MAX);
    const double value = fits ? next : hybrid->accepted[input].value;
    const double last = hybrid->has_last[input] ? hybrid->last[input] : value;
    const double before = hybrid->difference_per_s[input];
    const double rise = value - last;
    const double difference = rise / servotwin_tuning.period_s;
    hybrid->difference_per_s[input] = difference;
    hybrid->has_last[input] = true;
    hybrid->last[input] = value;
    hybrid->accepted[input].value = value;
    hybrid->accepted[input].slope_per_s = slope_of(difference, before);
}

/* ---- Reactions. Parameters of the twin and ignored sensors follow from those that stand. ---- */

/* Whether a standing reaction of any actuator ignores a sensor. */
static bool is_ignored(const servotwin_hybrid *hybrid, int32_t sensor)
{
    bool ignored = false;
    for (int32_t i = 0; i < hybrid->standing; i++) {
        const servotwin_reaction *known = &servotwin_twin_reactions[hybrid->reactions[i]];
        for (int32_t c = known->first_change; c < known->end_of_changes; c++) {
            const servotwin_change *change = &servotwin_twin_changes[c];
            ignored = ignored || ((change->kind == SERVOTWIN_TAKES_OUT) && (change->place == sensor));
        }
    }
    return ignored;
}

/* Puts a reaction's sensors out, or back in unless another reaction ignores them. */
static void update_sensors(servotwin_hybrid *hybrid, const servotwin_reaction *reaction)
{
    for (int32_t c = reaction->first_change; c < reaction->end_of_changes; c++) {
        const servotwin_change *change = &servotwin_twin_changes[c];
        if (change->kind == SERVOTWIN_TAKES_OUT) {
            (void)servotwin_session_take_out(&hybrid->session, change->place, is_ignored(hybrid, change->place));
        }
    }
}

/* Gives the twin its own parameters, and then those of the reactions that stand. */
static void load_parameters(servotwin_hybrid *hybrid)
{
    (void)memcpy(hybrid->parameters_in_force, hybrid->parameters, sizeof hybrid->parameters_in_force);
    for (int32_t i = 0; i < hybrid->standing; i++) {
        const servotwin_reaction *known = &servotwin_twin_reactions[hybrid->reactions[i]];
        for (int32_t c = known->first_change; c < known->end_of_changes; c++) {
            const servotwin_change *change = &servotwin_twin_changes[c];
            if (change->kind == SERVOTWIN_SETS_PARAMETER) {
                hybrid->parameters_in_force[change->place] = change->value;
            }
        }
    }
    servotwin_twin_load(&hybrid->twin, hybrid->parameters_in_force);
}

/* Adds a reaction in the order of actuators, unless it stands. */
static void add_reaction(servotwin_hybrid *hybrid, int32_t reaction)
{
    const int32_t actuator = servotwin_twin_reactions[reaction].actuator;
    int32_t at = hybrid->standing;
    bool stands = false;
    for (int32_t i = 0; i < hybrid->standing; i++) {
        stands = stands || (hybrid->reactions[i] == reaction);
    }
    if (!stands) {
        while ((at > 0) && (servotwin_twin_reactions[hybrid->reactions[at - 1]].actuator > actuator)) {
            hybrid->reactions[at] = hybrid->reactions[at - 1];
            at--;
        }
        hybrid->reactions[at] = reaction;
        hybrid->standing++;
    }
}

static void carry_out(servotwin_hybrid *hybrid, int32_t reaction)
{
    const servotwin_reaction *known = &servotwin_twin_reactions[reaction];
    if (known->switches_off) {
        (void)servotwin_session_switched_off(&hybrid->session, known->actuator);
    }
    add_reaction(hybrid, reaction);
    update_sensors(hybrid, known);
    load_parameters(hybrid);
}

int32_t servotwin_reaction_to(int32_t actuator, int32_t action, int32_t detail)
{
    int32_t found = SERVOTWIN_NONE;
    for (int32_t reaction = 0; reaction < SERVOTWIN_TWIN_REACTIONS; reaction++) {
        const servotwin_reaction *known = &servotwin_twin_reactions[reaction];
        const bool is_special = (known->detail == detail) && (detail != SERVOTWIN_NONE);
        const bool is_general = (known->detail == SERVOTWIN_NONE) && (found == SERVOTWIN_NONE);
        if ((known->actuator == actuator) && (known->action == action) && (is_special || is_general)) {
            found = reaction;
        }
    }
    return found;
}

bool servotwin_hybrid_follow(servotwin_hybrid *hybrid, int32_t reaction)
{
    const bool is_known = (reaction >= 0) && (reaction < SERVOTWIN_TWIN_REACTIONS);
    if (is_known) {
        carry_out(hybrid, reaction);
    }
    return is_known;
}

bool servotwin_hybrid_release(servotwin_hybrid *hybrid, int32_t actuator)
{
    const bool is_known = servotwin_session_switched_on(&hybrid->session, actuator);
    const int32_t stood = hybrid->standing;
    int32_t before[SERVOTWIN_TWIN_MOST_REACTIONS];
    (void)memcpy(before, hybrid->reactions, sizeof before);
    hybrid->standing = 0;
    for (int32_t i = 0; i < stood; i++) {
        if (servotwin_twin_reactions[before[i]].actuator != actuator) {
            hybrid->reactions[hybrid->standing] = before[i];
            hybrid->standing++;
        }
    }
    for (int32_t i = 0; i < stood; i++) {
        const servotwin_reaction *known = &servotwin_twin_reactions[before[i]];
        if (known->actuator == actuator) {
            update_sensors(hybrid, known);
        }
    }
    load_parameters(hybrid);
    return is_known;
}

/* Whether the inputs are those of a reaction. */
static bool is_seen(const servotwin_hybrid *hybrid, const servotwin_reaction *reaction)
{
    bool holds = reaction->is_seen;
    for (int32_t c = reaction->first_change; c < reaction->end_of_changes; c++) {
        const servotwin_change *change = &servotwin_twin_changes[c];
        if (change->kind == SERVOTWIN_SETS_INPUT) {
            holds = holds && (hybrid->accepted[change->place].value == change->value);
        }
    }
    return holds;
}

/* Follows what the inputs show: that an actuator has been switched off, or on again. */
static void follow_inputs(servotwin_hybrid *hybrid)
{
    for (int32_t reaction = 0; reaction < SERVOTWIN_TWIN_REACTIONS; reaction++) {
        const servotwin_reaction *known = &servotwin_twin_reactions[reaction];
        if (known->is_seen && (is_seen(hybrid, known) != hybrid->is_seen_off[known->actuator])) {
            hybrid->is_seen_off[known->actuator] = !hybrid->is_seen_off[known->actuator];
            if (hybrid->is_seen_off[known->actuator]) {
                carry_out(hybrid, reaction);
            } else {
                (void)servotwin_hybrid_release(hybrid, known->actuator);
            }
        }
    }
}

/* ---- Samples. ---- */

static void clear(servotwin_hybrid *hybrid)
{
    (void)memset(hybrid, 0, sizeof *hybrid);
    (void)memcpy(hybrid->parameters, servotwin_twin_parameters, sizeof hybrid->parameters);
    (void)memcpy(hybrid->parameters_in_force, servotwin_twin_parameters, sizeof hybrid->parameters_in_force);
    (void)memcpy(hybrid->accepted, servotwin_twin_defaults, sizeof hybrid->accepted);
}

bool servotwin_hybrid_start(servotwin_hybrid *hybrid)
{
    clear(hybrid);
    const bool is_exact = servotwin_twin_is_exact(&hybrid->twin);
    const bool knows_answer = servotwin_session_start(&hybrid->session);
    return knows_answer && is_exact && servotwin_keeps_rules();
}

/* A value, or NaN for one that is not possible. */
static double possible(double value, int32_t place)
{
    const servotwin_range *range = &servotwin_twin_possible[place];
    return ((value < range->low) || (value > range->high)) ? (double)NAN : value;
}

const servotwin_outcome *servotwin_hybrid_push(
    servotwin_hybrid *hybrid, const double *inputs, const double *measured)
{
    double told[SERVOTWIN_TWIN_INPUTS];
    double seen[SERVOTWIN_SENSORS];
    const servotwin_outcome *outcome = NULL;
    for (int32_t input = 0; input < SERVOTWIN_TWIN_INPUTS; input++) {
        told[input] = possible(inputs[input], input);
        accept_input(hybrid, input, told[input]);
    }
    for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
        seen[sensor] = possible(measured[sensor], SERVOTWIN_TWIN_INPUTS + sensor);
    }
    follow_inputs(hybrid);
    if (hybrid->is_settled) {
        hybrid->is_settled = servotwin_twin_step(&hybrid->twin, hybrid->accepted);
    } else {
        hybrid->is_settled = servotwin_twin_start(&hybrid->twin, hybrid->parameters_in_force, hybrid->accepted);
    }
    if (hybrid->is_settled) {
        for (int32_t sensor = 0; sensor < SERVOTWIN_SENSORS; sensor++) {
            hybrid->expected[sensor] = hybrid->twin.variables[servotwin_twin_sensors[sensor]];
        }
        outcome = servotwin_session_push(&hybrid->session, told, seen, hybrid->expected);
    } else {
        (void)servotwin_session_push_without_twin(&hybrid->session);
    }
    return outcome;
}

bool servotwin_hybrid_set_parameter(servotwin_hybrid *hybrid, int32_t parameter, double value)
{
    const bool is_set = (parameter >= 0) && (parameter < SERVOTWIN_TWIN_PARAMETERS) && (fabs(value) <= DBL_MAX);
    if (is_set) {
        hybrid->parameters[parameter] = value;
        load_parameters(hybrid);
    }
    return is_set;
}
