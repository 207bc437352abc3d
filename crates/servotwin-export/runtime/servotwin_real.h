/*
 * The numbers of this diagnosis: double precision.
 */
#ifndef SERVOTWIN_REAL_H
#define SERVOTWIN_REAL_H

#include "servotwin_exact.h"

#include <float.h>
#include <stdint.h>

#if DBL_MANT_DIG != 53
#error "double must be IEEE 754 binary64"
#endif

typedef double servotwin_real;

/* As many bits as a number has, and those of the usual NaN, which no plausible input has. */
typedef uint64_t servotwin_bits;
#define SERVOTWIN_BITS_OF_MISSING 0x7ff8000000000000U

/* The largest number, and the least normal one. */
#define SERVOTWIN_REAL_MAX DBL_MAX
#define SERVOTWIN_REAL_MIN DBL_MIN

/* Numbers whose product is 1 when it is rounded, and 5/3. */
#define SERVOTWIN_ABOVE_ONE (1.0 + 0x1p-30)
#define SERVOTWIN_BELOW_ONE (1.0 - 0x1p-30)
#define SERVOTWIN_FIVE_THIRDS 0x1.aaaaaaaaaaaabp+0

/* The size of a number: a function of math.h. */
#define SERVOTWIN_ABS fabs

/* A random number of 64 bits as one from 0 to below 1: the bits that are dropped, and the step of the rest. */
#define SERVOTWIN_DROPPED_BITS 11U
#define SERVOTWIN_STEP 0x1p-53

/* Upper limit of probabilities whose logarithm of odds is taken. */
#define SERVOTWIN_MOST_PROBABILITY (1.0 - 1e-12)

/* The least share of a sum of squares that a difference of two such sums can show. */
#define SERVOTWIN_LEAST_LEFT 1e-12

#endif
