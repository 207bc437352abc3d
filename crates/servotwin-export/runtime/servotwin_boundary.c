#include "servotwin_boundary.h"

#include "servotwin_math.h"
#include "servotwin_tables.h"

#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

#define LEAST_BAND 1e-12

static void sums_clear(servotwin_sums *sums)
{
    sums->samples = 0.0;
    sums->windows = 0.0;
    sums->moments[0] = 0.0;
    sums->moments[1] = 0.0;
    sums->moments[2] = 0.0;
}

void servotwin_doubt_clear(servotwin_doubt *doubt)
{
    doubt->deviating = 0U;
    doubt->explained = 0U;
    doubt->filled = 0U;
    doubt->has_right = false;
    doubt->right = 0.0;
    doubt->has_candidate = false;
    doubt->candidate = 0.0;
    doubt->moved = 0.0;
    doubt->shared = 0.0;
    doubt->fallen = 0.0;
    doubt->has_fallen = false;
    doubt->value = 0.0;
    doubt->has_recent = false;
    doubt->recent = 0.0;
    sums_clear(&doubt->since);
    sums_clear(&doubt->healthy);
    sums_clear(&doubt->waiting);
    sums_clear(&doubt->filling);
}

/* Keeps a share of what was. */
static void fade(servotwin_sums *sums, servotwin_real kept)
{
    sums->samples = sums->samples * kept;
    sums->windows = sums->windows * kept;
    for (int32_t i = 0; i < 3; i++) {
        sums->moments[i] = sums->moments[i] * kept;
    }
}

static void add(servotwin_sums *sums, const servotwin_sums *more)
{
    sums->samples = sums->samples + more->samples;
    sums->windows = sums->windows + more->windows;
    for (int32_t i = 0; i < 3; i++) {
        sums->moments[i] = sums->moments[i] + more->moments[i];
    }
}

static servotwin_real band_of(int32_t length, int32_t sensor)
{
    const servotwin_real band = servotwin_lengths[length].bands[sensor];
    return (band > LEAST_BAND) ? band : LEAST_BAND;
}

/* What a reading that is wrong by one unit moves the sensor of its i-th effect by. */
static servotwin_real moves(const servotwin_boundary *boundary, int32_t i, const servotwin_window *window)
{
    return boundary->changes[i] * window->inverse[boundary->sensors[i]];
}

/* Whether one wrong reading moves the sensor next to it enough, and leaves all other mean residuals within theirs. A
 * reading beside which the sensor never agreed with the twin may be wrong within the range of its input. */
static bool explains(
    servotwin_doubt *doubt, const servotwin_boundary *boundary, int32_t length, const servotwin_window *window,
    servotwin_real reading, bool has_agreed)
{
    const servotwin_input *input = &servotwin_inputs[boundary->input];
    servotwin_real along = 0.0;
    servotwin_real of = 0.0;
    for (int32_t i = 0; i < boundary->effects; i++) {
        const int32_t sensor = boundary->sensors[i];
        const servotwin_real band = band_of(length, sensor);
        const servotwin_real weighed = moves(boundary, i, window) / band;
        const servotwin_real product = weighed * window->mean[sensor];
        const servotwin_real part = product / band;
        const servotwin_real square = weighed * weighed;
        along = along + part;
        of = of + square;
    }
    const servotwin_real wrong_by = along / of;
    const servotwin_real own = wrong_by * boundary->own_change;
    const servotwin_real error = SERVOTWIN_ABS(own);
    const servotwin_real moved = error * window->inverse[boundary->sensor];
    const servotwin_real least = servotwin_tuning.least_boundary_move * band_of(length, boundary->sensor);
    doubt->value = reading + wrong_by;
    const bool is_within = !has_agreed && (doubt->value >= input->least) && (doubt->value <= input->largest);
    bool holds = (moved > least) && (is_within || (error <= servotwin_tuning.largest_boundary_error));
    for (int32_t i = 0; i < boundary->effects; i++) {
        const int32_t sensor = boundary->sensors[i];
        const servotwin_real expected = wrong_by * moves(boundary, i, window);
        const servotwin_real left = window->mean[sensor] - expected;
        holds = holds && (SERVOTWIN_ABS(left) <= band_of(length, sensor));
    }
    return holds;
}

/* Takes a window without a deviation, once a whole group of further ones has followed. */
static void take_healthy(
    servotwin_doubt *doubt, const servotwin_sums *fresh, uint32_t panes, servotwin_real reading, bool is_right)
{
    add(&doubt->filling, fresh);
    doubt->filled++;
    if (doubt->filled >= panes) {
        const servotwin_real exponent = -doubt->waiting.samples * servotwin_tuning.healthy_forgotten;
        fade(&doubt->healthy, servotwin_exp(exponent));
        add(&doubt->healthy, &doubt->waiting);
        doubt->waiting = doubt->filling;
        sums_clear(&doubt->filling);
        doubt->filled = 0U;
        if (doubt->has_candidate) {
            doubt->has_right = true;
            doubt->right = doubt->candidate;
        }
        doubt->has_candidate = is_right;
        doubt->candidate = reading;
    }
}

