/* Runs with fixed steps, one or a crowd of them in lockstep: plant and controller are two kernels,
 * given by address, and what either means is not known here.
 *
 * All rows are of `stride` numbers, one a run. The struct `Run` stands before this text, written from
 * the table that lays it out for Python.
 *
 * What is rare is left to the caller, who goes on from there: steps in which a guard changes its
 * sign or a contact may land, states that a kernel cannot vouch for. `gone` says in which runs. */

enum { DONE, PAUSE, STEP, SAMPLE }; /* why `advance` returns; PAUSE: after `budget` steps */
#define ROUNDING 1e-12            /* seconds */

/* How many of rising times are at or before t. */
static int64_t passed_by(const double *times, int64_t count, double t)
{
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (times[middle] <= t) low = middle + 1;
        else high = middle;
    }
    return low;
}

static void copied(const Run *r, const Copy *row, int64_t rows)
{
    for (const Copy *end = row + rows; row < end; row++)
        memcpy(row->to, row->from, (size_t)r->stride * sizeof *row->to);
}

/* What tables say at t, linear between their rows; outside they stay, or are zero. */
static void feed(const Run *r, double t)
{
    for (const Table *f = r->table; f < r->table + r->tables; f++) {
        int64_t after = passed_by(f->times, f->count, t), before = after > 0 ? after - 1 : 0;
        int none = f->vanishes && (after == 0 || t > f->times[f->count - 1]);
        if (after == f->count) after = f->count - 1;
        if (f->vanishes && after == before && after > 0) before--;
        double width = f->times[after] - f->times[before];
        double part = width > 0 ? (t - f->times[before]) / width : 0;
        const double *a = f->rows + before * f->width * f->lanes;
        const double *b = f->rows + after * f->width * f->lanes;
        for (int64_t i = 0; i < f->width; i++)
            for (int64_t v = 0; v < r->runs; v++) {
                int64_t at = i * f->lanes + (f->lanes > 1 ? v : 0);
                f->to[i * r->stride + v] = none ? 0 : a[at] + part * (b[at] - a[at]);
            }
    }
}

/* Whether any run is gone: a kernel cannot vouch for it. */
static int evaluate(Run *r, const Kernel *k)
{
    int any = 0;
    if (r->runs == 1) return r->gone[0] = k->one(k->table, k->given, k->found) != 0;
    k->batch(k->table, k->from, k->strides, (size_t)r->runs, k->found, (size_t)r->stride, r->status);
    for (int64_t v = 0; v < r->runs; v++) any |= r->gone[v] = r->status[v] && r->alive[v];
    return any;
}

static int rates(void *of, double t, const double *y, double *f)
{
    Run *r = of;
    feed(r, fabs(t - r->until) < ROUNDING ? r->until : t);
    memcpy(r->plant.given, y, (size_t)(r->inputs * r->stride) * sizeof *y);
    if (evaluate(r, &r->plant)) return STEP;
    memcpy(f, r->plant.found, (size_t)(r->size * r->stride) * sizeof *y);
    return 0;
}

/* Whether a guard is on the other side of zero than it was, at the last rates, which are those at t.
 * One that chatters is counted instead. */
static int guarded(Run *r, double t)
{
    int any = 0;
    for (int64_t g = 0; g < r->guards; g++) {
        const double *value = r->plant.found + r->guard[g] * r->stride, *met = r->met + g * r->runs;
        const uint8_t *past = r->past + g * r->runs;
        for (int64_t v = 0; v < r->runs; v++) {
            if ((value[v] > 0) == past[v] || !r->alive[v]) continue;
            if (!r->limit[g] || (!past[v] && t - met[v] >= CHATTER)) any = r->gone[v] = 1;
        }
    }
    for (int64_t g = 0; g < r->guards && !any; g++) {
        const double *value = r->plant.found + r->guard[g] * r->stride;
        for (int64_t v = 0, i = g * r->runs; v < r->runs && r->limit[g]; v++, i++) {
            if (!r->alive[v]) continue;
            if (value[v] > 0 && !r->past[i]) r->again[i]++, r->met[i] = t;
            r->past[i] = value[v] > 0;
        }
    }
    return any;
}

/* The controller samples: 0, or SAMPLE where the caller has to. */
static int sample(Run *r)
{
    int64_t stride = r->stride, k = r->clock->tick + 1, due = k > r->delay ? k - r->delay : 0;
    double *kept = r->samples + k * r->results * stride;
    if (!r->clock->current && rates(r, r->clock->t, r->y, r->k)) return SAMPLE;
    r->clock->current = 1;
    memcpy(r->reference, r->references + k * r->reference_rows * stride, (size_t)(r->reference_rows * stride) * sizeof *kept);
    copied(r, r->link, r->links);
    if (evaluate(r, &r->control)) return SAMPLE;
    memcpy(kept, r->control.found, (size_t)(r->results * stride) * sizeof *kept);
    for (int64_t i = 0; i < r->seen; i++)
        memcpy(r->states + (k * r->seen + i) * stride, r->y + r->seen_row[i] * stride,
               (size_t)stride * sizeof *kept);
    copied(r, r->carry, r->carried);
    for (int64_t i = 0; i < r->efforts; i++)
        memcpy(r->effort + i * stride, r->samples + (due * r->results + r->effort_row[i]) * stride,
               (size_t)stride * sizeof *kept);
    r->clock->tick = k;
    return 0;
}

