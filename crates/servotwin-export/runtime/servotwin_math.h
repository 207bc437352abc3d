/*
 * Arithmetic that gives the same bits on every machine with IEEE 754 numbers: the logarithm and the exponential of the
 * trained models, and a test that refuses a build which fuses products and sums.
 */
#ifndef SERVOTWIN_MATH_H
#define SERVOTWIN_MATH_H

#include "servotwin_exact.h"
#include "servotwin_real.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A literal as a number of this diagnosis; without it, an expression in single precision would become a double. */
#define REAL(literal) ((servotwin_real)(literal))

/*
 * 1 if a product and a sum round twice and correctly, as they must; 0 if the compiler fuses them, or if numbers in software
 * round wrongly. Call it once, at start.
 */
int servotwin_rounds_twice(void);

/* The bits of a number. */
servotwin_bits servotwin_bits_of(servotwin_real number);

/* e^x for x of at most 709, and 0 below -708; in single precision 88 and -87. */
servotwin_real servotwin_exp(servotwin_real x);

/* The natural logarithm of a positive, finite and normal number. */
servotwin_real servotwin_log(servotwin_real x);

/* The logarithm of base ten of a positive, finite and normal number. */
servotwin_real servotwin_log10(servotwin_real x);

#ifdef __cplusplus
}
#endif

#endif
