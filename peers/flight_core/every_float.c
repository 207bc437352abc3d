/*
 * Compares exponential and logarithms of an export in single precision with those of the C library in double, for every
 * number of single precision within their range (about three minutes):
 *
 *   gcc -O2 -std=c99 -ffp-contract=off -I EXPORT every_float.c EXPORT/servotwin_math.c -lm -o every_float && ./every_float
 */
#include "servotwin_math.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* A function, the double that it stands for, and the arguments that it must take. */
typedef struct {
    const char *name;
    float (*single)(float);
    double (*right)(double);
    float least;
    float largest;
    uint64_t count;
    uint64_t not_nearest;
    double largest_error;
    float where;
} compared;

/* The distance of neighbors at a number. */
static double step_at(double number)
{
    int exponent = 0;
    (void)frexp(number, &exponent);
    return ldexp(1.0, ((exponent < -125) ? -125 : exponent) - 24);
}

static void compare(compared *function, float x)
{
    const double right = function->right((double)x);
    const float said = function->single(x);
    const double error = fabs((double)said - right) / step_at(right);
    function->count++;
    function->not_nearest += (said != (float)right) ? 1U : 0U;
    if (!(error <= function->largest_error)) {
        function->largest_error = error;
        function->where = x;
    }
}

int main(void)
{
    compared all[3] = { { "exp", servotwin_exp, exp, -87.0F, 88.0F, 0, 0, 0.0, 0.0F },
        { "log", servotwin_log, log, 0x1p-126F, 0x1.fffffep+127F, 0, 0, 0.0, 0.0F },
        { "log10", servotwin_log10, log10, 0x1p-126F, 0x1.fffffep+127F, 0, 0, 0.0, 0.0F } };
    int is_near = 1;
    for (uint64_t bits = 0; bits < 0x100000000U; bits++) {
        const uint32_t word = (uint32_t)bits;
        float x = 0.0F;
        memcpy(&x, &word, sizeof x);
        for (int i = 0; i < 3; i++) {
            if ((x >= all[i].least) && (x <= all[i].largest)) {
                compare(&all[i], x);
            }
        }
    }
    for (int i = 0; i < 3; i++) {
        printf("%s: %llu arguments, %llu without the nearest result, largest error %.4f steps at %a\n", all[i].name,
            (unsigned long long)all[i].count, (unsigned long long)all[i].not_nearest, all[i].largest_error, (double)all[i].where);
        is_near = is_near && (all[i].largest_error < 1.0);
    }
    return is_near ? 0 : 1;
}
