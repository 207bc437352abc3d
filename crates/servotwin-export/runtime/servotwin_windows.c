#include "servotwin_windows.h"

#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* Residuals that the baseline learns are clipped to this part of their scale. */
#define LARGEST_LEARNED 0.25
/* The largest residual of a healthy sensor in a window, in standard deviations. */
#define LARGEST_OF_STAND_IN 3.0

void servotwin_window_clear(servotwin_window *window)
{
    window->samples = 0;
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        window->mean[i] = 0.0;
    }
    for (int32_t i = 0; i < SERVOTWIN_MOMENTS; i++) {
        window->moments[i] = 0.0;
    }
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        window->largest[i] = 0.0;
        window->inverse[i] = 0.0;
        window->undivided[i] = 0.0;
        window->own_moments[i] = 0.0;
        window->cross_moments[i] = 0.0;
    }
}

/* Of a sample or a window: 1/d, the residual before its division, and how far the twin's signal is from its mean. */
typedef struct {
    servotwin_real inverse;
    servotwin_real residual;
    servotwin_real twin;
} undivided_numbers;

static int32_t place_of(int32_t a, int32_t b)
{
    const int32_t low = (a < b) ? a : b;
    const int32_t high = (a < b) ? b : a;
    return ((high * (high + 1)) / 2) + low;
}

servotwin_real servotwin_covariance(const servotwin_window *window, int32_t a, int32_t b)
{
    return window->moments[place_of(a, b)] / (servotwin_real)window->samples;
}

/* Moves the means of undivided residuals towards a sample or a window by `share`; co-moments grow by `weight`. */
static void take_undivided(servotwin_window *window, int32_t sensor, const undivided_numbers *numbers,
    servotwin_real share, servotwin_real weight)
{
    const servotwin_real distance = numbers->residual - window->undivided[sensor];
    const servotwin_real weighed = distance * weight;
    const servotwin_real own = weighed * distance;
    const servotwin_real cross = weighed * numbers->twin;
    const servotwin_real change = numbers->inverse - window->inverse[sensor];
    const servotwin_real inverse_step = change * share;
    const servotwin_real step = distance * share;
    window->own_moments[sensor] = window->own_moments[sensor] + own;
    window->cross_moments[sensor] = window->cross_moments[sensor] + cross;
    window->inverse[sensor] = window->inverse[sensor] + inverse_step;
    window->undivided[sensor] = window->undivided[sensor] + step;
}

/* Adds one sample: Welford's update, extended to the matrix of co-moments. */
static void add_sample(servotwin_window *window, const servotwin_divided_sample *sample)
{
    servotwin_real deviation[SERVOTWIN_CHANNELS];
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        const servotwin_real scale = servotwin_sensors[i].scale;
        const servotwin_real difference = sample->judged[i] - sample->twin[i];
        const servotwin_real residual = difference / scale;
        const servotwin_real signal = sample->twin[i] / scale;
        const servotwin_real size = SERVOTWIN_ABS(residual);
        deviation[i] = residual - window->mean[i];
        deviation[SERVOTWIN_SENSORS + i] = signal - window->mean[SERVOTWIN_SENSORS + i];
        if (size > window->largest[i]) {
            window->largest[i] = size;
        }
    }
    window->samples++;
    const servotwin_real count = (servotwin_real)window->samples;
    const servotwin_real before = count - 1.0;
    const servotwin_real weight = before / count;
    int32_t place = 0;
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        const servotwin_real scaled = deviation[i] * weight;
        for (int32_t j = 0; j <= i; j++) {
            const servotwin_real product = scaled * deviation[j];
            window->moments[place] = window->moments[place] + product;
            place++;
        }
    }
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        const servotwin_real step = deviation[i] / count;
        window->mean[i] = window->mean[i] + step;
    }
    const servotwin_real share = 1.0 / count;
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        const servotwin_real inverse = 1.0 / sample->spreads[i];
        const servotwin_real difference = sample->measured[i] - sample->twin[i];
        const servotwin_real residual = difference / servotwin_sensors[i].scale;
        const undivided_numbers numbers = { inverse, residual, deviation[SERVOTWIN_SENSORS + i] };
        take_undivided(window, i, &numbers, share, weight);
    }
}

