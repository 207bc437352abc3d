/*
 * Reads samples from standard input and prints each change of the diagnosis. A line holds the inputs and the measured
 * values, separated by spaces; "nan" is a missing value.
 */
#include "servotwin_hybrid.h"
#include "servotwin_tables.h"

#include <stddef.h>
#include <stdio.h>

#define COLUMNS (SERVOTWIN_INPUTS + SERVOTWIN_SENSORS)

static servotwin_hybrid hybrid;

static const char *name_of(const char *const *names, int32_t place)
{
    return (place == SERVOTWIN_NONE) ? "-" : names[place];
}

static void print_outcome(const servotwin_outcome *outcome)
{
    static const char *const findings[] = {
        "not judged", "healthy", "detected, not isolated", "actuator", "action", "detail", "unknown", "input invalid"
    };
    static const char *const alarms[] = { "normal", "pending", "raised", "recovering", "no data", "error" };
    (void)printf("%.3f s: %s; actuator %s, action %s, detail %s; alarm %s; confidence %.4f\n",
        (double)outcome->sample * servotwin_tuning.period_s, findings[outcome->finding],
        name_of(servotwin_actuator_names, outcome->actuator), name_of(servotwin_action_names, outcome->action),
        name_of(servotwin_detail_names, outcome->detail), alarms[outcome->alarm], outcome->confidence);
}

/* Reads one line of numbers; returns how many there were. */
static int read_sample(double *values)
{
    int count = 0;
    while ((count < COLUMNS) && (scanf("%lf", &values[count]) == 1)) {
        count++;
    }
    return count;
}

int main(void)
{
    double values[COLUMNS];
    int count = 0;
    if (!servotwin_hybrid_start(&hybrid)) {
        (void)fprintf(stderr, "this build computes otherwise than in training: it must not fuse or reorder operations (gcc: -std=c99 "
            "-ffp-contract=off)\n");
        return 1;
    }
    for (count = read_sample(values); count == COLUMNS; count = read_sample(values)) {
        const servotwin_outcome *outcome = servotwin_hybrid_push(&hybrid, values, &values[SERVOTWIN_INPUTS]);
        if (outcome == NULL) {
            (void)printf("the twin cannot be simulated here and starts anew\n");
        } else if (outcome->since_sample == outcome->sample) {
            print_outcome(outcome);
        } else {
            /* Nothing has changed. */
        }
    }
    if (count != 0) {
        (void)fprintf(stderr, "the last line has %d of %d numbers\n", count, COLUMNS);
        return 1;
    }
    return 0;
}
