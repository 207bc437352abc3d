/* Entry points for the twin in `servotwin prove`. Not part of an export. */
#include "servotwin_twin.h"

uint64_t prove_twin_size(void);
uint64_t prove_twin_size(void)
{
    return (uint64_t)sizeof(servotwin_twin);
}

/* Parameters of the healthy system with these faults. */
void prove_twin_parameters(const double *intensities, double *parameters);
void prove_twin_parameters(const double *intensities, double *parameters)
{
    for (int32_t i = 0; i < SERVOTWIN_TWIN_PARAMETERS; i++) {
        parameters[i] = servotwin_twin_parameters[i];
    }
    servotwin_twin_faults(intensities, parameters);
}

/* Inputs are pairs of a value and a slope. */
static void read_inputs(const double *pairs, servotwin_knot *inputs)
{
    for (int32_t i = 0; i < SERVOTWIN_TWIN_INPUTS; i++) {
        inputs[i].value = pairs[2 * i];
        inputs[i].slope_per_s = pairs[(2 * i) + 1];
    }
}

int32_t prove_twin_start(servotwin_twin *twin, const double *parameters, const double *pairs);
int32_t prove_twin_start(servotwin_twin *twin, const double *parameters, const double *pairs)
{
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    read_inputs(pairs, inputs);
    return servotwin_twin_start(twin, parameters, inputs) ? 1 : 0;
}

int32_t prove_twin_step(servotwin_twin *twin, const double *pairs);
int32_t prove_twin_step(servotwin_twin *twin, const double *pairs)
{
    servotwin_knot inputs[SERVOTWIN_TWIN_INPUTS];
    read_inputs(pairs, inputs);
    return servotwin_twin_step(twin, inputs) ? 1 : 0;
}

void prove_twin_load(servotwin_twin *twin, const double *parameters);
void prove_twin_load(servotwin_twin *twin, const double *parameters)
{
    servotwin_twin_load(twin, parameters);
}

/* States, inputs, held values, sums and derivatives. */
const double *prove_twin_variables(const servotwin_twin *twin);
const double *prove_twin_variables(const servotwin_twin *twin)
{
    return twin->variables;
}
