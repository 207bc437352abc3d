/*
 * Runs an exported diagnosis over a file of samples, and the twin over inputs of its own, and prints a hash of everything
 * they say, once per five hundred samples. The same source runs on the host and on a simulated Cortex-M; equal output means
 * equal bits.
 */
#include "servotwin_session.h"
#include "servotwin_tables.h"
#include "servotwin_twin.h"

#include <string.h>

#define COLUMNS (SERVOTWIN_INPUTS + (2 * SERVOTWIN_SENSORS))

/* What differs between host and core: a file to read, text to write, and a counter of instructions. */
void platform_open(void);
int platform_read(void *into, uint32_t bytes);
void platform_print(const char *text);
uint32_t platform_ticks(void);
uint32_t platform_ticks_between(uint32_t from, uint32_t to);
uint32_t platform_instructions_per_tick(void);

static servotwin_session session;
static uint64_t hash = 0xcbf29ce484222325U;

static void mix(const void *bytes, uint32_t count)
{
    const unsigned char *byte = bytes;
    for (uint32_t i = 0; i < count; i++) {
        hash = (hash ^ byte[i]) * 0x100000001b3U;
    }
}

static void mix_number(servotwin_real number)
{
    mix(&number, sizeof number);
}

static void mix_integer(int64_t number)
{
    mix(&number, sizeof number);
}

static void mix_outcome(const servotwin_outcome *outcome)
{
    mix_integer((int64_t)outcome->finding);
    mix_integer((int64_t)outcome->alarm);
    mix_integer(outcome->actuator);
    mix_integer(outcome->action);
    mix_integer(outcome->detail);
    mix_integer(outcome->input);
    mix_integer((int64_t)outcome->since_sample);
    mix_number(outcome->confidence);
    mix_number(outcome->worst);
    for (int32_t length = 0; length < SERVOTWIN_LENGTHS; length++) {
        mix_number(servotwin_evidence_of_change(&session.evidence[length], length));
        for (int32_t claim = 0; claim < SERVOTWIN_HYPOTHESES; claim++) {
            mix_number(session.judgements[length].probabilities[claim]);
            mix_number(servotwin_margin(&session.evidence[length], length, claim));
        }
    }
}

static char *written(char *at, uint64_t number, uint32_t base)
{
    char digits[24];
    int32_t count = 0;
    do {
        digits[count] = "0123456789abcdef"[number % base];
        number /= base;
        count++;
    } while (number > 0U);
    while (count > 0) {
        count--;
        *at = digits[count];
        at++;
    }
    return at;
}

static void print_line(const char *what, uint64_t first, uint64_t second, uint32_t base)
{
    char line[128];
    char *at = line;
    (void)strcpy(at, what);
    at = written(&line[strlen(what)], first, 10U);
    *at = ' ';
    at = written(&at[1], second, base);
    at[0] = '\n';
    at[1] = '\0';
    platform_print(line);
}

/* Ticks of one part of the work. */
typedef struct {
    uint64_t all;
    uint32_t most;
} counter;

static void count_since(uint32_t before, counter *of)
{
    const uint32_t spent = platform_ticks_between(before, platform_ticks());
    of->all += spent;
    of->most = (spent > of->most) ? spent : of->most;
}

static void print_counter(const char *what, const counter *of, uint64_t samples)
{
    const uint64_t each = platform_instructions_per_tick();
    if (each > 0U) {
        print_line(what, (of->all * each) / samples, (uint64_t)of->most * each, 10U);
    }
}

static servotwin_twin twin;

/* The twin's inputs: those with slopes (the command) go up and down by 0.05 within 4 s, the others keep their defaults. */
static void write_inputs(uint64_t sample, servotwin_knot *inputs)
{
    const double phase = (double)(sample % 400U) * 0.01;
    const double value = (phase < 2.0) ? ((phase - 1.0) * 0.05) : ((3.0 - phase) * 0.05);
    const double slope = (phase < 2.0) ? 0.05 : -0.05;
    for (int32_t i = 0; i < SERVOTWIN_TWIN_INPUTS; i++) {
        inputs[i] = servotwin_twin_defaults[i];
        if (servotwin_twin_between[i] == SERVOTWIN_CUBIC) {
            inputs[i].value = value;
            inputs[i].slope_per_s = slope;
        }
    }
}

/* The first sample searches for the steady state, which is not counted. */
static bool run_twin(uint64_t sample, counter *of)
{
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    bool is_well = true;
    write_inputs(sample, inputs);
    if (sample == 0U) {
        is_well = servotwin_twin_start(&twin, servotwin_twin_parameters, inputs);
    } else {
        const uint32_t before = platform_ticks();
        is_well = servotwin_twin_step(&twin, inputs);
        count_since(before, of);
    }
    mix(twin.variables, sizeof twin.variables);
    return is_well;
}

int main(void)
{
    static double values[COLUMNS];
    static servotwin_real own[COLUMNS];
    uint64_t samples = 0U;
    counter of_diagnosis = { 0U, 0U };
    counter of_twin = { 0U, 0U };
    uint64_t raised = 0U;
    bool was_raised = false;
    platform_open();
    if (!servotwin_session_start(&session)) {
        platform_print("this build computes otherwise than in training\n");
        return 1;
    }
    while (platform_read(values, sizeof values) != 0) {
        for (int32_t i = 0; i < COLUMNS; i++) {
            own[i] = (servotwin_real)values[i];
        }
        const uint32_t before = platform_ticks();
        const servotwin_outcome *outcome = servotwin_session_push(
            &session, own, &own[SERVOTWIN_INPUTS], &own[SERVOTWIN_INPUTS + SERVOTWIN_SENSORS]);
        count_since(before, &of_diagnosis);
        if (!run_twin(samples, &of_twin)) {
            platform_print("the twin cannot be simulated\n");
            return 1;
        }
        samples++;
        mix_outcome(outcome);
        if (outcome->raised.is_raised && !was_raised) {
            raised++;
        }
        was_raised = outcome->raised.is_raised;
        if ((samples % 500U) == 0U) {
            if (outcome->raised.is_raised) {
                servotwin_session_release(&session, outcome->raised.actuator);
                was_raised = false;
            }
            print_line("hash ", samples, hash, 16U);
        }
    }
    print_line("raised ", samples, raised, 10U);
    print_counter("instructions of the diagnosis, mean and most: ", &of_diagnosis, samples);
    print_counter("instructions of the twin, mean and most: ", &of_twin, samples);
    return 0;
}
