/* Entry points for `servotwin prove`. Not part of an export. */
#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <stddef.h>

static const servotwin_hierarchy *hierarchy_of(int32_t is_committee, int32_t length)
{
    return (is_committee != 0) ? servotwin_lengths[length].committee : servotwin_lengths[length].trees;
}

int32_t prove_leaf(int32_t is_committee, int32_t length, int32_t stage, int32_t tree, const double *row);
int32_t prove_leaf(int32_t is_committee, int32_t length, int32_t stage, int32_t tree, const double *row)
{
    return servotwin_leaf(&hierarchy_of(is_committee, length)->stages[stage].branches, tree, row);
}

servotwin_answer prove_decide(int32_t is_committee, int32_t length, int32_t stage, const double *row);
servotwin_answer prove_decide(int32_t is_committee, int32_t length, int32_t stage, const double *row)
{
    return servotwin_decide(&hierarchy_of(is_committee, length)->stages[stage], row);
}

void prove_shares(int32_t length, int32_t stage, const double *row, double *shares);
void prove_shares(int32_t length, int32_t stage, const double *row, double *shares)
{
    servotwin_shares(&servotwin_lengths[length].committee->stages[stage], row, shares);
}

servotwin_diagnosis prove_diagnose(int32_t is_committee, int32_t length, const double *const *views);
servotwin_diagnosis prove_diagnose(int32_t is_committee, int32_t length, const double *const *views)
{
    return servotwin_diagnose(hierarchy_of(is_committee, length), views);
}

void prove_probabilities(int32_t length, const double *const *views, double *into);
void prove_probabilities(int32_t length, const double *const *views, double *into)
{
    servotwin_probabilities(servotwin_lengths[length].committee, views, into);
}
