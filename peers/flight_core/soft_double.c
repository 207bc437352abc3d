/*
 * Sums and differences of doubles in software, correctly rounded to nearest even. The ones of libgcc 12.2 for Arm lose
 * sticky bits when the exponents differ by 33: 1 - 0x1.9d1df27e0dc03p-33 is one unit in the last place too small.
 */
#include <stdint.h>

#define SIGN 0x8000000000000000U
#define INFINITE 0x7ff0000000000000U
#define HIDDEN 0x0010000000000000U

typedef union {
    double number;
    uint64_t bits;
} pun;

/* Places below the last digit: guard, round and sticky bits. */
#define EXTRA 3U

static uint64_t shifted(uint64_t significand, uint32_t by)
{
    if (by == 0U) {
        return significand;
    }
    if (by > 63U) {
        return (significand != 0U) ? 1U : 0U;
    }
    const uint64_t lost = significand << (64U - by);
    return (significand >> by) | ((lost != 0U) ? 1U : 0U);
}

static uint64_t rounded(uint64_t sign, uint32_t exponent, uint64_t significand)
{
    const uint64_t rest = significand & 7U;
    uint64_t whole = significand >> EXTRA;
    if ((rest > 4U) || ((rest == 4U) && ((whole & 1U) != 0U))) {
        whole++;
    }
    /* A carry into the hidden bit of the next exponent adds up by itself. */
    const uint64_t bits = (whole < HIDDEN) ? whole : ((((uint64_t)exponent - 1U) << 52U) + whole);
    return sign | ((bits >= INFINITE) ? INFINITE : bits);
}

static uint32_t exponent_of(uint64_t size)
{
    const uint32_t exponent = (uint32_t)(size >> 52U);
    return (exponent == 0U) ? 1U : exponent;
}

static uint64_t significand_of(uint64_t size)
{
    const uint64_t fraction = size & (HIDDEN - 1U);
    return ((size >= HIDDEN) ? (fraction | HIDDEN) : fraction) << EXTRA;
}

static uint64_t sum(uint64_t a, uint64_t b)
{
    if ((a & ~SIGN) < (b & ~SIGN)) {
        const uint64_t larger = b;
        b = a;
        a = larger;
    }
    const uint64_t large = a & ~SIGN;
    const uint64_t small = b & ~SIGN;
    const uint64_t sign = a & SIGN;
    const int is_difference = ((a ^ b) & SIGN) != 0U;
    if (large >= INFINITE) {
        return ((large > INFINITE) || (is_difference && (small == INFINITE))) ? 0x7ff8000000000000U : a;
    }
    uint32_t exponent = exponent_of(large);
    uint64_t significand = significand_of(large);
    const uint64_t other = shifted(significand_of(small), exponent - exponent_of(small));
    significand = is_difference ? (significand - other) : (significand + other);
    if (significand == 0U) {
        return is_difference ? 0U : sign;
    }
    if ((significand >> (53U + EXTRA)) != 0U) {
        significand = shifted(significand, 1U);
        exponent++;
    }
    while ((significand < (HIDDEN << EXTRA)) && (exponent > 1U)) {
        significand <<= 1U;
        exponent--;
    }
    return rounded(sign, exponent, significand);
}

double __aeabi_dadd(double a, double b) __attribute__((pcs("aapcs")));
double __aeabi_dadd(double a, double b)
{
    pun x = { a }, y = { b };
    x.bits = sum(x.bits, y.bits);
    return x.number;
}

double __aeabi_dsub(double a, double b) __attribute__((pcs("aapcs")));
double __aeabi_dsub(double a, double b)
{
    pun x = { a }, y = { b };
    x.bits = sum(x.bits, y.bits ^ SIGN);
    return x.number;
}

double __aeabi_drsub(double a, double b) __attribute__((pcs("aapcs")));
double __aeabi_drsub(double a, double b)
{
    pun x = { a }, y = { b };
    x.bits = sum(x.bits ^ SIGN, y.bits);
    return x.number;
}
