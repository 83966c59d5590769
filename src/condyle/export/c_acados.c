/* Discrete dynamics of "@name@" for acados, as generic external functions: a step of the classical
   Runge-Kutta method with efforts held, and its exact derivatives. Written by condyle @version@.
   x = (q, q'), q = (@free@);  u: efforts of @joints@. */
@source@
#include "acados/utils/external_function_generic.h"
#include "blasfeo_common.h"

#include <math.h>
#include <string.h>

enum { M = @m@, N = @n@, X = 2 * M, V = N + X };

static const double STEP = @step@; /* [s] */

/* The rate f of x under u and, with S = dx / d(u, x), (X, V) by rows, its derivatives F. */
static int rate(const double *x, const double *u, const double *S, double *f, double *F)
{
    double by_q[M * M], by_q1[M * M], by_u[M * N];
    int i, j, k, status;
    memcpy(f, x + M, M * sizeof *f);
    status = @prefix@_rate(x, x + M, u, f + M);
    if (F == NULL || status != @PREFIX@_OK) return status;
    status = @prefix@_slopes(x, x + M, u, by_q, by_q1, by_u);
    if (status != @PREFIX@_OK) return status;
    memcpy(F, S + M * V, M * V * sizeof *F);
    for (i = 0; i < M; i++)
        for (j = 0; j < V; j++) {
            double sum = j < N ? by_u[i * N + j] : 0.0;
            for (k = 0; k < M; k++)
                sum += by_q[i * M + k] * S[k * V + j] + by_q1[i * M + k] * S[(M + k) * V + j];
            F[(M + i) * V + j] = sum;
        }
    return status;
}

static void step(void **in, double *x, double *S)
{
    static const double PART[4] = {0.0, 0.5, 0.5, 1.0}, WEIGHT[4] = {1.0, 2.0, 2.0, 1.0};
    const struct blasfeo_dvec_args *given = in[0], *efforts = in[1];
    double u[N], from[X], at[X], f[X] = {0}, S_0[X * V] = {0}, S_at[X * V], F[X * V] = {0};
    int i, s, status = @PREFIX@_OK;
    for (i = 0; i < N; i++) u[i] = BLASFEO_DVECEL(efforts->x, efforts->xi + i);
    for (i = 0; i < X; i++) x[i] = from[i] = BLASFEO_DVECEL(given->x, given->xi + i);
    for (i = 0; i < X; i++) S_0[i * V + N + i] = 1.0;
    if (S != NULL) memcpy(S, S_0, sizeof S_0);
    for (s = 0; s < 4 && status == @PREFIX@_OK; s++) {
        for (i = 0; i < X; i++) at[i] = from[i] + STEP * PART[s] * f[i];
        for (i = 0; S != NULL && i < X * V; i++) S_at[i] = S_0[i] + STEP * PART[s] * F[i];
        status = rate(at, u, S_at, f, S == NULL ? NULL : F);
        for (i = 0; i < X; i++) x[i] += STEP / 6.0 * WEIGHT[s] * f[i];
        for (i = 0; S != NULL && i < X * V; i++) S[i] += STEP / 6.0 * WEIGHT[s] * F[i];
    }
    /* Out of reach, singular: no numbers, which the solver sees. */
    for (i = 0; status != @PREFIX@_OK && i < X; i++) x[i] = NAN;
}

static void written(void **out, const double *x)
{
    const struct blasfeo_dvec_args *to = out[0];
    int i;
    for (i = 0; i < X; i++) BLASFEO_DVECEL(to->x, to->xi + i) = x[i];
}

int @prefix@_disc_dyn_fun(void **in, void **out, void *params)
{
    double x[X];
    (void)params;
    step(in, x, NULL);
    written(out, x);
    return 0;
}

/* Derivatives stand as [d/du; d/dx] transposed, (N + X, X). */
int @prefix@_disc_dyn_fun_jac(void **in, void **out, void *params)
{
    const struct blasfeo_dmat_args *to = out[1];
    double x[X], S[X * V];
    int i, j;
    (void)params;
    step(in, x, S);
    written(out, x);
    for (i = 0; i < X; i++)
        for (j = 0; j < V; j++) BLASFEO_DMATEL(to->A, to->ai + j, to->aj + i) = S[i * V + j];
    return 0;
}
