/* Vectors of doubles for the generated kernels: W lanes, by GCC's and Clang's vector types.
 *
 * W is 8 (AVX-512), 4 (AVX2) or 2 (SSE2, NEON); the same text compiles for all of them. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

#ifndef W
#if defined(__AVX512F__)
#define W 8
#elif defined(__AVX2__)
#define W 4
#else
#define W 2
#endif
#endif

typedef double vec __attribute__((vector_size(8 * W)));
typedef int64_t mask __attribute__((vector_size(8 * W)));
typedef double unaligned __attribute__((vector_size(8 * W), aligned(8)));
#define INLINE static inline __attribute__((always_inline, unused))
/* Seen by the other text of a kernel alone. */
#define HIDDEN __attribute__((visibility("hidden")))

INLINE vec load(const double *p) { return *(const unaligned *)p; }
INLINE void store(double *p, vec v) { *(unaligned *)p = v; }
/* Stores that go past the caches, to aligned places; `fence` before others read them. */
#if W == 8 && defined(__AVX512F__)
INLINE void store_past(double *p, vec v) { _mm512_stream_pd(p, (__m512d)v); }
#elif W == 4 && defined(__AVX__)
INLINE void store_past(double *p, vec v) { _mm256_stream_pd(p, (__m256d)v); }
#elif W == 2 && defined(__SSE2__)
INLINE void store_past(double *p, vec v) { _mm_stream_pd(p, (__m128d)v); }
#else
INLINE void store_past(double *p, vec v) { store(p, v); }
#endif
#if defined(__SSE2__)
INLINE void fence(void) { _mm_sfence(); }
#else
INLINE void fence(void) {}
#endif
#if W == 8 && defined(__AVX512F__)
INLINE void store_some(double *p, vec v, int some) {
    _mm512_mask_storeu_pd(p, (__mmask8)((1 << some) - 1), (__m512d)v);
}
#else
INLINE void store_some(double *p, vec v, int some) {
    for (int i = 0; i < some; i++) p[i] = v[i];
}
#endif
INLINE vec spread(double x) { return x - (vec){0}; }
INLINE vec choose(mask m, vec a, vec b) { return (vec)((m & (mask)a) | (~m & (mask)b)); }
#if W == 8 && defined(__AVX512DQ__)
INLINE int any(mask m) { return _mm512_movepi64_mask((__m512i)m) != 0; }
#else
INLINE int any(mask m) {
    int64_t found = 0;
    for (int i = 0; i < W; i++) found |= m[i];
    return found != 0;
}
#endif
INLINE vec le_v(vec a, vec b) { return choose(a <= b, spread(1.0), spread(0.0)); }
INLINE vec lt_v(vec a, vec b) { return choose(a < b, spread(1.0), spread(0.0)); }
INLINE double le_s(double a, double b) { return a <= b; }
INLINE double lt_s(double a, double b) { return a < b; }
INLINE vec fabs_v(vec a) { return (vec)((mask)a & INT64_MAX); }
INLINE double fabs_s(double a) { return fabs(a); }
INLINE vec copysign_v(vec a, vec b) {
    return (vec)(((mask)a & INT64_MAX) | ((mask)b & ~INT64_MAX));
}
INLINE double copysign_s(double a, double b) { return __builtin_copysign(a, b); }
INLINE double fmin_s(double a, double b) { return a < b ? a : b; }
INLINE double fmax_s(double a, double b) { return a > b ? a : b; }
#if W == 8 && defined(__AVX512F__)
INLINE vec fmin_v(vec a, vec b) { return (vec)_mm512_min_pd((__m512d)a, (__m512d)b); }
INLINE vec fmax_v(vec a, vec b) { return (vec)_mm512_max_pd((__m512d)a, (__m512d)b); }
#else
INLINE vec fmin_v(vec a, vec b) { return choose(a < b, a, b); }
INLINE vec fmax_v(vec a, vec b) { return choose(a > b, a, b); }
#endif

