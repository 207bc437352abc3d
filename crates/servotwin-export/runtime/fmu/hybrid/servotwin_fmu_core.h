/* An FMU of a hybrid twin: the virtual twin and the diagnosis beside an actuator that the host simulates or measures. */
#ifndef SERVOTWIN_FMU_CORE_H
#define SERVOTWIN_FMU_CORE_H

#include "servotwin_hybrid.h"

/* The hybrid twin takes samples, so a host cannot integrate it. */
#define SERVOTWIN_FMU_HAS_MODEL_EXCHANGE false
#define SERVOTWIN_FMU_STATES 0

#define SERVOTWIN_FMU_NO_BEGINNING "this build rounds otherwise than in training: compile it with -ffp-contract=off"

/*
 * References of variables: inputs as in the FMU of the system, then measured values, whether an actuator is switched off,
 * the reset of the alarm, expected values, the diagnosis, parameters of the twin, and the time.
 */
#define SERVOTWIN_FMU_MEASURED 10000U
#define SERVOTWIN_FMU_SWITCHED_OFF 20000U
#define SERVOTWIN_FMU_RESET_ALARM 29999U
#define SERVOTWIN_FMU_EXPECTED 30000U
#define SERVOTWIN_FMU_DIAGNOSIS 40000U
#define SERVOTWIN_FMU_PARAMETER 100000U
#define SERVOTWIN_FMU_TIME 300000U

/* The variables of the diagnosis; numbers of actuators, actions, details and sensors begin at 1, and 0 is none. */
enum {
    SERVOTWIN_FMU_IS_SIMULATED,
    SERVOTWIN_FMU_FINDING,
    SERVOTWIN_FMU_ACTUATOR,
    SERVOTWIN_FMU_ACTION,
    SERVOTWIN_FMU_DETAIL,
    SERVOTWIN_FMU_CONFIDENCE,
    SERVOTWIN_FMU_ALARM,
    SERVOTWIN_FMU_RAISED_ACTUATOR,
    SERVOTWIN_FMU_RAISED_ACTION,
    SERVOTWIN_FMU_RAISED_DETAIL,
    SERVOTWIN_FMU_WORST,
    SERVOTWIN_FMU_WORST_SENSOR,
    SERVOTWIN_FMU_LOST,
    SERVOTWIN_FMU_RESULTS
};

/* No member is a pointer, so a copy is a complete state. */
typedef struct {
    servotwin_hybrid hybrid;
    double inputs[SERVOTWIN_TWIN_INPUTS];
    double measured[SERVOTWIN_SENSORS];
    double reset_alarm; /* its change from 0 to 1 withdraws what is raised */
    double results[SERVOTWIN_FMU_RESULTS];
    uint64_t samples; /* taken so far */
    double start_s; /* the host's time at the beginning, at which the first sample is taken */
    double time_s; /* the host's time */
    bool is_exact; /* this build rounds as in training */
    bool is_started; /* the host has left the initialization */
} servotwin_fmu;

/* servotwin_fmu_tables.c holds the range of each parameter of the twin. */
extern const servotwin_fmu_range servotwin_fmu_parameter_ranges[SERVOTWIN_TWIN_PARAMETERS];

#endif
