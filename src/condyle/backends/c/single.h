#if SINGLE
/* One sample: INPUTS numbers, of which W more may be read; OUTPUTS + CHECKS numbers are written. */
int one(const double *restrict table, const double *restrict in, double *restrict out) {
    if (__builtin_expect(quick(table + QUICK_TABLE, in, out), 1)) return 0;
    int status = judged(out + OUTPUTS);
#if ROBUST
    if (status == AGAIN) {
        robust(table + ROBUST_TABLE, in, out);
        status = judged(out + OUTPUTS);
    }
#endif
    return status;
}
#endif