/* 1 / sqrt(a): an estimate of 14 bits and two steps of Newton where the processor has one. */
#if W == 8 && defined(__AVX512F__)
INLINE vec rsqrt_v(vec a) {
    vec y = (vec)_mm512_rsqrt14_pd((__m512d)a);
    vec h = 0.5 * a;
    y = y * (1.5 - h * y * y);
    vec e = 0.5 - h * y * y;
    return y + y * e;
}
INLINE vec sqrt_v(vec a) { return (vec)_mm512_sqrt_pd((__m512d)a); }
#elif W == 4 && defined(__AVX__)
INLINE vec sqrt_v(vec a) { return (vec)_mm256_sqrt_pd((__m256d)a); }
INLINE vec rsqrt_v(vec a) { return 1.0 / sqrt_v(a); }
#else
INLINE vec sqrt_v(vec a) {
    for (int i = 0; i < W; i++) a[i] = __builtin_sqrt(a[i]);
    return a;
}
INLINE vec rsqrt_v(vec a) { return 1.0 / sqrt_v(a); }
#endif
INLINE double sqrt_s(double a) { return __builtin_sqrt(a); }
INLINE double rsqrt_s(double a) { return 1.0 / __builtin_sqrt(a); }

/* The first lanes, and `rest` in the others. */
INLINE vec lanes_used(vec v, int used, double rest) {
    mask m;
    for (int i = 0; i < W; i++) m[i] = i < used ? -1 : 0;
    return choose(m, v, spread(rest));
}

/* Sum and minimum over the lanes; the sums of two or four vectors in fewer steps than one by one. */
#if W == 8 && defined(__AVX512F__)
INLINE double lanes_sum(vec v) { return _mm512_reduce_add_pd((__m512d)v); }
INLINE double lanes_least(vec v) { return _mm512_reduce_min_pd((__m512d)v); }
INLINE __m512d pair_sums(vec a, vec b) { /* a b a b a b a b */
    return _mm512_add_pd(_mm512_unpacklo_pd((__m512d)a, (__m512d)b),
                         _mm512_unpackhi_pd((__m512d)a, (__m512d)b));
}
INLINE __m256d halves_sum(__m512d v) {
    return _mm256_add_pd(_mm512_castpd512_pd256(v), _mm512_extractf64x4_pd(v, 1));
}
INLINE void lanes_sums_2(vec a, vec b, double *sum_a, double *sum_b) {
    __m256d v = halves_sum(pair_sums(a, b));
    __m128d s = _mm_add_pd(_mm256_castpd256_pd128(v), _mm256_extractf128_pd(v, 1));
    *sum_a = s[0], *sum_b = s[1];
}
INLINE void lanes_sums_4(vec a, vec b, vec c, vec d, double *sum_a, double *sum_b, double *sum_c,
                         double *sum_d) {
    __m512d ab = pair_sums(a, b), cd = pair_sums(c, d);
    /* Quarters 0 2 of both and quarters 1 3 of both, then one half on the other. */
    __m512d both = _mm512_add_pd(_mm512_shuffle_f64x2(ab, cd, 0x88), _mm512_shuffle_f64x2(ab, cd, 0xdd));
    __m256d low = _mm512_castpd512_pd256(both), high = _mm512_extractf64x4_pd(both, 1);
    __m256d s = _mm256_add_pd(_mm256_permute2f128_pd(low, high, 0x20), _mm256_permute2f128_pd(low, high, 0x31));
    *sum_a = s[0], *sum_b = s[1], *sum_c = s[2], *sum_d = s[3];
}
#else
INLINE double lanes_sum(vec v) {
    double s = v[0];
    for (int i = 1; i < W; i++) s += v[i];
    return s;
}
INLINE double lanes_least(vec v) {
    double s = v[0];
    for (int i = 1; i < W; i++) s = fmin_s(s, v[i]);
    return s;
}
INLINE void lanes_sums_2(vec a, vec b, double *sum_a, double *sum_b) {
    *sum_a = lanes_sum(a), *sum_b = lanes_sum(b);
}
INLINE void lanes_sums_4(vec a, vec b, vec c, vec d, double *sum_a, double *sum_b, double *sum_c,
                         double *sum_d) {
    lanes_sums_2(a, b, sum_a, sum_b), lanes_sums_2(c, d, sum_c, sum_d);
}
#endif

