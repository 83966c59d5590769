typedef int (*rates_function)(void *of, double t, const double *x, double *rates);

/* One step of an explicit Runge-Kutta method: y at t + h from x at t, (n,) each.
 *
 * A: its coefficients row by row, 1, 2 .. `stages` numbers; the last row makes y.
 * k: rates of x, (stages + 1, n), the first given; the others are found, the last at y.
 * Returns what `rates` does where that is not 0, and then nothing of k and y counts. */
static int runge_kutta(const double *A, int stages, double t, double h, const double *restrict x,
                       int n, double *restrict y, double *restrict k, rates_function rates, void *of)
{
    for (int s = 1; s <= stages; A += s, s++) {
        double part = 0.0;
        int code;
        for (int j = 0; j < s; j++) part += A[j];
        for (int i = 0; i < n; i++) y[i] = x[i];
        for (int j = 0; j < s; j++)
            if (A[j] != 0)
                for (int i = 0; i < n; i++) y[i] += h * A[j] * k[j * n + i];
        if ((code = rates(of, t + part * h, y, k + s * n))) return code;
    }
    return 0;
}
