/*
 * Noise of stand-in values: xoshiro256++ filled by splitmix64, from the public description by Blackman and Vigna (2021).
 * The same sensor and sample always give the same number.
 */
#ifndef SERVOTWIN_RANDOM_H
#define SERVOTWIN_RANDOM_H

#include "servotwin_exact.h"
#include "servotwin_real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A deviate of mean 0 and variance 1, from twelve uniform ones. */
servotwin_real servotwin_normal(uint64_t seed, uint64_t stream);

#ifdef __cplusplus
}
#endif

#endif
