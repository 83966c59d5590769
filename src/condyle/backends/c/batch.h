#define PAST_CACHES 400000 /* doubles */

#if SINGLE
HIDDEN void prepare_quick(const double *par, const double *const *lane, double *table);
#endif
#if ROBUST
HIDDEN void prepare_robust(const double *par, const double *const *lane, double *table);
HIDDEN int robust(const double *restrict table, const double *restrict in, double *restrict out);
#endif

/* What does not change from sample to sample. */
void prepare(const double *par, const double *const *lane, double *table) {
    prepare_step(par, lane, table + STEP_TABLE);
#if SINGLE
    prepare_quick(par, lane, table + QUICK_TABLE);
#endif
#if ROBUST
    prepare_robust(par, lane, table + ROBUST_TABLE);
#endif
}

/* Blocks of W samples, read from columns of any strides, written to columns. A sample that the quick
 * code cannot vouch for is done again, robustly.
 *
 * in:     INPUTS columns;  stride: between the samples of each, in doubles, 0 for a constant.
 * out:    columns of doubles, `columns` apart: the results of `wanted`, `stored` of them; all
 *         OUTPUTS where it is NULL.
 * status: of the checks, or AGAIN. */
void batch_some(const double *restrict table, const double *const *in, const ptrdiff_t *stride,
                size_t count, double *restrict out, size_t columns, uint8_t *restrict status,
                const int *wanted, int stored) {
    double packed[INPUTS + 1][W];
    const double *here[INPUTS + 1];
    vec result[OUTPUTS + CHECKS + 1];
    int dense = 1;
    /* More than caches hold goes past them, where it is aligned: it would only drive out the rest. */
    int past = count * (size_t)stored > PAST_CACHES && columns % W == 0 &&
               (uintptr_t)out % (8 * W) == 0;
    for (int k = 0; k < INPUTS; k++) {
        dense &= stride[k] == 1;
        if (stride[k] == 0 && count > 0)
            for (int i = 0; i < W; i++) packed[k][i] = in[k][0];
    }
    for (size_t start = 0; start < count; start += W) {
        size_t some = count - start < W ? count - start : W;
        size_t at = start;
        const double *const *from = in;
        if (!dense || some < W) {
            for (int k = 0; k < INPUTS; k++) {
                here[k] = packed[k];
                if (stride[k] == 0) continue;
                if (stride[k] == 1 && some == W) {
                    here[k] = in[k] + start;
                    continue;
                }
                for (size_t i = 0; i < W; i++) {
                    size_t sample = start + (i < some ? i : some - 1);
                    packed[k][i] = in[k][(ptrdiff_t)sample * stride[k]];
                }
            }
            from = here, at = 0;
        }
        step(table + STEP_TABLE, from, at, result);
        mask doubt = (mask){};
        for (int i = 0; i < CHECKS; i++) doubt |= ~(result[OUTPUTS + i] >= tolerance[i]);
        for (size_t i = 0; i < some; i++) status[start + i] = 0;
        if (__builtin_expect(any(doubt), 0))
            for (size_t i = 0; i < some; i++) {
                double check[CHECKS + 1];
                if (!doubt[i]) continue;
                for (int k = 0; k < CHECKS; k++) check[k] = result[OUTPUTS + k][i];
                status[start + i] = judged(check);
#if ROBUST
                if (status[start + i] == AGAIN) {
                    double sample[INPUTS + W], again[OUTPUTS + CHECKS];
                    for (int k = 0; k < INPUTS; k++) sample[k] = from[k][at + i];
                    for (int k = 0; k < W; k++) sample[INPUTS + k] = 0;
                    robust(table + ROBUST_TABLE, sample, again);
                    for (int k = 0; k < OUTPUTS; k++) result[k][i] = again[k];
                    status[start + i] = judged(again + OUTPUTS);
                }
#endif
            }
        if (some == W) {
            double *to = out + start;
            if (past) {
                for (int k = 0; k < stored; k++, to += columns)
                    store_past(to, result[wanted ? wanted[k] : k]);
            } else {
                for (int k = 0; k < stored; k++, to += columns)
                    store(to, result[wanted ? wanted[k] : k]);
            }
        } else {
            for (int k = 0; k < stored; k++)
                for (size_t i = 0; i < some; i++)
                    out[(size_t)k * columns + start + i] = result[wanted ? wanted[k] : k][i];
        }
    }
    if (past) fence();
}

/* All results. */
void batch(const double *restrict table, const double *const *in, const ptrdiff_t *stride,
           size_t count, double *restrict out, size_t columns, uint8_t *restrict status) {
    batch_some(table, in, stride, count, out, columns, status, 0, OUTPUTS);
}
