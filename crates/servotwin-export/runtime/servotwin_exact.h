/*
 * Refuses builds whose arithmetic gives other decisions than were trained. Every header includes it. What a compiler does
 * not declare, the start test finds.
 */
#ifndef SERVOTWIN_EXACT_H
#define SERVOTWIN_EXACT_H

#include <float.h>

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) || defined(__NO_SIGNED_ZEROS__)
#error "compile without -ffast-math, -Ofast and -funsafe-math-optimizations: they give other decisions than were trained"
#endif
#if defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)
#error "compile without -ffast-math and -ffinite-math-only: a missing value is NaN"
#endif
#if FLT_EVAL_METHOD != 0
#error "compile with arithmetic in the type of the numbers alone (x86: -msse2 -mfpmath=sse)"
#endif

/* Refuses -fsingle-precision-constant. */
typedef char servotwin_constants_are_doubles[(sizeof(1.0) == sizeof(double)) ? 1 : -1];

#endif
