/* What a kernel exports. The quick torques come from normal equations; a sample for which those
 * lose digits is done again, carefully. */

void prepare(const double *par, const double *const *lane, double *table) {
    prepare_quick(par, lane, table + QUICK_TABLE);
    prepare_step(par, lane, table + STEP_TABLE);
#if CAREFUL
    prepare_careful(par, lane, table + CAREFUL_TABLE);
#endif
}

void one(const double *restrict table, const double *restrict in, double *restrict out) {
    quick(table + QUICK_TABLE, in, out);
#if CAREFUL
    if (__builtin_expect(!(out[QUALITY] >= 0), 0)) careful(table + CAREFUL_TABLE, in, out);
#endif
}

/* Blocks of W samples, read from columns of any stride, written to columns.
 *
 * in:     INPUTS columns with a common stride between samples.
 * out:    OUTPUTS columns of doubles, `columns` apart.
 * status: 0 ok, 1 unreachable, 2 to be looked at again (near a singularity). */
void batch(const double *restrict table, const double *const *in, ptrdiff_t stride, size_t count,
           double *restrict out, size_t columns, uint8_t *restrict status) {
    double packed[INPUTS][W];
    const double *here[INPUTS];
    vec result[OUTPUTS];
    for (size_t start = 0; start < count; start += W) {
        size_t some = count - start < W ? count - start : W;
        size_t at = start;
        const double *const *from = in;
        if (stride != 1 || some < W) {
            for (int k = 0; k < INPUTS; k++) {
                for (size_t i = 0; i < W; i++) {
                    size_t sample = start + (i < some ? i : some - 1);
                    packed[k][i] = in[k][(ptrdiff_t)sample * stride];
                }
                here[k] = packed[k];
            }
            from = here, at = 0;
        }
        step(table + STEP_TABLE, from, at, result);
#if CAREFUL
        if (__builtin_expect(any(~(result[QUALITY] >= 0)), 0))
            for (size_t i = 0; i < some; i++) {
                double sample[INPUTS], again[OUTPUTS];
                if (result[QUALITY][i] >= 0) continue;
                for (int k = 0; k < INPUTS; k++) sample[k] = from[k][at + i];
                careful(table + CAREFUL_TABLE, sample, again);
                for (int k = 0; k < OUTPUTS; k++) result[k][i] = again[k];
            }
#endif
        if (some == W) {
            for (int k = 0; k < OUTPUTS; k++)
                store(out + (size_t)k * columns + start, result[k]);
        } else {
            for (int k = 0; k < OUTPUTS; k++)
                for (size_t i = 0; i < some; i++)
                    out[(size_t)k * columns + start + i] = result[k][i];
        }
        for (size_t i = 0; i < some; i++) {
            double margin = result[MARGIN][i], quality = result[QUALITY][i];
            status[start + i] = margin < 0 ? 1 : margin >= NEAR && quality >= NEAR ? 0 : 2;
        }
    }
}
