/* What an FMU does, whatever the version of the interface: values, states, and steps in time.
 *
 * All variables stand in one array, v, by their value references. Before this come MODEL_VALUES,
 * MODEL_STATES and MODEL_DERIVATIVES (where the first of each stands, contiguous), MODEL_ORDER (how
 * many), MODEL_STATUS (where the status is shown), MODEL_TOLERANCE (of steps), MODEL_START, and
 *     static int model_prepare(Instance *me)    after parameters have changed,
 *     static int model_evaluate(Instance *me)   everything from inputs, parameters and states.
 */

typedef void (*Told)(void *teller, int status, const char *message);

static const char *const STATUS_WORDS[] = {
    "ok", "unreachable: no chain or contact reaches this pose",
    "singular: efforts or accelerations are not determined at this pose",
    "out of bounds: a value is no number, or too large for the arithmetic",
    "infeasible", "jammed: no pattern of friction is consistent", "uncertified"
};

static void instance_reset(Instance *me)
{
    static const double start[MODEL_VALUES] = MODEL_START;
    memcpy(me->v, start, sizeof start);
    me->time = 0.0;
    me->dirty = 1;
    me->unprepared = 1;
    me->failed = 0;
}

/* Brings all values up to date; 0, or why they could not be had. */
static int instance_update(Instance *me)
{
    if (me->unprepared) {
        model_prepare(me);
        me->unprepared = 0;
    }
    if (me->dirty) {
        me->failed = model_evaluate(me);
        me->v[MODEL_STATUS] = (double)me->failed;
        me->dirty = 0;
    }
    return me->failed;
}

static int instance_set(Instance *me, const uint32_t *which, size_t count, const double *values)
{
    for (size_t i = 0; i < count; i++) {
        if (which[i] >= MODEL_VALUES)
            return 1;
        me->v[which[i]] = values[i];
    }
    me->dirty = 1;
    me->unprepared = 1;
    return 0;
}

/* 0; 1 where there is no such variable; 2 where a value cannot be computed. */
static int instance_get(Instance *me, const uint32_t *which, size_t count, double *values)
{
    for (size_t i = 0; i < count; i++) {
        if (which[i] == MODEL_VALUES) {
            values[i] = me->time;
            continue;
        }
        if (which[i] > MODEL_VALUES)
            return 1;
        if (which[i] >= MODEL_COMPUTED && instance_update(me) && which[i] != MODEL_STATUS)
            return 2;
        values[i] = me->v[which[i]];
    }
    return 0;
}

#if MODEL_ORDER
static int instance_rates(Instance *me, const double *x, double *rates)
{
    memcpy(me->v + MODEL_STATES, x, MODEL_ORDER * sizeof *x);
    me->dirty = 1;
    if (instance_update(me))
        return 1;
    memcpy(rates, me->v + MODEL_DERIVATIVES, MODEL_ORDER * sizeof *x);
    return 0;
}

/* From now to `end` by the pair of Dormand and Prince (1980), with inputs held: error by step below
 * MODEL_TOLERANCE (1 + |x|). 0, or 1 where the motion cannot go on. */
static int instance_advance(Instance *me, double end)
{
    static const double A[6][6] = {
        {1.0 / 5}, {3.0 / 40, 9.0 / 40}, {44.0 / 45, -56.0 / 15, 32.0 / 9},
        {19372.0 / 6561, -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729},
        {9017.0 / 3168, -355.0 / 33, 46732.0 / 5247, 49.0 / 176, -5103.0 / 18656},
        {35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784, 11.0 / 84}};
    static const double E[7] = {71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200,
                                22.0 / 525, -1.0 / 40};
    const double span = end - me->time;
    double x[MODEL_ORDER], y[MODEL_ORDER], k[7][MODEL_ORDER];
    double h = me->step > 0.0 && me->step < span ? me->step : span;
    int why = 2; /* steps that shrink without end lead to where rates are infinite */
    memcpy(x, me->v + MODEL_STATES, sizeof x);
    if (!(span > 0.0))
        return instance_rates(me, x, k[0]);
    while (me->time < end) {
        double worst = 0.0;
        int failed;
        if (me->time + h > end || end - me->time - h < 1e-9 * span)
            h = end - me->time;
        failed = instance_rates(me, x, k[0]);
        for (int s = 0; s < 6 && !failed; s++) {
            for (int i = 0; i < MODEL_ORDER; i++) {
                y[i] = x[i];
                for (int j = 0; j <= s; j++)
                    y[i] += h * A[s][j] * k[j][i];
            }
            failed = instance_rates(me, y, k[s + 1]);
        }
        for (int i = 0; i < MODEL_ORDER && !failed; i++) {
            double error = 0.0;
            for (int j = 0; j < 7; j++)
                error += h * E[j] * k[j][i];
            worst = fmax(worst, fabs(error) / (me->v[MODEL_TOLERANCE] * (1.0 + fabs(x[i]))));
        }
        if (failed || !(worst <= 1.0)) {
            h *= failed ? 0.25 : fmax(0.2, 0.9 * pow(worst, -0.2));
            why = failed ? me->failed : why;
            if (h < 1e-12 * (1.0 + fabs(me->time))) {
                instance_rates(me, x, k[0]);
                me->failed = why;
                me->v[MODEL_STATUS] = (double)why;
                return 1;
            }
            continue;
        }
        memcpy(x, y, sizeof x);
        me->time = h == end - me->time ? end : me->time + h;
        me->step = h * fmin(5.0, 0.9 * pow(fmax(worst, 1e-10), -0.2));
        h = me->step;
    }
    return instance_rates(me, x, k[0]);
}
#else
static int instance_advance(Instance *me, double end)
{
    me->time = end;
    return instance_update(me);
}
#endif
