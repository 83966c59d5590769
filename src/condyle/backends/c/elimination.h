#define DEPENDENT 1e-10 /* of the largest entry: a pivot of none */

/* x of A x = b, (n, n), in the place of b, by elimination; 0 where rows depend on each other. */
static int eliminated(double *A, double *b, int n)
{
    double largest = 0.0;
    for (int i = 0; i < n * n; i++)
        largest = fmax(largest, fabs(A[i]));
    for (int k = 0; k < n; k++) {
        int best = k;
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > fabs(A[best * n + k]))
                best = i;
        if (!(fabs(A[best * n + k]) > DEPENDENT * largest))
            return 0;
        for (int j = 0; j <= n; j++) {
            double *one = j < n ? A + k * n + j : b + k, *other = j < n ? A + best * n + j : b + best;
            const double kept = *one;
            *one = *other;
            *other = kept;
        }
        for (int i = k + 1; i < n; i++) {
            const double by = A[i * n + k] / A[k * n + k];
            for (int j = k; j < n; j++)
                A[i * n + j] -= by * A[k * n + j];
            b[i] -= by * b[k];
        }
    }
    for (int k = n - 1; k >= 0; k--) {
        for (int j = k + 1; j < n; j++)
            b[k] -= A[k * n + j] * b[j];
        b[k] /= A[k * n + k];
    }
    return 1;
}
