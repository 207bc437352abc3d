#include "servotwin_fmu.h"

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

void *servotwin_fmu_copied(const void *state, void *into)
{
    void *copy = (into != NULL) ? into : malloc(sizeof(servotwin_fmu));
    if (copy != NULL) {
        (void)memcpy(copy, state, sizeof(servotwin_fmu));
    }
    return copy;
}

bool servotwin_fmu_serialize(const void *state, void *bytes, size_t size)
{
    const bool fits = size >= sizeof(servotwin_fmu);
    if (fits) {
        (void)memcpy(bytes, state, sizeof(servotwin_fmu));
    }
    return fits;
}
