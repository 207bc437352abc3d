/* What the interfaces of FMI 2.0 and 3.0 share. servotwin_fmu_core.h says what an instance is: a system or a hybrid twin. */
#ifndef SERVOTWIN_FMU_H
#define SERVOTWIN_FMU_H

#include "servotwin_fmu_core.h"

#include <stddef.h>

/* What a compiler needs to be told so that a host finds a function. */
#if defined(_WIN32)
#define SHOWN __declspec(dllexport)
#elif defined(__GNUC__)
#define SHOWN __attribute__((visibility("default")))
#else
#define SHOWN
#endif

/* Declares and begins a function of the interface. */
#define FUNCTION(type, name, ...) \
    SHOWN type name(__VA_ARGS__); \
    type name(__VA_ARGS__)

/* Messages for the host's log. */
#define SERVOTWIN_FMU_UNKNOWN "there is no variable with this reference that has a value"
#define SERVOTWIN_FMU_NOT_SET "this variable cannot be set, or the value is out of its range"
#define SERVOTWIN_FMU_OTHER_LENGTH "the number of values differs"
#define SERVOTWIN_FMU_NO_MEMORY "there is no memory for the state"
#define SERVOTWIN_FMU_TOO_SHORT "the list of bytes is too short for a state"
#define SERVOTWIN_FMU_NO_STATE "the bytes are no state of this FMU"
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