/* Adds the samples of a window that follows and has some (Chan, Golub and LeVeque, 1979). */
static void merge(servotwin_window *window, const servotwin_window *later)
{
    servotwin_real difference[SERVOTWIN_CHANNELS];
    const int32_t samples = window->samples + later->samples;
    const servotwin_real share = (servotwin_real)later->samples / (servotwin_real)samples;
    const servotwin_real weight = (servotwin_real)window->samples * share;
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        difference[i] = later->mean[i] - window->mean[i];
        const servotwin_real step = difference[i] * share;
        window->mean[i] = window->mean[i] + step;
    }
    int32_t place = 0;
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        const servotwin_real scaled = difference[i] * weight;
        for (int32_t j = 0; j <= i; j++) {
            const servotwin_real product = scaled * difference[j];
            const servotwin_real sum = later->moments[place] + product;
            window->moments[place] = window->moments[place] + sum;
            place++;
        }
    }
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        if (later->largest[i] > window->largest[i]) {
            window->largest[i] = later->largest[i];
        }
        const undivided_numbers numbers = {
            later->inverse[i], later->undivided[i], difference[SERVOTWIN_SENSORS + i]
        };
        take_undivided(window, i, &numbers, share, weight);
        window->own_moments[i] = window->own_moments[i] + later->own_moments[i];
        window->cross_moments[i] = window->cross_moments[i] + later->cross_moments[i];
    }
    window->samples = samples;
}

/* Adds the samples of a window that follows, if it has any. */
static void absorb(servotwin_window *window, const servotwin_window *later)
{
    if (later->samples > 0) {
        merge(window, later);
    }
}

static int32_t channel_of(const uint8_t *order, int32_t channel)
{
    int32_t first = 0;
    if (channel >= SERVOTWIN_SENSORS) {
        first = SERVOTWIN_SENSORS;
    }
    return first + (int32_t)order[channel - first];
}

void servotwin_window_reorder(const servotwin_window *window, const uint8_t *order, servotwin_window *into)
{
    int32_t place = 0;
    into->samples = window->samples;
    for (int32_t i = 0; i < SERVOTWIN_CHANNELS; i++) {
        const int32_t from = channel_of(order, i);
        into->mean[i] = window->mean[from];
        for (int32_t j = 0; j <= i; j++) {
            into->moments[place] = window->moments[place_of(from, channel_of(order, j))];
            place++;
        }
    }
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        into->largest[i] = window->largest[order[i]];
    }
}

void servotwin_window_hide(servotwin_window *window, int32_t sensor, servotwin_real noise)
{
    const servotwin_real variance = noise * noise;
    window->mean[sensor] = 0.0;
    for (int32_t j = 0; j < SERVOTWIN_CHANNELS; j++) {
        window->moments[place_of(sensor, j)] = 0.0;
    }
    window->moments[place_of(sensor, sensor)] = variance * (servotwin_real)window->samples;
    window->largest[sensor] = LARGEST_OF_STAND_IN * noise;
}

bool servotwin_is_full(const servotwin_ring *ring, int32_t length)
{
    return ring->ended >= servotwin_lengths[length].span.panes;
}

/* Gives a full base pane to a length. */
static void take(servotwin_ring *ring, const servotwin_span *span, const servotwin_window *base)
{
    absorb(&ring->open, base);
    ring->has_ended = (ring->open.samples >= span->pane_samples);
    if (ring->has_ended) {
        ring->panes[ring->next] = ring->open;
        servotwin_window_clear(&ring->open);
        ring->next = (ring->next + 1) % span->panes;
        if (ring->ended < span->panes) {
            ring->ended++;
        }
        servotwin_window_clear(&ring->window);
        for (int32_t i = 0; i < span->panes; i++) {
            absorb(&ring->window, &ring->panes[(ring->next + i) % span->panes]);
        }
    }
}

static void take_turn(servotwin_stream *stream, servotwin_ring *rings, const servotwin_stream_plan *plan)
{
    const int32_t place = plan->places[stream->turn];
    take(&rings[place], &servotwin_lengths[place].span, &stream->full);
    stream->turn++;
}

