/*
 * Replays mcdc.csv, which 'servotwin prove --vectors' writes, on an export: replay < mcdc.csv
 * Every outcome must have the bits of the file.
 */
#include "servotwin_hybrid.h"
#include "servotwin_tables.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define INTEGERS 18
#define NUMBERS 3
#define VALUES (SERVOTWIN_INPUTS + (2 * SERVOTWIN_SENSORS))
#define COLUMNS (4 + VALUES + INTEGERS + NUMBERS)

static char line[1 << 16];
static char *fields[COLUMNS];
static servotwin_session session;
static servotwin_hybrid hybrid;

static int split(void)
{
    int count = 0;
    char *at = line;
    line[strcspn(line, "\r\n")] = '\0';
    while ((at != NULL) && (count < COLUMNS)) {
        char *comma = strchr(at, ',');
        fields[count++] = at;
        if (comma != NULL) {
            *comma = '\0';
        }
        at = (comma != NULL) ? (comma + 1) : NULL;
    }
    return (at == NULL) ? count : (COLUMNS + 1);
}

static int obey(const char *command, int32_t place)
{
    if (strcmp(command, "switched_off") == 0) {
        servotwin_session_switched_off(&session, place);
    } else if (strcmp(command, "release") == 0) {
        servotwin_session_release(&session, place);
    } else if (strcmp(command, "inhibit") == 0) {
        servotwin_session_inhibit(&session, place, true);
    } else if (strcmp(command, "resume") == 0) {
        servotwin_session_inhibit(&session, place, false);
    } else if (strcmp(command, "take_out") == 0) {
        servotwin_session_take_out(&session, place, true);
    } else if (strcmp(command, "put_back") == 0) {
        servotwin_session_take_out(&session, place, false);
    } else if (command[0] != '\0') {
        return 0;
    }
    return 1;
}

static int is_same_number(double a, const char *text)
{
    const double b = strtod(text, NULL);
    return memcmp(&a, &b, sizeof a) == 0;
}

static int is_same(const servotwin_outcome *outcome)
{
    char **expected = &fields[4 + VALUES];
    const servotwin_raised *raised = &outcome->raised;
    const int is_raised = raised->is_raised ? 1 : 0;
    const long long integers[INTEGERS] = { (long long)outcome->sample, (long long)outcome->since_sample,
        outcome->finding, outcome->actuator, outcome->action, outcome->detail, outcome->input, outcome->why,
        outcome->alarm, is_raised, is_raised ? raised->actuator : 0, is_raised ? raised->action : 0,
        is_raised ? raised->detail : 0, is_raised ? (long long)raised->sample : 0, is_raised ? raised->length : 0,
        outcome->length, outcome->worst_sensor, outcome->lost };
    const double numbers[NUMBERS] = { outcome->confidence, outcome->worst, is_raised ? raised->confidence : 0.0 };
    int same = 1;
    for (int i = 0; i < INTEGERS; i++) {
        same = same && (strtoll(expected[i], NULL, 10) == integers[i]);
    }
    for (int i = 0; i < NUMBERS; i++) {
        same = same && is_same_number(numbers[i], expected[INTEGERS + i]);
    }
    return same;
}

int main(void)
{
    double values[VALUES + 1];
    long samples = 0;
    long different = 0;
    char sequence[32] = "";
    if (fgets(line, sizeof line, stdin) == NULL) {
        return 2;
    }
    while (fgets(line, sizeof line, stdin) != NULL) {
        const servotwin_outcome *outcome = NULL;
        int same = 1;
        if (split() != COLUMNS) {
            (void)fprintf(stderr, "sample %ld has another number of columns\n", samples + 1);
            return 2;
        }
        const int is_hybrid = (strcmp(fields[1], "hybrid") == 0);
        if (strcmp(sequence, fields[0]) != 0) {
            (void)snprintf(sequence, sizeof sequence, "%s", fields[0]);
            if (!(is_hybrid ? servotwin_hybrid_start(&hybrid) : servotwin_session_start(&session))) {
                (void)fprintf(stderr, "this build rounds differently\n");
                return 2;
            }
        }
        for (int i = 0; i < VALUES; i++) {
            values[i] = strtod(fields[4 + i], NULL);
        }
        if (!obey(fields[2], (int32_t)strtol(fields[3], NULL, 10))) {
            (void)fprintf(stderr, "unknown command %s\n", fields[2]);
            return 2;
        }
        const double *measured = &values[SERVOTWIN_INPUTS];
        const double *twin = &measured[SERVOTWIN_SENSORS];
        if (is_hybrid) {
            outcome = servotwin_hybrid_push(&hybrid, values, measured);
            same = (outcome == NULL) || (memcmp(hybrid.expected, twin, sizeof hybrid.expected) == 0);
        } else {
            outcome = servotwin_session_push(&session, values, measured, twin);
        }
        same = same && ((outcome == NULL) ? (fields[4 + VALUES][0] == '\0') : is_same(outcome));
        samples++;
        if (!same) {
            different++;
            if (different <= 5) {
                (void)printf("sample %ld (sequence %s): another outcome\n", samples, sequence);
            }
        }
    }
    (void)printf("%ld samples, %ld with another outcome\n", samples, different);
    return (different == 0) ? 0 : 1;
}
