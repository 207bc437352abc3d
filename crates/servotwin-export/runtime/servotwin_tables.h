/* Everything that was trained or configured, as constants. servotwin_tables.c holds the numbers. */
#ifndef SERVOTWIN_TABLES_H
#define SERVOTWIN_TABLES_H

#include "servotwin_exact.h"
#include "servotwin_models.h"
#include "servotwin_windows.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    servotwin_real scale; /* of its residual, SI */
    servotwin_real noise; /* standard deviation of a sample, parts of scale */
    servotwin_real stand_in_noise; /* that of a value that stands in for it */
    servotwin_real growth; /* of its spread until the spool is displaced by its scale */
    int32_t actuator; /* or SERVOTWIN_NONE */
    int32_t spool; /* the sensor that its spread grows with, or SERVOTWIN_NONE */
} servotwin_sensor;

typedef struct {
    servotwin_real least; /* plausible values, SI */
    servotwin_real largest;
    uint32_t frozen_after; /* samples with the same bits; 0 for no limit */
} servotwin_input;

/* A plausible difference of two inputs, SI. */
typedef struct {
    int32_t of;
    int32_t minus;
    servotwin_real least;
    servotwin_real largest;
} servotwin_difference;

/* Corresponding sensors of two actuators. */
typedef struct {
    int32_t first;
    int32_t second;
    int32_t sensors;
    const uint8_t *of_first;
    const uint8_t *of_second;
} servotwin_common_pair;

/* The ranges of a class in training. */
typedef struct {
    int32_t features; /* 0 for a class without rows */
    const servotwin_real *lows;
    const servotwin_real *highs;
    const servotwin_real *widths;
    servotwin_real limit;
} servotwin_known;

/* What a wrong reading of an input does to the sensors of its actuator, in parts of scale for one SI unit. */
typedef struct {
    int32_t input;
    int32_t sensor; /* the sensor next to the boundary */
    bool is_return; /* that sensor measures a return pressure */
    servotwin_real own_change; /* of that sensor */
    int32_t effects;
    const uint8_t *sensors;
    const servotwin_real *changes;
} servotwin_boundary;

typedef struct {
    servotwin_span span;
    servotwin_real share; /* of the newest pane in the window */
    bool is_corrected; /* its residuals are those beyond the baseline */
    int32_t views;
    const servotwin_real *bands; /* half widths, parts of scale */
    const servotwin_hierarchy *trees;
    const servotwin_hierarchy *committee; /* boosted trees */
    servotwin_real least_confidence;
    int32_t known_classes;
    const servotwin_known *known; /* healthy, then the actions */
    const servotwin_real *limits; /* nats, of each hypothesis against each other */
    const servotwin_real *allowances; /* nats */
    servotwin_real limit_of_change; /* nats */
    servotwin_real allowance;
    servotwin_real allowed_change;
    servotwin_real novel_nats; /* evidence of a novel window for an unknown change, and of any other */
    servotwin_real known_nats;
} servotwin_length;

typedef struct {
    servotwin_real period_s;
    int32_t least_on;
    servotwin_real clip_nats;
    servotwin_real evidence_cap;
    servotwin_real in_band_nats;
    servotwin_real in_band_share;
    servotwin_real pending_share;
    servotwin_real least_detail_confidence;
    servotwin_real max_common_mode;
    servotwin_real most_lost;
    uint64_t recover_samples;
    uint32_t settle_samples;
    uint32_t held_samples; /* for which the twin goes on without an input */
    uint32_t recovering_samples; /* that are not judged afterwards */
    uint32_t until_lost_samples;
    uint32_t until_back_samples;
    servotwin_real fault_needed_nats;
    servotwin_real boundary_memory_s;
    servotwin_real healthy_forgotten; /* part that a sample forgets of the healthy line */
    servotwin_real line_variance; /* of an error of a line's pressure that moves with the flow */
    servotwin_real information_of_lines; /* 1 over the variance of the slopes of healthy lines */
    servotwin_real least_boundary_move; /* parts of the band */
    servotwin_real largest_boundary_error; /* parts of scale */
} servotwin_constants;

extern const servotwin_sensor servotwin_sensors[SERVOTWIN_SENSORS];
extern const servotwin_input servotwin_inputs[SERVOTWIN_INPUTS];
extern const servotwin_difference servotwin_differences[];
extern const servotwin_common_pair servotwin_common_pairs[];
extern const servotwin_boundary servotwin_boundaries[];
extern const servotwin_length servotwin_lengths[SERVOTWIN_LENGTHS];
extern const servotwin_stream_plan servotwin_stream_plans[2];
extern const uint8_t servotwin_orders[SERVOTWIN_VIEWS][SERVOTWIN_SENSORS];
extern const uint8_t servotwin_switches_off[SERVOTWIN_ACTIONS];
extern const int32_t servotwin_baseline_settle_samples;
extern const int32_t servotwin_baseline_memory_samples;
extern const servotwin_real servotwin_delay_samples; /* of sensors */
extern const servotwin_constants servotwin_tuning;
/* Of the start test: plausible inputs, and the mixture of the answers. */
extern const servotwin_real servotwin_known_inputs[];
extern const uint64_t servotwin_known_answer;

extern const char *const servotwin_sensor_names[];
extern const char *const servotwin_input_names[];
extern const char *const servotwin_actuator_names[];
extern const char *const servotwin_action_names[];
extern const char *const servotwin_detail_names[];

#ifdef __cplusplus
}
#endif

#endif
