/* Records the evaluations of decisions for `servotwin prove --vectors`. Not part of an export. */
#include "mcdc.h"

#include "mcdc_sizes.h"

/* Different evaluations of a decision; more end the search. */
#define MOST_VECTORS 64

typedef struct {
    uint32_t evaluated;
    uint32_t values;
    uint32_t result;
    uint64_t count;
} mcdc_vector;

static bool is_recording;
static bool has_overflowed;
static uint32_t evaluated[MCDC_DECISIONS];
static uint32_t values[MCDC_DECISIONS];
static mcdc_vector vectors[MCDC_DECISIONS][MOST_VECTORS];
static int32_t counts[MCDC_DECISIONS];

/* Decision and place of each evaluation that is new since the last call of mcdc_take_new. */
static uint32_t news[MCDC_DECISIONS * MOST_VECTORS][2];
static int32_t new_count;

static void note(int32_t decision, uint32_t bits, uint32_t of_values, uint32_t result)
{
    mcdc_vector *known = vectors[decision];
    int32_t place = 0;
    while ((place < counts[decision]) && ((known[place].evaluated != bits) || (known[place].values != of_values))) {
        place++;
    }
    if (place == MOST_VECTORS) {
        has_overflowed = true;
        return;
    }
    if (place == counts[decision]) {
        counts[decision]++;
        known[place].evaluated = bits;
        known[place].values = of_values;
        known[place].result = result;
        known[place].count = 0U;
        news[new_count][0] = (uint32_t)decision;
        news[new_count][1] = (uint32_t)place;
        new_count++;
    }
    known[place].count++;
}

void mcdc_begin(int32_t decision)
{
    evaluated[decision] = 0U;
    values[decision] = 0U;
}

bool mcdc_condition(int32_t decision, int32_t condition, bool value)
{
    const uint32_t bit = (uint32_t)1 << (uint32_t)condition;
    evaluated[decision] |= bit;
    if (value) {
        values[decision] |= bit;
    }
    return value;
}

bool mcdc_end(int32_t decision, bool value)
{
    if (is_recording) {
        note(decision, evaluated[decision], values[decision], value ? 1U : 0U);
    }
    return value;
}

int64_t mcdc_switch(int32_t decision, const int64_t *cases, int32_t count, int64_t value)
{
    int32_t place = 0;
    while ((place < count) && (cases[place] != value)) {
        place++;
    }
    if (is_recording) {
        const uint32_t bit = (uint32_t)1 << (uint32_t)place;
        note(decision, bit, bit, 1U);
    }
    return value;
}

void mcdc_record(bool is_on)
{
    is_recording = is_on;
}

void mcdc_forget(void);
void mcdc_forget(void)
{
    for (int32_t decision = 0; decision < MCDC_DECISIONS; decision++) {
        counts[decision] = 0;
    }
    new_count = 0;
    has_overflowed = false;
}

/* Writes decision, evaluated, values and result of each new evaluation; returns how many, or -1 if there were too many. */
int32_t mcdc_take_new(uint32_t *into);
int32_t mcdc_take_new(uint32_t *into)
{
    const int32_t count = has_overflowed ? -1 : new_count;
    for (int32_t i = 0; i < count; i++) {
        const mcdc_vector *vector = &vectors[news[i][0]][news[i][1]];
        into[4 * i] = news[i][0];
        into[(4 * i) + 1] = vector->evaluated;
        into[(4 * i) + 2] = vector->values;
        into[(4 * i) + 3] = vector->result;
    }
    new_count = 0;
    return count;
}

/* How often the evaluation at a place of a decision occurred. */
uint64_t mcdc_count(int32_t decision, int32_t place);
uint64_t mcdc_count(int32_t decision, int32_t place)
{
    return vectors[decision][place].count;
}
