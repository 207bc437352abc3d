/*
 * Exponential and logarithms by the method of Sun's fdlibm (1993, 2004): reduction by powers of two, then a polynomial.
 * The constants are its published minimax coefficients, and the order of operations is that of Rust's crate libm, so the
 * results have the same bits. One product or sum per statement, so that no compiler may fuse two.
 */
#include "servotwin_math.h"

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* The bits of a double. C99 defines reading the other member of a union. */
typedef union {
    double number;
    uint64_t bits;
} number_and_bits;

servotwin_bits servotwin_bits_of(servotwin_real number)
{
    number_and_bits both;
    both.number = number;
    return both.bits;
}

static double number_of(uint64_t bits)
{
    number_and_bits both;
    both.bits = bits;
    return both.number;
}

bool servotwin_math_keeps_rules(void)
{
    /* Some doubles in software (libgcc 12.2 for Arm) lose digits when exponents differ by 33. */
    const volatile double one = 1.0;
    const volatile double small = 0x1.9d1df27e0dc03p-33;
    const double rest = one - small;
    return (rest == 0x1.fffffffe62e21p-1) && servotwin_keeps_rules();
}

/* Horner's scheme, the highest coefficient first. */
static double polynomial(double x, const double *coefficients, int32_t count)
{
    double sum = coefficients[0];
    for (int32_t i = 1; i < count; i++) {
        const double product = x * sum;
        sum = coefficients[i] + product;
    }
    return sum;
}

#define LN2_HIGH 6.93147180369123816490e-01
#define LN2_LOW 1.90821492927058770002e-10

servotwin_real servotwin_exp(servotwin_real x)
{
    static const double coefficients[5] = {
        4.13813679705723846039e-08, -1.65339022054652515390e-06, 6.61375632143793436117e-05,
        -2.77777777770155933842e-03, 1.66666666666666019037e-01
    };
    const double size = (x < 0.0) ? -x : x;
    const uint32_t high_word = (uint32_t)(servotwin_bits_of(size) >> 32);
    int32_t power = 0;
    double high = x;
    double low = 0.0;
    double rest = x;
    if (x < -708.0) {
        return 0.0;
    }
    if (high_word <= 0x3e300000U) {
        /* Below 2^-28 the next term is lost. */
        return 1.0 + x;
    }
    if (high_word > 0x3fd62e42U) {
        /* Above half of ln 2: x = power ln 2 + rest. */
        if (high_word >= 0x3ff0a2b2U) {
            const double halves = 1.44269504088896338700e+00 * x;
            const double rounded = halves + ((x < 0.0) ? -0.5 : 0.5);
            power = (int32_t)rounded;
        } else {
            power = (x < 0.0) ? -1 : 1;
        }
        const double high_part = (double)power * LN2_HIGH;
        high = x - high_part;
        low = (double)power * LN2_LOW;
        rest = high - low;
    }
    const double square = rest * rest;
    const double sum = polynomial(square, coefficients, 5);
    const double correction = square * sum;
    const double c = rest - correction;
    const double numerator = rest * c;
    const double denominator = 2.0 - c;
    const double quotient = numerator / denominator;
    const double lowered = quotient - low;
    const double tail = lowered + high;
    const double mantissa = 1.0 + tail;
    const int32_t exponent = 1023 + power;
    return mantissa * number_of((uint64_t)exponent << 52);
}

/* A number as 2^exponent (1 + fraction) with 1 + fraction in sqrt(1/2) .. sqrt(2), and what both logarithms need of it. */
typedef struct {
    double exponent;
    double fraction;
    double half_square;
    double series; /* s (f^2/2 + R), with ln(1 + f) = f - f^2/2 + series */
} reduced_number;

static reduced_number reduced(double x)
{
    static const double even[3] = {
        1.531383769920937332e-01, 2.222219843214978396e-01, 3.999999999940941908e-01
    };
    static const double odd[4] = {
        1.479819860511658591e-01, 1.818357216161805012e-01, 2.857142874366239149e-01, 6.666666666666735130e-01
    };
    const uint64_t bits = servotwin_bits_of(x);
    const uint32_t shifted = (uint32_t)(bits >> 32) + (0x3ff00000U - 0x3fe6a09eU);
    const uint32_t high_word = (shifted & 0x000fffffU) + 0x3fe6a09eU;
    const double significand = number_of(((uint64_t)high_word << 32) | (bits & 0xffffffffU));
    reduced_number of;
    const uint32_t exponent = shifted >> 20;
    of.exponent = (double)exponent - 1023.0;
    of.fraction = significand - 1.0;
    const double half = 0.5 * of.fraction;
    of.half_square = half * of.fraction;
    const double denominator = 2.0 + of.fraction;
    const double s = of.fraction / denominator;
    const double z = s * s;
    const double w = z * z;
    const double even_sum = polynomial(w, even, 3);
    const double odd_sum = polynomial(w, odd, 4);
    const double even_part = w * even_sum;
    const double odd_part = z * odd_sum;
    const double remainder = odd_part + even_part;
    const double sum = of.half_square + remainder;
    of.series = s * sum;
    return of;
}

servotwin_real servotwin_log(servotwin_real x)
{
    if (x == 1.0) {
        return 0.0;
    }
    const reduced_number of = reduced(x);
    const double low = of.exponent * LN2_LOW;
    const double high = of.exponent * LN2_HIGH;
    const double first = of.series + low;
    const double second = first - of.half_square;
    const double third = second + of.fraction;
    return third + high;
}

servotwin_real servotwin_log10(servotwin_real x)
{
    if (x == 1.0) {
        return 0.0;
    }
    const reduced_number of = reduced(x);
    /* ln(1 + f) = high + low, with few bits in high, so that its product with the high part of 1/ln 10 is exact. */
    const double whole = of.fraction - of.half_square;
    const double high = number_of(servotwin_bits_of(whole) & 0xffffffff00000000U);
    const double left = of.fraction - high;
    const double halved = left - of.half_square;
    const double low = halved + of.series;
    const double exponent_high = of.exponent * 3.01029995663611771306e-01;
    const double exponent_low = of.exponent * 3.69423907715893078616e-13;
    const double high_high = high * 4.34294481878168880939e-01;
    const double sum = low + high;
    const double sum_low = sum * 2.50829467116452752298e-11;
    const double low_high = low * 4.34294481878168880939e-01;
    const double rest = exponent_low + sum_low;
    const double value_low = rest + low_high;
    const double value_high = exponent_high + high_high;
    const double lost = exponent_high - value_high;
    const double found = lost + high_high;
    const double corrected = value_low + found;
    return corrected + value_high;
}
