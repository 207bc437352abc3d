/* An FMU of a system with its faults. */
#ifndef SERVOTWIN_FMU_CORE_H
#define SERVOTWIN_FMU_CORE_H

#include "servotwin_twin.h"

/* What a host may integrate. */
#define SERVOTWIN_FMU_HAS_MODEL_EXCHANGE true
#define SERVOTWIN_FMU_STATES SERVOTWIN_TWIN_STATES

/*
 * References of variables: places in the array of variables, then parameters without a fault, then intensities of faults,
 * then the time, whether sensors have noise, and its seed.
 */
#define SERVOTWIN_FMU_PARAMETER 100000U
#define SERVOTWIN_FMU_FAULT 200000U
#define SERVOTWIN_FMU_TIME 300000U
#define SERVOTWIN_FMU_NOISE 300001U
#define SERVOTWIN_FMU_SEED 300002U
#define SERVOTWIN_FMU_LARGEST_SEED 4294967295.0

/* No member is a pointer, so a copy is a complete state. */
typedef struct {
    servotwin_twin twin;
    double parameters[SERVOTWIN_TWIN_PARAMETERS];
    double intensities[SERVOTWIN_TWIN_FAULTS];
    double inputs[SERVOTWIN_TWIN_INPUTS];
    double start_s; /* the host's time at the beginning */
    double noise; /* 1: the outputs are what the sensors show; 0: without noise and steps of converters */
    double seed;
    bool is_settled; /* the steady state for the inputs and parameters has been found */
    bool is_started; /* the host has left the initialization */
    bool is_stale; /* the variables are older than states or inputs */
    bool has_new_parameters;
} servotwin_fmu;

/* A sensor: its variable, the parameters of its noise and converter (-1 for none), and its span, SI. */
typedef struct {
    uint32_t variable;
    int32_t noise_parameter; /* standard deviation over full scale */
    int32_t bits_parameter;
    double full_scale;
    double range;
} servotwin_fmu_sensor;

/* servotwin_fmu_tables.c holds these. */
extern const servotwin_fmu_range servotwin_fmu_input_ranges[SERVOTWIN_TWIN_INPUTS];
extern const servotwin_fmu_range servotwin_fmu_parameter_ranges[SERVOTWIN_TWIN_PARAMETERS];
extern const servotwin_fmu_sensor servotwin_fmu_sensors[];
extern const int32_t servotwin_fmu_sensor_count;

#define SERVOTWIN_FMU_NO_BEGINNING "there is no steady state or motion to begin with for these inputs and parameters"

/* The directional derivatives of all variables for those of states and inputs; see servotwin_tangent.c. */
void servotwin_twin_tangent(const double *constants, const double *variables, const double *seeds, double *tangents);

#endif
