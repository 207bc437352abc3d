/*
 * Arithmetic that gives the same bits on every machine with IEEE 754 doubles: the logarithm and the exponential of the
 * trained models, and a test that refuses a build which fuses products and sums.
 */
#ifndef SERVOTWIN_MATH_H
#define SERVOTWIN_MATH_H

#include <float.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: it gives other decisions than were trained"
#endif
#if FLT_EVAL_METHOD != 0
#error "compile with arithmetic in double alone (x86: -msse2 -mfpmath=sse)"
#endif
#if DBL_MANT_DIG != 53
#error "double must be IEEE 754 binary64"
#endif

/*
 * 1 if a product and a sum round twice and correctly, as they must; 0 if the compiler fuses them, or if doubles in software
 * round wrongly. Call it once, at start.
 */
int servotwin_rounds_twice(void);

/* The bits of a number. */
uint64_t servotwin_bits_of(double number);

/* e^x for x of at most 709. 0 below -708. */
double servotwin_exp(double x);

/* The natural logarithm of a positive, finite and normal number. */
double servotwin_log(double x);

/* The logarithm of base ten of a positive, finite and normal number. */
double servotwin_log10(double x);

/* Turns logarithms, of which at least one is finite, into shares that sum to one. */
void servotwin_softmax(double *values, int32_t count);

/* Index of the largest value; the first of a tie. */
int32_t servotwin_largest(const double *values, int32_t count);

#endif
