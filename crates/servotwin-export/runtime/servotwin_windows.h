/*
 * Statistics of sliding windows in fixed memory: sample count, joint mean and joint co-moments of all scaled residuals and
 * twin signals, and the largest magnitude of each residual. A sample enters the base pane alone; full panes are merged.
 */
#ifndef SERVOTWIN_WINDOWS_H
#define SERVOTWIN_WINDOWS_H

#include "servotwin_exact.h"
#include "servotwin_real.h"
#include "servotwin_sizes.h"

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Channels are the residuals, then the twin's signals. */
#define SERVOTWIN_CHANNELS (2 * SERVOTWIN_SENSORS)
#define SERVOTWIN_MOMENTS ((SERVOTWIN_CHANNELS * (SERVOTWIN_CHANNELS + 1)) / 2)

typedef struct {
    int32_t samples;
    servotwin_real mean[SERVOTWIN_CHANNELS]; /* parts of scale */
    servotwin_real moments[SERVOTWIN_MOMENTS]; /* lower triangle, row by row */
    servotwin_real largest[SERVOTWIN_SENSORS]; /* |r'|, parts of scale */
    /* Of residuals as measured, before their spread d divides them: mean of 1/d, mean, co-moments with themselves and with
       the twin's signal of the same sensor. */
    servotwin_real inverse[SERVOTWIN_SENSORS];
    servotwin_real undivided[SERVOTWIN_SENSORS];
    servotwin_real own_moments[SERVOTWIN_SENSORS];
    servotwin_real cross_moments[SERVOTWIN_SENSORS];
} servotwin_window;

/* The length of a window. */
typedef struct {
    int32_t pane_samples;
    int32_t panes;
} servotwin_span;

/* The window of one length. */
typedef struct {
    servotwin_window panes[SERVOTWIN_MOST_PANES];
    servotwin_window open;
    servotwin_window window; /* over the full panes */
    int32_t next; /* the pane that is filled next */
    int32_t ended; /* full panes so far, at most as many as there are */
    bool has_ended; /* the newest sample completed a window */
} servotwin_ring;

/* Lengths that share samples. They take a full base pane one sample after the other. */
typedef struct {
    servotwin_window base;
    servotwin_window full;
    int32_t turn;
} servotwin_stream;

/* Which lengths a stream has. */
typedef struct {
    int32_t base_samples;
    int32_t lengths;
    const uint8_t *places; /* of its lengths among all */
} servotwin_stream_plan;

/* The spreads of residuals. */
typedef struct {
    bool has_last;
    servotwin_real last[SERVOTWIN_SENSORS]; /* the twin's signals at the last sample, parts of scale */
    servotwin_real spreads[SERVOTWIN_SENSORS]; /* d: in parts of the spread at rest */
} servotwin_spreads;

/* The mean residuals of this specimen. */
typedef struct {
    int32_t samples; /* at most one more than the settling time */
    servotwin_real means[SERVOTWIN_SENSORS]; /* SI */
} servotwin_baseline;

void servotwin_window_clear(servotwin_window *window);

/* The window with its sensors in another order, for features: it has no undivided moments. */
void servotwin_window_reorder(const servotwin_window *window, const uint8_t *order, servotwin_window *into);

/* Gives the residual of a sensor the statistics of a stand-in value with this noise. */
void servotwin_window_hide(servotwin_window *window, int32_t sensor, servotwin_real noise);

servotwin_real servotwin_covariance(const servotwin_window *window, int32_t a, int32_t b);

void servotwin_stream_clear(servotwin_stream *stream, servotwin_ring *rings, const servotwin_stream_plan *plan);

/* Divides the residuals of a sample, SI, by their spreads: `divided` differs from the twin by the divided residuals. */
void servotwin_divide_by_spread(servotwin_spreads *spreads, const servotwin_real *measured, const servotwin_real *twin,
    servotwin_real *divided);

/* A sample whose residuals were divided by their spreads, SI. */
typedef struct {
    const servotwin_real *judged; /* the differences from the twin are the divided residuals */
    const servotwin_real *measured;
    const servotwin_real *twin;
    const servotwin_real *spreads;
} servotwin_divided_sample;

/* Adds a sample; says whether it completed a window. */
bool servotwin_stream_add(servotwin_stream *stream, servotwin_ring *rings, const servotwin_stream_plan *plan,
    const servotwin_divided_sample *sample);

bool servotwin_is_full(const servotwin_ring *ring, int32_t length);

void servotwin_baseline_clear(servotwin_baseline *baseline);
bool servotwin_baseline_is_settled(const servotwin_baseline *baseline);
void servotwin_baseline_learn(servotwin_baseline *baseline, const servotwin_real *measured, const servotwin_real *twin);

#ifdef __cplusplus
}
#endif

#endif
