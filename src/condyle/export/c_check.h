static double larger(double a, double b) { return a > b ? a : b; }

/* Largest difference of a result to sample `i` of `right`, over the largest entry of all samples. */
static double error(const real *found, const double *right, int i, int size, int samples)
{
    double most = 0.0, off = 0.0;
    for (int k = 0; k < size * samples; k++) most = larger(most, fabs(right[k]));
    for (int k = 0; k < size; k++) {
        const double one = fabs((double)found[k] - right[i * size + k]);
        off = one <= off ? off : one;
    }
    return most > 0.0 ? off / most : off;
}

static int report(const char *name, int samples, int wrong, double worst, double most)
{
    const int failed = wrong > 0 || !(worst <= most);
    printf("%s: %d samples, worst error %.1e, %d wrong statuses: %s\n", name, samples, worst, wrong,
           failed ? "FAILED" : "ok");
    return failed;
}