/* Sine and cosine: reduction by pi/2 in three parts, then minimax polynomials (Cephes). Full
 * accuracy for |x| < 2^20; beyond that, and for what is not finite, the library's. */
#define TURNS_LIMIT 1048576.0
#define EIGHTH 0.785 /* below pi/4 nothing is taken off the angle */
#define POLYNOMIALS                                                                              \
    s = r + r * z * (-1.66666666666666307295e-1 + z * (8.33333333332211858878e-3 + z *           \
        (-1.98412698295895385996e-4 + z * (2.75573136213857245213e-6 + z *                       \
        (-2.50507477628578072866e-8 + z * 1.58962301576546568060e-10)))));                       \
    c = 1.0 - 0.5 * z + z * z * (4.16666666666665929218e-2 + z * (-1.38888888888730564116e-3 +   \
        z * (2.48015872888517045348e-5 + z * (-2.75573141792967388112e-7 + z *                   \
        (2.08757008419747316778e-9 - z * 1.13585365213876817300e-11)))));

INLINE void sincos_s(double x, double *sine, double *cosine) {
    double r = x, z, s, c;
    int64_t turns = 0;
    if (__builtin_expect(!(fabs(x) < EIGHTH), 0)) {
        if (!(fabs(x) < TURNS_LIMIT)) {
            *sine = sin(x), *cosine = cos(x);
            return;
        }
        double n = x * 6.36619772367581382433e-1 + 6755399441055744.0;
        memcpy(&turns, &n, 8);
        n -= 6755399441055744.0;
        r = ((x - n * 1.57079625129699707031) - n * 7.54978941586159635335e-8)
            - n * 5.39030285815811905290e-15;
    }
    z = r * r;
    POLYNOMIALS
    if (__builtin_expect(turns & 3, 0)) {
        double a = turns & 1 ? c : s, b = turns & 1 ? s : c;
        s = turns & 2 ? -a : a;
        c = (turns + 1) & 2 ? -b : b;
    }
    *sine = s, *cosine = c;
}

INLINE void sincos_v(vec x, vec *sine, vec *cosine) {
    vec r = x, z, s, c;
    if (__builtin_expect(!any(~(fabs_v(x) < EIGHTH)), 1)) {
        z = r * r;
        POLYNOMIALS
        *sine = s, *cosine = c;
        return;
    }
    vec n = x * 6.36619772367581382433e-1 + 6755399441055744.0;
    mask turns = (mask)n;
    n -= 6755399441055744.0;
    r = ((x - n * 1.57079625129699707031) - n * 7.54978941586159635335e-8)
        - n * 5.39030285815811905290e-15;
    z = r * r;
    POLYNOMIALS
    mask odd = -(turns & 1);
    vec a = choose(odd, c, s), b = choose(odd, s, c);
    vec sin_x = (vec)((mask)a ^ ((turns & 2) << 62));
    vec cos_x = (vec)((mask)b ^ (((turns + 1) & 2) << 62));
    mask far = ~(fabs_v(x) < TURNS_LIMIT);
    if (__builtin_expect(any(far), 0))
        for (int i = 0; i < W; i++)
            if (far[i]) sin_x[i] = sin(x[i]), cos_x[i] = cos(x[i]);
    *sine = sin_x, *cosine = cos_x;
}

/* Arc of a point: t = lesser over greater coordinate, or (t - 1) / (t + 1) where that is smaller,
 * so that |t| <= 1/2; atan(t) by a polynomial through Chebyshev's points (within 4e-18), and what
 * is left is a number of eighths of a turn, whose multiples are exact. Two units of the last place;
 * for both coordinates zero, what is not finite and what overflows, the library's. */
#define EIGHTH_TURN 0.7853981633974483
#define EIGHTH_TURN_REST 3.061616997868383e-17