void servotwin_divide_by_spread(servotwin_spreads *spreads, const servotwin_real *measured, const servotwin_real *twin,
    servotwin_real *divided)
{
    servotwin_real reach[SERVOTWIN_SENSORS];
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        const servotwin_real x = twin[i] / servotwin_sensors[i].scale;
        const servotwin_real difference = spreads->has_last ? (x - spreads->last[i]) : 0.0;
        const servotwin_real travel = SERVOTWIN_ABS(difference) * servotwin_delay_samples;
        reach[i] = SERVOTWIN_ABS(x) + travel;
        spreads->last[i] = x;
    }
    spreads->has_last = true;
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        const int32_t spool = servotwin_sensors[i].spool;
        spreads->spreads[i] = 1.0;
        divided[i] = measured[i];
        if (spool != SERVOTWIN_NONE) {
            const servotwin_real growth = servotwin_sensors[i].growth * reach[spool];
            const servotwin_real difference = measured[i] - twin[i];
            spreads->spreads[i] = 1.0 + growth;
            const servotwin_real part = difference / spreads->spreads[i];
            divided[i] = twin[i] + part;
        }
    }
}

bool servotwin_stream_add(servotwin_stream *stream, servotwin_ring *rings, const servotwin_stream_plan *plan,
    const servotwin_divided_sample *sample)
{
    bool has_new = false;
    for (int32_t i = 0; i < plan->lengths; i++) {
        rings[plan->places[i]].has_ended = false;
    }
    add_sample(&stream->base, sample);
    if (stream->base.samples >= plan->base_samples) {
        /* With more lengths than samples in a pane, the remaining lengths cannot wait any longer. */
        while (stream->turn < plan->lengths) {
            take_turn(stream, rings, plan);
        }
        stream->full = stream->base;
        servotwin_window_clear(&stream->base);
        stream->turn = 0;
    }
    if (stream->turn < plan->lengths) {
        take_turn(stream, rings, plan);
    }
    for (int32_t i = 0; i < plan->lengths; i++) {
        has_new = has_new || rings[plan->places[i]].has_ended;
    }
    return has_new;
}

void servotwin_stream_clear(servotwin_stream *stream, servotwin_ring *rings, const servotwin_stream_plan *plan)
{
    servotwin_window_clear(&stream->base);
    servotwin_window_clear(&stream->full);
    stream->turn = plan->lengths;
    for (int32_t i = 0; i < plan->lengths; i++) {
        servotwin_ring *ring = &rings[plan->places[i]];
        for (int32_t pane = 0; pane < SERVOTWIN_MOST_PANES; pane++) {
            servotwin_window_clear(&ring->panes[pane]);
        }
        servotwin_window_clear(&ring->open);
        servotwin_window_clear(&ring->window);
        ring->next = 0;
        ring->ended = 0;
        ring->has_ended = false;
    }
}

void servotwin_baseline_clear(servotwin_baseline *baseline)
{
    baseline->samples = 0;
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        baseline->means[i] = 0.0;
    }
}

bool servotwin_baseline_is_settled(const servotwin_baseline *baseline)
{
    return baseline->samples >= servotwin_baseline_settle_samples;
}

void servotwin_baseline_learn(servotwin_baseline *baseline, const servotwin_real *measured, const servotwin_real *twin)
{
    if (baseline->samples <= servotwin_baseline_settle_samples) {
        baseline->samples++;
    }
    const bool is_settling = (baseline->samples <= servotwin_baseline_settle_samples);
    const servotwin_real memory = (servotwin_real)(is_settling ? baseline->samples : servotwin_baseline_memory_samples);
    for (int32_t i = 0; i < SERVOTWIN_SENSORS; i++) {
        const servotwin_real most = LARGEST_LEARNED * servotwin_sensors[i].scale;
        servotwin_real residual = measured[i] - twin[i];
        if (residual < -most) {
            residual = -most;
        }
        if (residual > most) {
            residual = most;
        }
        const servotwin_real distance = residual - baseline->means[i];
        const servotwin_real step = distance / memory;
        baseline->means[i] = baseline->means[i] + step;
    }
}

bool servotwin_windows_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
