/* What the interfaces of FMI 2.0 and 3.0 have in common: one instance of the system with its faults. */
#ifndef SERVOTWIN_FMU_H
#define SERVOTWIN_FMU_H

#include "servotwin_twin.h"

/* Declares and begins a function of the interface. */
#define FUNCTION(type, name, ...) \
    __attribute__((visibility("default"))) type name(__VA_ARGS__); \
    type name(__VA_ARGS__)

/* References of variables: places in the array of variables, then parameters without a fault, then intensities of faults. */
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

/* The value of a variable; false if there is none with this reference, or none can be computed. */
bool servotwin_fmu_get(servotwin_fmu *fmu, uint32_t reference, double *value);

/* Sets an input, a parameter or an intensity; false for any other variable and for values out of range. */
bool servotwin_fmu_set(servotwin_fmu *fmu, uint32_t reference, double value);

/* Simulates up to a time of the host. */
bool servotwin_fmu_advance(servotwin_fmu *fmu, double to_s);

/* For hosts that integrate the states. */
void servotwin_fmu_set_time(servotwin_fmu *fmu, double time_s);
void servotwin_fmu_set_states(servotwin_fmu *fmu, const double *states);
bool servotwin_fmu_derivatives(servotwin_fmu *fmu, double *derivatives);

/* Ticks clocks that are due. Returns whether there is another tick, and its time. */
bool servotwin_fmu_tick(servotwin_fmu *fmu, double *next_s);

/* The directional derivative of variables (states' derivatives, outputs) for states and inputs. */
bool servotwin_fmu_directional(servotwin_fmu *fmu, const uint32_t *unknowns, uint64_t unknown_count,
    const uint32_t *knowns, uint64_t known_count, const double *seeds, double *sensitivities);

#endif