/* Evidence that the other sensors of the actuator share the fall of the sensor next to the boundary, nats. */
static servotwin_real shared_nats(const servotwin_boundary *boundary, const servotwin_window *window)
{
    const servotwin_real change = boundary->own_change * window->inverse[boundary->sensor];
    const servotwin_real fallen = window->mean[boundary->sensor] / change;
    servotwin_real nats = 0.0;
    for (int32_t i = 0; i < boundary->effects; i++) {
        const int32_t sensor = boundary->sensors[i];
        const servotwin_real noise = servotwin_sensors[sensor].noise * window->inverse[sensor];
        if ((sensor != boundary->sensor) && (noise > 0.0)) {
            const servotwin_real expected = fallen * moves(boundary, i, window);
            const servotwin_real half = 0.5 * expected;
            const servotwin_real left = window->mean[sensor] - half;
            const servotwin_real gain = expected * left;
            const servotwin_real weighed = gain * (servotwin_real)window->samples;
            const servotwin_real variance = noise * noise;
            const servotwin_real part = weighed / variance;
            nats = nats + part;
        }
    }
    return nats;
}

/* Whether the sensor fell by more than the reading moved. A reading that moved and came back counts as moved. */
static void fall(
    servotwin_doubt *doubt, const servotwin_boundary *known, servotwin_real band, const servotwin_window *window,
    servotwin_real reading)
{
    if (doubt->has_right) {
        const servotwin_real difference = reading - doubt->right;
        const servotwin_real size = SERVOTWIN_ABS(difference);
        if (size > doubt->moved) {
            doubt->moved = size;
        }
        const servotwin_real mean = window->mean[known->sensor];
        const servotwin_real change = known->own_change * window->inverse[known->sensor];
        const servotwin_real product = doubt->moved * change;
        doubt->fallen = SERVOTWIN_ABS(mean) - SERVOTWIN_ABS(product);
        const bool is_lower = (mean < 0.0) != (known->own_change < 0.0);
        doubt->has_fallen = is_lower && (doubt->fallen > band) && (doubt->shared > servotwin_tuning.clip_nats);
    }
}

/* Whether the reading moves by as much as a band within about a window. */
static bool follow(
    servotwin_doubt *doubt, const servotwin_boundary *known, int32_t length, const servotwin_window *window,
    servotwin_real reading)
{
    if (!doubt->has_recent) {
        doubt->has_recent = true;
        doubt->recent = reading;
    }
    const servotwin_real distance = reading - doubt->recent;
    const servotwin_real step = distance / (servotwin_real)servotwin_lengths[length].span.panes;
    const servotwin_real change = known->own_change * window->inverse[known->sensor];
    const servotwin_real moved = distance * change;
    doubt->recent = doubt->recent + step;
    return SERVOTWIN_ABS(moved) > servotwin_lengths[length].bands[known->sensor];
}

bool servotwin_has_agreed(const servotwin_doubt *doubt)
{
    return doubt->healthy.samples > 0.0;
}

