#include "servotwin_fmu.h"

#include "servotwin_token.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool servotwin_fmu_get(servotwin_fmu *fmu, const uint32_t *references, size_t count, double *values)
{
    bool is_well = true;
    for (size_t i = 0U; is_well && (i < count); i++) {
        is_well = servotwin_fmu_value(fmu, references[i], &values[i]);
    }
    return is_well;
}

bool servotwin_fmu_set(servotwin_fmu *fmu, const uint32_t *references, size_t count, const double *values)
{
    bool is_well = true;
    for (size_t i = 0U; is_well && (i < count); i++) {
        is_well = servotwin_fmu_change(fmu, references[i], values[i]);
    }
    return is_well;
}

bool servotwin_fmu_is_within(double value, servotwin_fmu_range range)
{
    return (value >= range.least) && (value <= range.largest);
}

const char *servotwin_fmu_step(servotwin_fmu *fmu, double time_s, double step_s)
{
    const char *refusal = NULL;
    /* A host adds up its steps, so its time differs by roundings. */
    const double reached_s = servotwin_fmu_time_s(fmu);
    const double differs_s = fabs(time_s - reached_s);
    const double rounding_s = 1e-8 + (1e-9 * fabs(reached_s));
    const bool is_next = differs_s <= rounding_s;
    if (!fmu->is_started) {
        refusal = SERVOTWIN_FMU_NOT_STARTED;
    } else if (!is_next || !(step_s >= 0.0) || (step_s > SERVOTWIN_FMU_LONGEST_STEP_S)) {
        refusal = SERVOTWIN_FMU_OTHER_TIME;
    } else if (!servotwin_fmu_advance(fmu, time_s, step_s)) {
        refusal = SERVOTWIN_FMU_NO_STEP;
    } else {
        /* The step is done. */
    }
    return refusal;
}

bool servotwin_fmu_start_at(servotwin_fmu *fmu, double time_s)
{
    const bool is_time = isfinite(time_s) != 0;
    fmu->start_s = is_time ? time_s : fmu->start_s;
    return is_time;
}

void *servotwin_fmu_copied(const void *state, void *into)
{
    void *copy = (into != NULL) ? into : malloc(sizeof(servotwin_fmu));
    if ((copy != NULL) && (state != NULL)) {
        (void)memcpy(copy, state, sizeof(servotwin_fmu));
    }
    return copy;
}

/* FNV-1a of this FMU's token and a state: no change of a single byte keeps it. */
static uint64_t checksum(const void *state)
{
    const unsigned char *bytes = state;
    uint64_t sum = 0xcbf29ce484222325U;
    for (size_t i = 0U; i < (sizeof SERVOTWIN_TOKEN - 1U); i++) {
        sum = (sum ^ (unsigned char)SERVOTWIN_TOKEN[i]) * 0x100000001b3U;
    }
    for (size_t i = 0U; i < sizeof(servotwin_fmu); i++) {
        sum = (sum ^ bytes[i]) * 0x100000001b3U;
    }
    return sum;
}

bool servotwin_fmu_serialize(const void *state, void *bytes, size_t size)
{
    const bool fits = (state != NULL) && (size >= SERVOTWIN_FMU_BYTES);
    if (fits) {
        const uint64_t sum = checksum(state);
        (void)memcpy(bytes, &sum, sizeof sum);
        (void)memcpy((unsigned char *)bytes + sizeof sum, state, sizeof(servotwin_fmu));
    }
    return fits;
}

const void *servotwin_fmu_state_in(const void *bytes, size_t size)
{
    const void *state = NULL;
    if ((bytes != NULL) && (size == SERVOTWIN_FMU_BYTES)) {
        uint64_t sum = 0U;
        (void)memcpy(&sum, bytes, sizeof sum);
        state = (const unsigned char *)bytes + sizeof sum;
        state = (checksum(state) == sum) ? state : NULL;
    }
    return state;
}
