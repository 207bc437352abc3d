/*
 * The numbers of this diagnosis: single precision. servotwin_real.h of an export in double precision has the same names,
 * and every other hand-written file but servotwin_math.c has the same text in both.
 */
#ifndef SERVOTWIN_REAL_H
#define SERVOTWIN_REAL_H

#include "servotwin_exact.h"

#include <float.h>
#include <stdint.h>

#if FLT_MANT_DIG != 24
#error "float must be IEEE 754 binary32"
#endif

typedef float servotwin_real;

/* As many bits as a number has, and those of the usual NaN, which no plausible input has. */
typedef uint32_t servotwin_bits;
#define SERVOTWIN_BITS_OF_MISSING 0x7fc00000U

/* The largest number, and the least normal one. */
#define SERVOTWIN_REAL_MAX FLT_MAX
#define SERVOTWIN_REAL_MIN FLT_MIN

/* Numbers whose product is 1 when it is rounded, and 5/3. */
#define SERVOTWIN_ABOVE_ONE 0x1.000200p+0F
#define SERVOTWIN_BELOW_ONE 0x1.fffc00p-1F
#define SERVOTWIN_FIVE_THIRDS 0x1.aaaaaap+0F

/* The size of a number: a function of math.h. */
#define SERVOTWIN_ABS fabsf

/* A random number of 64 bits as one from 0 to below 1: the bits that are dropped, and the step of the rest. */
#define SERVOTWIN_DROPPED_BITS 40U
#define SERVOTWIN_STEP 0x1p-24F

/* Upper limit of probabilities whose logarithm of odds is taken: the largest number below 1. */
#define SERVOTWIN_MOST_PROBABILITY 0x1.fffffep-1F

/* The least share of a sum of squares that a difference of two such sums can show. */
#define SERVOTWIN_LEAST_LEFT 1e-6F

#endif
