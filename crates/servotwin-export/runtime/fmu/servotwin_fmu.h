/* What the interfaces of FMI 2.0 and 3.0 share. servotwin_fmu_core.h says what an instance is: a system or a hybrid twin. */
#ifndef SERVOTWIN_FMU_H
#define SERVOTWIN_FMU_H

/* The least and the largest value of what a host sets. */
typedef struct {
    double least;
    double largest;
} servotwin_fmu_range;

#include "servotwin_fmu_core.h"

#include <stddef.h>

/* Which functions a library shows. */
#if defined(_WIN32)
#define SERVOTWIN_SHOWN __declspec(dllexport)
#elif defined(__GNUC__)
#define SERVOTWIN_SHOWN __attribute__((visibility("default")))
#else
#define SERVOTWIN_SHOWN
#endif

/* A host that links several FMUs into one program defines a prefix for the names of their functions, as FMI says. */
#define SERVOTWIN_JOINED(prefix, name) prefix##name
#define SERVOTWIN_PREFIXED(prefix, name) SERVOTWIN_JOINED(prefix, name)
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define SERVOTWIN_FULL_NAME(name) SERVOTWIN_PREFIXED(FMI2_FUNCTION_PREFIX, name)
#elif defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define SERVOTWIN_FULL_NAME(name) SERVOTWIN_PREFIXED(FMI3_FUNCTION_PREFIX, name)
#else
#define SERVOTWIN_FULL_NAME(name) name
#endif

/* Declares and begins a function of the interface. */
#define FUNCTION(type, name, ...) \
    SERVOTWIN_SHOWN type SERVOTWIN_FULL_NAME(name)(__VA_ARGS__); \
    type SERVOTWIN_FULL_NAME(name)(__VA_ARGS__)

/* An interface has arguments that an implementation does not need. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* The longest step, s. */
#define SERVOTWIN_FMU_LONGEST_STEP_S 1e4

/* Messages for the host's log. */
#define SERVOTWIN_FMU_UNKNOWN "there is no variable with this reference that has a value"
#define SERVOTWIN_FMU_NOT_SET \
    "this variable cannot be set, or the value is outside of its min and max in modelDescription.xml"
#define SERVOTWIN_FMU_OTHER_LENGTH "the number of values differs"
#define SERVOTWIN_FMU_NO_STATES "the number of states differs, or one is not finite"
#define SERVOTWIN_FMU_NO_MEMORY "there is no memory for the state"
#define SERVOTWIN_FMU_TOO_SHORT "the list of bytes is too short for a state"
#define SERVOTWIN_FMU_NO_STATE "this is no state of this FMU, or it was damaged"
#define SERVOTWIN_FMU_NO_TIME "a time is a finite number"
#define SERVOTWIN_FMU_NOT_STARTED "the simulation has not begun: the first step comes after the initialization mode"
#define SERVOTWIN_FMU_NO_STEP "the step cannot be simulated: a value became infinite, or the error stayed too large"
#define SERVOTWIN_FMU_OTHER_TIME \
    "a step begins at the time that the FMU has reached, and lasts from 0 to 10,000 s"
#define SERVOTWIN_FMU_NO_DERIVATIVE \
    "derivatives are known for states' derivatives and outputs with respect to states and inputs"

/* As after instantiation. */
void servotwin_fmu_reset(servotwin_fmu *fmu);

/* Ends the initialization. Returns false if there is no beginning for these inputs and parameters. */
bool servotwin_fmu_begin(servotwin_fmu *fmu);

/* The time of the host. */
double servotwin_fmu_time_s(const servotwin_fmu *fmu);

/* The value of a variable; false if there is none with the reference, or none can be computed. */
bool servotwin_fmu_value(servotwin_fmu *fmu, uint32_t reference, double *value);

/* Sets an input, a parameter or a state; false for any other variable and for a value out of range. */
bool servotwin_fmu_change(servotwin_fmu *fmu, uint32_t reference, double value);

/* The same for a list. */
bool servotwin_fmu_get(servotwin_fmu *fmu, const uint32_t *references, size_t count, double *values);
bool servotwin_fmu_set(servotwin_fmu *fmu, const uint32_t *references, size_t count, const double *values);

/* Whether a value lies between the least and the largest one; NaN never does. */
bool servotwin_fmu_is_within(double value, servotwin_fmu_range range);

/* Simulates a step of the host from the time that was reached. Returns why it cannot, or a null pointer. */
const char *servotwin_fmu_step(servotwin_fmu *fmu, double time_s, double step_s);

/* The same for a time and a length that were looked at; false if it cannot be simulated. */
bool servotwin_fmu_advance(servotwin_fmu *fmu, double time_s, double step_s);

/* What the host should know of steps of this length; a null pointer for nothing. */
const char *servotwin_fmu_step_warning(double step_s);

/* The time at which the simulation begins; false for one that is not finite. */
bool servotwin_fmu_start_at(servotwin_fmu *fmu, double time_s);

/*
 * For hosts that integrate the states. Lists of another length than that of the states and numbers that are not finite are
 * refused.
 */
bool servotwin_fmu_set_time(servotwin_fmu *fmu, double time_s);
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

/* The bytes of a state: a checksum, which knows this FMU, and the state. */
#define SERVOTWIN_FMU_BYTES (sizeof(uint64_t) + sizeof(servotwin_fmu))

/* Copies a state into a list of bytes, if it is long enough. */
bool servotwin_fmu_serialize(const void *state, void *bytes, size_t size);

/* The state in a list of bytes; a null pointer if they are not what this FMU has written. */
const void *servotwin_fmu_state_in(const void *bytes, size_t size);

#endif
