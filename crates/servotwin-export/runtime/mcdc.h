/* Records the evaluations of decisions for `servotwin prove --vectors`. Not part of an export. */
#ifndef MCDC_H
#define MCDC_H

#include <stdbool.h>
#include <stdint.h>

void mcdc_begin(int32_t decision);
bool mcdc_condition(int32_t decision, int32_t condition, bool value);
bool mcdc_end(int32_t decision, bool value);

/* Records which of the cases of a switch is taken, and returns the value. */
int64_t mcdc_switch(int32_t decision, const int64_t *cases, int32_t count, int64_t value);

/* Begins or ends recording; nothing is recorded before. */
void mcdc_record(bool is_on);

#endif