INLINE double atan2_s(double y, double x) { return atan2(y, x); }
INLINE vec atan2_v(vec y, vec x) {
    const mask sign = (mask)spread(-0.0);
    vec across = fabs_v(y), along = fabs_v(x), sum = across + along;
    mask steep = across > along, back = x < 0.0;
    vec most = choose(steep, across, along), least = choose(steep, along, across);
    mask wide = least > 0.5 * most;
    vec t = choose(wide, least - most, least) / choose(wide, sum, most);
    vec z = t * t, zz = z * z;
    vec even = -3.33333333333333315e-1 + zz * (-1.42857142855987407e-1 + zz *
        (-9.09090861886538707e-2 + zz * (-6.66643514414314322e-2 + zz *
        (-5.24006415441106853e-2 + zz * (-3.80622479499668698e-2 - zz * 9.21106350462792581e-3)))));
    vec odd = 1.99999999999994849e-1 + zz * (1.11111111008817611e-1 + zz *
        (7.69229467748263467e-2 + zz * (5.87957310779968419e-2 + zz *
        (4.62787008641868395e-2 + zz * 2.49996895075213673e-2))));
    vec arc = t + t * (z * (even + z * odd));
    vec eighths = choose(wide, spread(1.0), spread(0.0));
    eighths = choose(steep, 2.0 - eighths, eighths);
    eighths = choose(back, 4.0 - eighths, eighths);
    arc = (vec)((mask)arc ^ ((steep ^ back) & sign));
    arc = eighths * EIGHTH_TURN + (arc + eighths * EIGHTH_TURN_REST);
    arc = copysign_v(arc, y);
    mask strange = ~((sum > 0.0) & (sum < 1e308));
    if (__builtin_expect(any(strange), 0))
        for (int i = 0; i < W; i++)
            if (strange[i]) arc[i] = atan2(y[i], x[i]);
    return arc;
}

/* What surfaces written in Python may use besides: lane by lane, by the library. */
#define ONE_ARGUMENT(name, value)                                                                 \
    INLINE double name##_s(double a) { return value; }                                            \
    INLINE vec name##_v(vec x) {                                                                  \
        for (int i = 0; i < W; i++) x[i] = name##_s(x[i]);                                        \
        return x;                                                                                 \
    }
#define TWO_ARGUMENTS(name, value)                                                                \
    INLINE double name##_s(double a, double b) { return value; }                                  \
    INLINE vec name##_v(vec x, vec y) {                                                           \
        for (int i = 0; i < W; i++) x[i] = name##_s(x[i], y[i]);                                  \
        return x;                                                                                 \
    }
TWO_ARGUMENTS(pow, pow(a, b))
TWO_ARGUMENTS(fmod, fmod(a, b))
TWO_ARGUMENTS(remainder, remainder(a, b))
TWO_ARGUMENTS(hypot, hypot(a, b))
TWO_ARGUMENTS(eq, a == b)
TWO_ARGUMENTS(ne, a != b)
TWO_ARGUMENTS(and, a != 0 && b != 0)
TWO_ARGUMENTS(or, a != 0 || b != 0)
TWO_ARGUMENTS(where, a != 0 ? b : 0)
ONE_ARGUMENT(not, a == 0)
ONE_ARGUMENT(sign, a < 0 ? -1 : a > 0 ? 1 : a)
ONE_ARGUMENT(floor, floor(a))
ONE_ARGUMENT(ceil, ceil(a))
ONE_ARGUMENT(exp, exp(a))
ONE_ARGUMENT(expm1, expm1(a))
ONE_ARGUMENT(log, log(a))
ONE_ARGUMENT(log1p, log1p(a))
ONE_ARGUMENT(tan, tan(a))
ONE_ARGUMENT(asin, asin(a))
ONE_ARGUMENT(acos, acos(a))
ONE_ARGUMENT(atan, atan(a))
ONE_ARGUMENT(sinh, sinh(a))
ONE_ARGUMENT(cosh, cosh(a))
ONE_ARGUMENT(tanh, tanh(a))
ONE_ARGUMENT(asinh, asinh(a))
ONE_ARGUMENT(acosh, acosh(a))
ONE_ARGUMENT(atanh, atanh(a))
ONE_ARGUMENT(erf, erf(a))
