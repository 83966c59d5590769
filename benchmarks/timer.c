/* Times a kernel from C, where a control loop would call it. */
#include "../src/condyle/backends/c/vector.h"
#include <time.h>

typedef int (*One)(const double *, const double *, double *);
typedef void (*Batch)(const double *, const double *const *, const ptrdiff_t *, size_t, double *,
                      size_t, uint8_t *);
typedef int (*Casadi)(const double **, double **, long long *, double *, int);

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Seconds an evaluation over `count` samples, `inputs` apart; with `dependent`, each waits for the
 * result of the one before. */
double time_one(One f, const double *table, double *samples, size_t count, size_t inputs,
                double *out, int dependent) {
    double start = now(), wait = 0;
    for (size_t i = 0; i < count; i++) {
        double *sample = samples + i * inputs;
        if (dependent) sample[0] += wait;
        f(table, sample, out);
        wait = 1e-300 * out[0];
    }
    return (now() - start) / (double)count;
}

double time_batch(Batch f, const double *table, const double *const *in, const ptrdiff_t *stride,
                  size_t count, double *out, uint8_t *status) {
    double start = now();
    f(table, in, stride, count, out, count, status);
    return (now() - start) / (double)count;
}

double time_casadi(Casadi f, double *samples, size_t count, size_t inputs, double *out,
                   long long *iw, double *w, int dependent) {
    double start = now(), wait = 0;
    for (size_t i = 0; i < count; i++) {
        double *sample = samples + i * inputs;
        if (dependent) sample[0] += wait;
        const double *in[1] = {sample};
        double *res[1] = {out};
        f(in, res, iw, w, 0);
        wait = 1e-300 * out[0];
    }
    return (now() - start) / (double)count;
}

/* Clock rate: a chain of additions takes one cycle each. */
double clock_rate(long count) {
    double start = now();
    long x = 0;
    for (long i = 0; i < count; i++) {
#if defined(__x86_64__)
        __asm__ volatile("add $1, %0" : "+r"(x));
#elif defined(__aarch64__)
        __asm__ volatile("add %0, %0, #1" : "+r"(x));
#else
        x += 1;
#endif
    }
    return (double)count / (now() - start);
}

/* Seconds a fused multiply-add of vectors takes at best, while nothing else is done. */
double vector_operation(long count) {
    vec b = (vec){} + 0.999, c = (vec){} + 1e-3;
    vec a0 = c, a1 = b, a2 = c + 1, a3 = b + 1, a4 = c + 2, a5 = b + 2, a6 = c + 3, a7 = b + 3,
        a8 = c + 4, a9 = b + 4, a10 = c + 5, a11 = b + 5;
    double start = now();
    for (long i = 0; i < count; i += 12) {
        a0 = a0 * b + c, a1 = a1 * b + c, a2 = a2 * b + c, a3 = a3 * b + c;
        a4 = a4 * b + c, a5 = a5 * b + c, a6 = a6 * b + c, a7 = a7 * b + c;
        a8 = a8 * b + c, a9 = a9 * b + c, a10 = a10 * b + c, a11 = a11 * b + c;
    }
    double seconds = now() - start;
    vec all = a0 + a1 + a2 + a3 + a4 + a5 + a6 + a7 + a8 + a9 + a10 + a11;
    volatile double used = all[0];
    (void)used;
    return seconds / (double)count;
}

/* q'' of X, Y, alpha, beta under springs and dampers on these, `one` from state to accelerations.
 *
 * in: q, q', efforts, force, moment, point. The springs' wrench has no part along Z and gamma. */
static void sprung(One f, const double *table, double *in, int n, double *out, const double *x,
                   const double *stiffness, const double *damping) {
    double pull[4], *load = in + 8 + n;
    for (int i = 0; i < 8; i++) in[i] = x[i];
    for (int i = 0; i < 4; i++) pull[i] = -stiffness[i] * x[i] - damping[i] * x[4 + i];
    double c = cos(x[2]), s = sin(x[2]), lean = tan(x[3]) * pull[2];
    load[0] = pull[0];
    load[1] = pull[1];
    load[3] = pull[2];
    load[4] = c * pull[3] + s * lean;
    load[5] = s * pull[3] - c * lean;
    f(table, in, out);
}

/* Seconds that a motion takes by Runge and Kutta's method of fourth order; x: q and q'. */
double time_springs(One f, const double *table, double *in, int n, double *out, double *x,
                    const double *stiffness, const double *damping, double step, long steps) {
    const double part[4] = {0.5, 0.5, 1.0, 0.0}, weight[4] = {1 / 6., 1 / 3., 1 / 3., 1 / 6.};
    double start = now();
    for (long k = 0; k < steps; k++) {
        double at[8], next[8];
        for (int i = 0; i < 8; i++) at[i] = next[i] = x[i];
        for (int stage = 0; stage < 4; stage++) {
            sprung(f, table, in, n, out, at, stiffness, damping);
            double slope[8];
            for (int i = 0; i < 4; i++) slope[i] = at[4 + i], slope[4 + i] = out[i];
            for (int i = 0; i < 8; i++) {
                next[i] += step * weight[stage] * slope[i];
                at[i] = x[i] + step * part[stage] * slope[i];
            }
        }
        for (int i = 0; i < 8; i++) x[i] = next[i];
    }
    return now() - start;
}