/* Positions and rates of y, at which the plant was evaluated, with active contacts closed; f: of it. */
static int closed(Run *r, double t, double *y, double *f)
{
    const Lifting *l = r->lifting;
    int64_t c = l->faces;
    for (int turn = 0; turn < PROJECTIONS; turn++) {
        double R[FACES * FACES], A[FACES * FACES], off[2][FACES], worst = 0;
        int on[FACES], n = 0;
        for (int i = 0; i < c; i++)
            if (l->active[i] > 0) on[n++] = i;
        for (int i = 0; i < n; i++) {
            off[0][i] = l->gap[on[i]], off[1][i] = l->gap_rate[on[i]];
            worst = fmax(worst, fmax(fabs(off[0][i]), fabs(off[1][i])));
            for (int j = 0; j < n; j++) R[i * n + j] = l->gap_response[on[i] * c + on[j]];
        }
        if (worst <= l->projected) return 0;
        for (int order = 0; order < 2; order++) {
            memcpy(A, R, (size_t)(n * n) * sizeof *A);
            if (!eliminated(A, off[order], n)) return STEP;
            for (int64_t k = 0; k < l->freedoms; k++)
                for (int i = 0; i < n; i++)
                    y[order * l->freedoms + k] -= l->q_response[k * c + on[i]] * off[order][i];
        }
        if (rates(r, t, y, f)) return STEP;
    }
    return 0;
}

/* Gaps and their rates where the plant was evaluated. */
static void gaps(const Run *r, double *gap, double *gap_rate)
{
    if (!r->lifting) return;
    memcpy(gap, r->lifting->gap, (size_t)r->lifting->faces * sizeof *gap);
    memcpy(gap_rate, r->lifting->gap_rate, (size_t)r->lifting->faces * sizeof *gap);
}

/* Whether an open contact, where the plant was evaluated, touches and does not leave. */
static int touches(const Run *r)
{
    const Lifting *l = r->lifting;
    for (int64_t i = 0; l && i < l->faces; i++)
        if (!(l->active[i] > 0) && l->gap[i] <= l->touching && fabs(l->gap_rate[i]) <= l->still) return 1;
    return 0;
}

/* Whether an open contact may land within a step h, at whose end the plant was evaluated. */
static int lands(const Run *r, double h, const double *gap, const double *gap_rate)
{
    const Lifting *l = r->lifting;
    for (int64_t i = 0; l && i < l->faces; i++) {
        double way = LANDING * h * fmax(fabs(gap_rate[i]), fabs(l->gap_rate[i]));
        if (!(l->active[i] > 0) && !(fmin(gap[i], l->gap[i]) > way)) return 1;
    }
    return 0;
}

/* States at the results' times before `end`, by the cubic with these values and rates: 0, or STEP. */
static int keep(Run *r, double t, double h, double end, const double *y0, const double *f0,
                const double *y1, const double *f1)
{
    int64_t n = r->size * r->stride;
    for (; r->clock->next < r->count && r->times[r->clock->next] < end - ROUNDING; r->clock->next++) {
        double now = fmax(r->times[r->clock->next], t), s = (now - t) / h;
        double a = s * s * (3 - 2 * s), b = h * s * (1 - s);
        double *state = r->kept + r->clock->next * n, *spare = r->k + n;
        for (int64_t i = 0; i < n; i++)
            state[i] = y0[i] + a * (y1[i] - y0[i]) + b * ((1 - s) * f0[i] - s * f1[i]);
        if (!r->lifting) continue;
        r->clock->current = 0;
        if (rates(r, now, state, spare) || closed(r, now, state, spare)) return STEP;
    }
    return 0;
}

/* Equal steps to `until`. */
static int between(Run *r, double until)
{
    int64_t n = r->size * r->stride, steps = (int64_t)fmax(ceil((until - r->clock->t) / r->step - 1e-9), 1);
    double start = r->clock->t, h = (until - start) / (double)steps, *f1 = r->k + r->stages * n;
    double gap[FACES], gap_rate[FACES];
    r->until = until, r->clock->current = 0;
    if (rates(r, start, r->y, r->k) || guarded(r, start) || touches(r)) return STEP;
    gaps(r, gap, gap_rate);
    for (int64_t k = 0; k < steps; k++) {
        double t0 = start + (double)k * h, t1 = k + 1 < steps ? start + (double)(k + 1) * h : until;
        r->clock->current = 0;
        if (r->budget-- <= 0) return PAUSE;
        if (runge_kutta(r->method, (int)r->stages, t0, h, r->y, (int)n, r->y1, r->k, rates, r) ||
            (r->lifting && closed(r, t1, r->y1, f1)) || lands(r, h, gap, gap_rate) || guarded(r, t1))
            return STEP;
        gaps(r, gap, gap_rate);
        r->clock->current = 1;
        if (keep(r, t0, h, t1, r->y, r->k, r->y1, f1)) return STEP;
        memcpy(r->y, r->y1, (size_t)n * sizeof *f1);
        memcpy(r->k, f1, (size_t)n * sizeof *f1);
        r->clock->t = t1;
    }
    return 0;
}

/* From where the runs are to their end, or to what the caller has to see to. */
int advance(Run *r)
{
    for (; r->clock->breakpoint + 1 < r->breakpoints; r->clock->breakpoint++, r->clock->fresh = 1) {
        int code;
        if (r->clock->fresh) {
            r->clock->t = r->breakpoint_time[r->clock->breakpoint];
            if (r->is_tick[r->clock->breakpoint] && (code = sample(r))) return code;
            r->clock->fresh = 0;
        }
        if ((code = between(r, r->breakpoint_time[r->clock->breakpoint + 1]))) return code;
    }
    return DONE;
}
