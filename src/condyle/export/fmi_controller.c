/* The ticks of a controller as a model of fmi.c. Its memory: settings from parameters; what is
 * followed; efforts that were asked for, of the last ticks, the newest first. */
typedef struct {
    @prefix@_controller controller;
    @prefix@_settings settings;
    @prefix@_reference reference;
    double asked[MODEL_DELAY + 2][N];
    unsigned ticks;
} model_constants;

static const double PATH[@rows@][3 * M + 1] = { /* q, q1, q2 and the force, of every tick */
@path@};

static void model_prepare(const double *v, model_constants *of)
{
    @prefix@_settings *s = &of->settings;
    *s = @PREFIX@_SETTINGS;
@settings@    of->controller.settings = *s;
}

static void measure(const double *v, @prefix@_measured *m)
{
    memset(m, 0, sizeof *m);
@measure@}

/* The reference of this tick: of the path, up to its end, or of the inputs. Returns whether there is
 * one; the last one stays. */
static int refer(model_constants *of, const double *v)
{
    const unsigned rows = sizeof PATH / sizeof *PATH, at = of->ticks < rows ? of->ticks : rows - 1;
    const double *q = v[@follow_path@] != 0.0 ? PATH[at] : v + @q_d@;
    @prefix@_reference r;
    memset(&r, 0, sizeof r);
    if (@prefix@_reference_at(q, q + M, q + 2 * M, q[3 * M], &r) != @PREFIX@_OK) return 0;
    of->reference = r;
    return v[@follow_path@] == 0.0 || of->ticks < rows;
}

/* A state, or what is wanted: -1 for a number that is neither. */
static int chosen(double x)
{
    return x >= @PREFIX@_OFF && x <= @PREFIX@_SAFE_STOP ? (int)x : -1;
}

static void model_tick(model_constants *of, double *v, double now)
{
    @prefix@_controller *c = &of->controller;
    const int host = v[@host_delay@] != 0.0, delay = host > MODEL_DELAY ? host : MODEL_DELAY;
    int wanted = chosen(v[@wanted@]), known;
    @prefix@_measured m;
    double effort[N];
    measure(v, &m);
@acted@    if (of->ticks == 0) {
        const @prefix@_settings settings = of->settings;
        double still[M] = {0.0};
        const int state = chosen(v[@state_start@]);
        @prefix@_begin(c, &settings, v + @q_start@, v + @q1_start@, &m, state, NULL, 0);
        @prefix@_reference_at(v + @q_start@, still, still, 0.0, &of->reference);
    }
    known = refer(of, v);
    if (!known && wanted == @PREFIX@_WANT_RUN) wanted = @PREFIX@_WANT_HOLD;
    @prefix@_step(c, now, &m, wanted, &of->reference, effort);
    memmove(of->asked[1], of->asked[0], sizeof of->asked - sizeof *of->asked);
    for (int i = 0; i < (of->ticks ? 1 : MODEL_DELAY + 2); i++)
        memcpy(of->asked[i], effort, sizeof effort);
    of->ticks += of->ticks < 4000000000u;
    memcpy(v + @effort@, of->asked[delay - host], sizeof effort);
@outputs@}

/* Until the first tick, what it will give: the host's start. */
static int model_evaluate(const model_constants *of, double *v)
{
    model_constants trial = *of;
    if (of->ticks == 0) model_tick(&trial, v, 0.0);
    return 0;
}