void servotwin_doubt_take(
    servotwin_doubt *doubt, int32_t boundary, int32_t length, const servotwin_window *window,
    servotwin_real reading, bool has_agreed)
{
    const servotwin_boundary *known = &servotwin_boundaries[boundary];
    const int32_t sensor = known->sensor;
    const int32_t twin = SERVOTWIN_SENSORS + sensor;
    const uint32_t panes = (uint32_t)servotwin_lengths[length].span.panes;
    const servotwin_real count = (servotwin_real)window->samples;
    const servotwin_real variance = window->own_moments[sensor] / count;
    const servotwin_real covariance = window->cross_moments[sensor] / count;
    servotwin_sums fresh;
    fresh.windows = servotwin_lengths[length].share;
    fresh.samples = fresh.windows * (servotwin_real)window->samples;
    fresh.moments[0] = fresh.samples * variance;
    fresh.moments[1] = fresh.samples * covariance;
    fresh.moments[2] = fresh.samples * servotwin_covariance(window, twin, twin);
    const bool is_moving = follow(doubt, known, length, window, reading);
    if (explains(doubt, known, length, window, reading, has_agreed)) {
        doubt->explained = (is_moving || (doubt->deviating >= panes)) ? panes : 1U;
    } else if (doubt->explained > 0U) {
        doubt->explained--;
    } else {
        /* There is no explanation, as before. */
    }
    const servotwin_real band = servotwin_lengths[length].bands[sensor];
    const servotwin_real size = SERVOTWIN_ABS(window->mean[sensor]);
    if (size > band) {
        sums_clear(&doubt->waiting);
        sums_clear(&doubt->filling);
        doubt->filled = 0U;
        doubt->has_candidate = false;
        const servotwin_real shared = servotwin_lengths[length].share * shared_nats(known, window);
        doubt->shared = doubt->shared + shared;
        fall(doubt, known, band, window, reading);
        if (is_moving) {
            doubt->deviating = 0U;
        }
        if (doubt->deviating < UINT32_MAX) {
            doubt->deviating++;
        }
        if (doubt->deviating > panes) {
            const servotwin_real time_s = -fresh.samples * servotwin_tuning.period_s;
            fade(&doubt->since, servotwin_exp(time_s / servotwin_tuning.boundary_memory_s));
            add(&doubt->since, &fresh);
        }
    } else {
        const servotwin_real least = servotwin_tuning.least_boundary_move * band;
        doubt->deviating = 0U;
        doubt->moved = 0.0;
        doubt->shared = 0.0;
        doubt->fallen = 0.0;
        doubt->has_fallen = false;
        sums_clear(&doubt->since);
        take_healthy(doubt, &fresh, panes, reading, size <= least);
    }
}

typedef struct {
    bool is_known; /* there was motion */
    servotwin_real slope;
    servotwin_real information;
    servotwin_real independent; /* number of independent samples */
} slope_of_sums;

static slope_of_sums find_slope(const servotwin_sums *sums, servotwin_real noise)
{
    const servotwin_real of_residual = sums->moments[0];
    const servotwin_real of_both = sums->moments[1];
    const servotwin_real of_twin = sums->moments[2];
    slope_of_sums of = { false, 0.0, 0.0, 0.0 };
    of.is_known = (sums->samples > 1.0) && (of_residual > 0.0) && (of_twin > 0.0);
    if (of.is_known) {
        const servotwin_real square = of_both * of_both;
        const servotwin_real explained = square / of_twin;
        const servotwin_real least = SERVOTWIN_LEAST_LEFT * of_residual;
        servotwin_real left = of_residual - explained;
        if (left < least) {
            left = least;
        }
        const servotwin_real samples_and_noise = sums->samples * noise;
        const servotwin_real of_noise = samples_and_noise * noise;
        servotwin_real white = of_noise / left;
        if (white > 1.0) {
            white = 1.0;
        }
        const servotwin_real new_samples = white * sums->samples;
        const servotwin_real coloured = 1.0 - white;
        const servotwin_real new_windows = coloured * sums->windows;
        of.independent = new_samples + new_windows;
        if (of.independent < 1.0) {
            of.independent = 1.0;
        }
        const servotwin_real weighted = of.independent * of_twin;
        of.information = weighted / left;
        of.slope = of_both / of_twin;
    }
    return of;
}

servotwin_real servotwin_boundary_evidence(const servotwin_doubt *doubt, int32_t boundary)
{
    const servotwin_real noise = servotwin_sensors[servotwin_boundaries[boundary].sensor].noise;
    const slope_of_sums now = find_slope(&doubt->since, noise);
    const slope_of_sums healthy = find_slope(&doubt->healthy, noise);
    servotwin_real own = 0.0;
    servotwin_real variance = 1.0 / servotwin_tuning.information_of_lines;
    if (!now.is_known) {
        return 0.0;
    }
    if (healthy.is_known) {
        const servotwin_real information = servotwin_tuning.information_of_lines + healthy.information;
        variance = 1.0 / information;
        const servotwin_real weight = variance * healthy.information;
        own = weight * healthy.slope;
    }
    const servotwin_real change = now.slope - own;
    const servotwin_real square = change * change;
    const servotwin_real of_now = 1.0 / now.information;
    const servotwin_real motion = doubt->since.moments[2] / doubt->since.samples;
    const servotwin_real of_flow = servotwin_tuning.line_variance / motion;
    const servotwin_real of_slopes = of_now + variance;
    const servotwin_real of_change = of_slopes + of_flow;
    const servotwin_real likelihood = square / of_change;
    const servotwin_real price = servotwin_log(now.independent);
    const servotwin_real twice = likelihood - price;
    return 0.5 * twice;
}

bool servotwin_is_doubtful(const servotwin_doubt *doubt, int32_t boundary)
{
    return (doubt->explained > 0U)
        && (servotwin_boundary_evidence(doubt, boundary) < servotwin_tuning.fault_needed_nats);
}

bool servotwin_boundary_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
