/* The common core of the interfaces of FMI 2.0 and 3.0: one instance of the system with its faults. */
#ifndef SERVOTWIN_FMU_H
#define SERVOTWIN_FMU_H

#include "servotwin_twin.h"

#include <stddef.h>

/* Declares and begins a function of the interface. */
#define FUNCTION(type, name, ...) \
    __attribute__((visibility("default"))) type name(__VA_ARGS__); \
    type name(__VA_ARGS__)

/* Messages for the host's log. */
#define SERVOTWIN_FMU_NO_BEGINNING "there is no steady state or motion to begin with for these inputs and parameters"
#define SERVOTWIN_FMU_NO_STEP "the step cannot be simulated: a value became infinite, or the error stayed too large"
#define SERVOTWIN_FMU_UNKNOWN "there is no variable with this reference that has a value"
#define SERVOTWIN_FMU_NOT_SET "this variable cannot be set, or the value is out of its range"
#define SERVOTWIN_FMU_OTHER_LENGTH "the number of values differs"
#define SERVOTWIN_FMU_NO_MEMORY "there is no memory for the state"
#define SERVOTWIN_FMU_TOO_SHORT "the list of bytes is too short for a state"
#define SERVOTWIN_FMU_NO_STATE "the bytes are no state of this FMU"
#define SERVOTWIN_FMU_NO_DERIVATIVE \
    "derivatives are known for states' derivatives and outputs with respect to states and inputs"

/*
 * References of variables: places in the array of variables, then parameters without a fault, then intensities of faults,
 * then the time.
 */
#define SERVOTWIN_FMU_PARAMETER 100000U
#define SERVOTWIN_FMU_FAULT 200000U
#define SERVOTWIN_FMU_TIME 300000U

/* No member is a pointer, so a copy is a complete state. */
typedef struct {
    servotwin_twin twin;
    double parameters[SERVOTWIN_TWIN_PARAMETERS];
    double intensities[SERVOTWIN_TWIN_FAULTS];
    double inputs[SERVOTWIN_TWIN_INPUTS];
    double start_s; /* the host's time at the beginning */
    bool is_settled; /* the steady state for the inputs and parameters has been found */
    bool is_started; /* the host has left the initialization */
    bool is_stale; /* the variables are older than states or inputs */
    bool has_new_parameters;
} servotwin_fmu;

/* The directional derivatives of all variables for those of states and inputs; see servotwin_tangent.c. */
void servotwin_twin_tangent(const double *constants, const double *variables, const double *seeds, double *tangents);

/* As after instantiation. */
void servotwin_fmu_reset(servotwin_fmu *fmu);

/* Ends the initialization at the steady state. Returns false if there is no beginning for these inputs and parameters. */
bool servotwin_fmu_begin(servotwin_fmu *fmu);

/* The time of the host. */
double servotwin_fmu_time_s(const servotwin_fmu *fmu);

/* The values of variables; false if there is none with a reference, or none can be computed. */
bool servotwin_fmu_get(servotwin_fmu *fmu, const uint32_t *references, size_t count, double *values);

/* Sets inputs, parameters and intensities; false for any other variable and for values out of range. */
bool servotwin_fmu_set(servotwin_fmu *fmu, const uint32_t *references, size_t count, const double *values);

/* Simulates a step from a time of the host. */
bool servotwin_fmu_advance(servotwin_fmu *fmu, double time_s, double step_s);

/* For hosts that integrate the states. Lists of another length than that of the states are refused. */
void servotwin_fmu_set_time(servotwin_fmu *fmu, double time_s);
bool servotwin_fmu_set_states(servotwin_fmu *fmu, const double *states, size_t count);
bool servotwin_fmu_states(servotwin_fmu *fmu, double *states, size_t count);
bool servotwin_fmu_derivatives(servotwin_fmu *fmu, double *derivatives, size_t count);
void servotwin_fmu_nominals(double *nominals, size_t count);

/* Ticks clocks that are due. Returns whether there is another tick, and its time. */
bool servotwin_fmu_tick(servotwin_fmu *fmu, double *next_s);

/* The directional derivative of variables (states' derivatives, outputs) for states and inputs. */
bool servotwin_fmu_directional(servotwin_fmu *fmu, const uint32_t *unknowns, size_t unknown_count,
    const uint32_t *knowns, size_t known_count, const double *seeds, double *sensitivities);

/* Copies a state into memory, which is allocated if there is none; a null pointer without memory. */
void *servotwin_fmu_copied(const void *state, void *into);

/* Copies a state into a list of bytes, if it is long enough. */
bool servotwin_fmu_serialize(const void *state, void *bytes, size_t size);

#endif
