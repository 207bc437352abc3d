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

int32_t prove_twin_is_exact(servotwin_twin *twin);
int32_t prove_twin_is_exact(servotwin_twin *twin)
{
    return servotwin_twin_is_exact(twin) ? 1 : 0;
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

/*
 * One evaluation at any point: 0 all equations, 1 the same with gradients, 2 derivatives only, 3 and on a tick of clock 0 and
 * on after all equations. `given` holds states, inputs and held values, `slopes` those of the inputs.
 */
void prove_twin_point(
    servotwin_twin *twin, int32_t which, const double *parameters, const double *given, const double *slopes);
void prove_twin_point(
    servotwin_twin *twin, int32_t which, const double *parameters, const double *given, const double *slopes)
{
    for (int32_t i = 0; i < SERVOTWIN_TWIN_VARIABLES; i++) {
        twin->variables[i] = (i < (SERVOTWIN_TWIN_STATES + SERVOTWIN_TWIN_HELD)) ? given[i] : 0.0;
    }
    servotwin_twin_constants(parameters, twin->constants);
    servotwin_twin_stand_ins(parameters, twin->variables);
    for (int32_t i = 0; i < SERVOTWIN_TWIN_INPUTS; i++) {
        twin->gradients[servotwin_twin_slopes[i]] = slopes[i];
    }
    if (which == 1) {
        servotwin_twin_begin(twin->constants, twin->variables, twin->gradients);
    } else if (which == 2) {
        servotwin_twin_motion(twin->constants, twin->variables);
    } else {
        servotwin_twin_evaluate(twin->constants, twin->variables);
        servotwin_twin_tick(which - 3, twin->constants, twin->variables);
    }
}

const double *prove_twin_gradients(const servotwin_twin *twin);
const double *prove_twin_gradients(const servotwin_twin *twin)
{
    return twin->gradients;
}
