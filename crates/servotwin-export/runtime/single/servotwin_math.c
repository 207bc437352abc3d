/*
 * Exponential and logarithms in single precision by the method of Sun's fdlibm (1993, 2004): reduction by powers of two,
 * then a polynomial, with the coefficients of its functions for float. One product or sum per statement, so that no
 * compiler may fuse two.
 */
#include "servotwin_math.h"

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

/* The bits of a float. C99 defines reading the other member of a union. */
typedef union {
    float number;
    uint32_t bits;
} number_and_bits;

servotwin_bits servotwin_bits_of(servotwin_real number)
{
    number_and_bits both;
    both.number = number;
    return both.bits;
}

static float number_of(uint32_t bits)
{
    number_and_bits both;
    both.bits = bits;
    return both.number;
}

bool servotwin_math_keeps_rules(void)
{
    return servotwin_keeps_rules();
}

#define LN2_HIGH 6.9314575195e-01F
#define LN2_LOW 1.4286067653e-06F

servotwin_real servotwin_exp(servotwin_real x)
{
    const float size = (x < 0.0F) ? -x : x;
    const uint32_t bits = servotwin_bits_of(size);
    int32_t power = 0;
    float high = x;
    float low = 0.0F;
    float rest = x;
    if (x < -87.0F) {
        return 0.0F;
    }
    if (bits <= 0x39000000U) {
        /* Up to 2^-13 the next term is lost. */
        return 1.0F + x;
    }
    if (bits > 0x3eb17218U) {
        /* Above half of ln 2: x = power ln 2 + rest. */
        if (bits > 0x3f851592U) {
            const float halves = 1.4426950216e+00F * x;
            const float rounded = halves + ((x < 0.0F) ? -0.5F : 0.5F);
            power = (int32_t)rounded;
        } else {
            power = (x < 0.0F) ? -1 : 1;
        }
        const float high_part = (float)power * LN2_HIGH;
        high = x - high_part;
        low = (float)power * LN2_LOW;
        rest = high - low;
    }
    const float square = rest * rest;
    const float second = square * -2.7667332906e-03F;
    const float sum = 1.6666625440e-01F + second;
    const float correction = square * sum;
    const float c = rest - correction;
    const float numerator = rest * c;
    const float denominator = 2.0F - c;
    const float quotient = numerator / denominator;
    const float lowered = quotient - low;
    const float tail = lowered + high;
    const float mantissa = 1.0F + tail;
    const int32_t exponent = 127 + power;
    return mantissa * number_of((uint32_t)exponent << 23);
}

/* A number as 2^exponent (1 + fraction) with 1 + fraction in sqrt(1/2) .. sqrt(2), and what both logarithms need of it. */
typedef struct {
    float exponent;
    float fraction;
    float half_square;
    float series; /* s (f^2/2 + R), with ln(1 + f) = f - f^2/2 + series */
} reduced_number;

static reduced_number reduced(float x)
{
    const uint32_t shifted = servotwin_bits_of(x) + (0x3f800000U - 0x3f3504f3U);
    const float significand = number_of((shifted & 0x007fffffU) + 0x3f3504f3U);
    reduced_number of;
    const int32_t exponent = (int32_t)(shifted >> 23) - 127;
    of.exponent = (float)exponent;
    of.fraction = significand - 1.0F;
    const float half = 0.5F * of.fraction;
    of.half_square = half * of.fraction;
    const float denominator = 2.0F + of.fraction;
    const float s = of.fraction / denominator;
    const float z = s * s;
    const float w = z * z;
    const float fourth = w * 0xf89e26.0p-26F;
    const float even_sum = 0xccce13.0p-25F + fourth;
    const float third = w * 0x91e9ee.0p-25F;
    const float odd_sum = 0xaaaaaa.0p-24F + third;
    const float even_part = w * even_sum;
    const float odd_part = z * odd_sum;
    const float remainder = odd_part + even_part;
    const float sum = of.half_square + remainder;
    of.series = s * sum;
    return of;
}

servotwin_real servotwin_log(servotwin_real x)
{
    const reduced_number of = reduced(x);
    const float low = of.exponent * 9.0580006145e-06F;
    const float high = of.exponent * 6.9313812256e-01F;
    const float first = of.series + low;
    const float second = first - of.half_square;
    const float third = second + of.fraction;
    return third + high;
}

servotwin_real servotwin_log10(servotwin_real x)
{
    const reduced_number of = reduced(x);
    /* ln(1 + f) = high + low, with few bits in high, so that its product with the high part of 1/ln 10 is exact. */
    const float whole = of.fraction - of.half_square;
    const float high = number_of(servotwin_bits_of(whole) & 0xfffff000U);
    const float left = of.fraction - high;
    const float halved = left - of.half_square;
    const float low = halved + of.series;
    const float exponent_high = of.exponent * 3.0102920532e-01F;
    const float exponent_low = of.exponent * 7.9034151668e-07F;
    const float high_high = high * 4.3432617188e-01F;
    const float sum = low + high;
    const float sum_low = sum * -3.1689971365e-05F;
    const float low_high = low * 4.3432617188e-01F;
    const float rest = exponent_low + sum_low;
    const float value_low = rest + low_high;
    const float value_high = value_low + high_high;
    return value_high + exponent_high;
}
