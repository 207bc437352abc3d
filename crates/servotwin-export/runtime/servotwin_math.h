/*
 * Arithmetic that gives the same bits on every machine with IEEE 754 numbers: the logarithm and the exponential of the
 * trained models, and a test that refuses a build which fuses products and sums.
 */
#ifndef SERVOTWIN_MATH_H
#define SERVOTWIN_MATH_H

#include "servotwin_exact.h"
#include "servotwin_real.h"

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The bits of a number. */
servotwin_bits servotwin_bits_of(servotwin_real number);

/*
 * Whether arithmetic is that of IEEE 754 where this is compiled: a product and a sum round twice, sums and divisions keep
 * their order, and missing and infinite values, the sign of zero and subnormal numbers are kept. A build can give each
 * file its own flags, so each file has this test, and the start asks all of them.
 */
static inline bool servotwin_keeps_rules(void)
{
    const volatile servotwin_real large = 0x1p60;
    const volatile servotwin_real above = SERVOTWIN_ABOVE_ONE;
    const volatile servotwin_real below = SERVOTWIN_BELOW_ONE;
    const volatile servotwin_real one = 1.0;
    const volatile servotwin_real five = 5.0;
    const volatile servotwin_real zero = 0.0;
    const volatile servotwin_real nothing = 0.0;
    const volatile servotwin_real least = SERVOTWIN_REAL_MIN;
    const servotwin_real product = above * below;
    const servotwin_real difference = product - one;
    const servotwin_real raised = large + one;
    const servotwin_real left = raised - large;
    const servotwin_real part = five / 3.0;
    const servotwin_real missing = zero / nothing;
    const servotwin_real endless = one / zero;
    const servotwin_real negative = -zero;
    const servotwin_real sum = negative + 0.0;
    const servotwin_real subnormal = least * 0.5;
    const servotwin_real whole = subnormal + subnormal;
    return (difference == 0.0) && (left == 0.0) && (part == SERVOTWIN_FIVE_THIRDS)
        && (missing != missing) && !(missing <= one) && !(missing >= one) && (endless > SERVOTWIN_REAL_MAX)
        && (servotwin_bits_of(sum) == 0U) && (whole == least);
}

/* Whether the file of this name keeps them. */
bool servotwin_math_keeps_rules(void);
bool servotwin_random_keeps_rules(void);
bool servotwin_models_keeps_rules(void);
bool servotwin_windows_keeps_rules(void);
bool servotwin_features_keeps_rules(void);
bool servotwin_judge_keeps_rules(void);
bool servotwin_decision_keeps_rules(void);
bool servotwin_boundary_keeps_rules(void);
bool servotwin_equations_keeps_rules(void);

/* e^x for x of at most 709, and 0 below -708. */
servotwin_real servotwin_exp(servotwin_real x);

/* The natural logarithm of a positive, finite and normal number. */
servotwin_real servotwin_log(servotwin_real x);

/* The logarithm of base ten of a positive, finite and normal number. */
servotwin_real servotwin_log10(servotwin_real x);

#ifdef __cplusplus
}
#endif

#endif
