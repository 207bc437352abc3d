/* Equations of a system for the lanes of a register, written by servotwin. */
#include <stdint.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define IN const double *restrict
#define OUT double *restrict
#define ROUNDING 6755399441055744.0
#define INTEGER_AND_BIAS 4503599627371519.0
#define ONE 0x3ff0000000000000
#define ROOT_HALF 0x3fe6a09e667f3bcd
#define MANTISSA 0x000fffffffffffff
#define INTEGER 0x4330000000000000

#if WIDTH == 8
#include <immintrin.h>
typedef __m512d LANES;
typedef __mmask8 TRUTH;
#define ALL(x) _mm512_set1_pd(x)
#define AT(array, place) _mm512_loadu_pd(array + STRIDE * place + lane)
#define PUT(array, place, value) _mm512_storeu_pd(array + STRIDE * place + lane, value)
#define root(x) _mm512_sqrt_pd(x)
#define absolute(x) _mm512_andnot_pd(ALL(-0.0), x)
#define negative(x) _mm512_xor_pd(x, ALL(-0.0))
#define smaller(a, b) _mm512_min_pd(a, b)
#define larger(a, b) _mm512_max_pd(a, b)
#define less(a, b) _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ)
#define chosen(truth, yes, no) _mm512_mask_blend_pd(truth, no, yes)
#define scaled(x, exponent) _mm512_scalef_pd(x, exponent)
#define BITS(x) _mm512_castpd_si512(x)
#define NUMBER(x) _mm512_castsi512_pd(x)
#define WORD(x) _mm512_set1_epi64((long long)(x))
#define PLUS(a, b) _mm512_add_epi64(a, b)
#define AND(a, b) _mm512_and_si512(a, b)
#define OR(a, b) _mm512_or_si512(a, b)
#define DOWN(x) _mm512_srli_epi64(x, 52)

#elif WIDTH == 4
#include <immintrin.h>
typedef __m256d LANES;
typedef __m256d TRUTH;
#define ALL(x) _mm256_set1_pd(x)
#define AT(array, place) _mm256_loadu_pd(array + STRIDE * place + lane)
#define PUT(array, place, value) _mm256_storeu_pd(array + STRIDE * place + lane, value)
#define root(x) _mm256_sqrt_pd(x)
#define absolute(x) _mm256_andnot_pd(ALL(-0.0), x)
#define negative(x) _mm256_xor_pd(x, ALL(-0.0))
#define smaller(a, b) _mm256_min_pd(a, b)
#define larger(a, b) _mm256_max_pd(a, b)
#define less(a, b) _mm256_cmp_pd(a, b, _CMP_LT_OQ)
#define chosen(truth, yes, no) _mm256_blendv_pd(no, yes, truth)
#define BITS(x) _mm256_castpd_si256(x)
#define NUMBER(x) _mm256_castsi256_pd(x)
#define WORD(x) _mm256_set1_epi64x((long long)(x))
#define PLUS(a, b) _mm256_add_epi64(a, b)
#define AND(a, b) _mm256_and_si256(a, b)
#define OR(a, b) _mm256_or_si256(a, b)
#define DOWN(x) _mm256_srli_epi64(x, 52)
#define UP(x) _mm256_slli_epi64(x, 52)

#else
#ifdef __SSE4_1__
#include <immintrin.h>
#endif
typedef double LANES;
#define ALL(x) (x)
#define AT(array, place) array[STRIDE * place + lane]
#define PUT(array, place, value) array[STRIDE * place + lane] = value
#define root(x) __builtin_sqrt(x)
#define absolute(x) __builtin_fabs(x)
#define negative(x) (-(x))
#define WORD(x) ((uint64_t)(x))
#define PLUS(a, b) ((a) + (b))
#define AND(a, b) ((a) & (b))
#define OR(a, b) ((a) | (b))
#define DOWN(x) ((x) >> 52)
#define UP(x) ((x) << 52)
INLINE uint64_t BITS(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}
INLINE double NUMBER(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}
#ifdef __SSE4_1__
/* Without a branch, that would be guessed wrong as often as not. */
typedef __m128d TRUTH;
#define less(a, b) _mm_cmplt_sd(_mm_set_sd(a), _mm_set_sd(b))
#define chosen(truth, yes, no) _mm_cvtsd_f64(_mm_blendv_pd(_mm_set_sd(no), _mm_set_sd(yes), truth))
#define smaller(a, b) _mm_cvtsd_f64(_mm_min_sd(_mm_set_sd(a), _mm_set_sd(b)))
#define larger(a, b) _mm_cvtsd_f64(_mm_max_sd(_mm_set_sd(a), _mm_set_sd(b)))
#else
typedef int TRUTH;
#define less(a, b) ((a) < (b))
#define chosen(truth, yes, no) ((truth) ? (yes) : (no))
#define smaller(a, b) ((a) < (b) ? (a) : (b))
#define larger(a, b) ((b) < (a) ? (a) : (b))
#endif
#endif

INLINE LANES rounded(LANES x)
{
    return (x + ALL(ROUNDING)) - ALL(ROUNDING);
}
#ifdef UP
INLINE LANES scaled(LANES x, LANES exponent)
{
    return x * NUMBER(PLUS(UP(BITS(exponent + ALL(ROUNDING))), WORD(ONE)));
}
#endif
INLINE LANES mantissa(LANES x)
{
    return NUMBER(PLUS(AND(PLUS(BITS(x), WORD(ONE - ROOT_HALF)), WORD(MANTISSA)), WORD(ROOT_HALF)));
}
INLINE LANES exponent(LANES x)
{
    return NUMBER(OR(DOWN(PLUS(BITS(x), WORD(ONE - ROOT_HALF))), WORD(INTEGER))) - ALL(INTEGER_AND_BIAS);
}
