/* An FMU's functions of FMI 2.0.4 or 3.0 (FMI is 2 or 3), as sections 2 to 4 of the standards have
 * them.
 *
 * All variables stand in one array, v, by their value references. Before this come MODEL_VALUES,
 * MODEL_STATES and MODEL_DERIVATIVES (where the first of each stands, contiguous), MODEL_ORDER (how
 * many), MODEL_COMPUTED (the first that no one sets), MODEL_STATUS (where the status is shown),
 * MODEL_TOLERANCE (of steps), MODEL_START, MODEL_TOKEN, the type model_constants, and
 *     static void model_prepare(const double *v, model_constants *of)    from parameters,
 *     static int model_evaluate(const model_constants *of, double *v)    everything computed,
 *     static int model_rates(const model_constants *of, double *v)    rates of states alone,
 *     static int model_takes(uint32_t which, double value)    whether a variable can have a value,
 * and where MODEL_DIRECTIONAL is 1 (MODEL_TUNED to MODEL_TUNED_END shape the mechanism)
 *     static int model_differentiate(const model_constants *of, const double *v, double *d).
 * Where MODEL_FACES is not 0 so many faces of contacts lift and land: see fmi_lifting.c; what passes
 * zero at their events stands from MODEL_INDICATORS on.
 * Where MODEL_TICKS is 1 it goes on by ticks alone, every MODEL_PERIOD (MODEL_PERIOD_TEXT) s, and
 * writes the status itself; its constants hold its memory, and there is
 *     static void model_tick(model_constants *of, double *v, double now).
 */

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { SUCCESS, NO_VARIABLE, NO_VALUE };
typedef uint32_t Reference;
typedef const char *Text;

/* What the versions call differently. */
#if FMI == 2
typedef int Boolean;
typedef char Byte;
#define PREFIX fmi2
#define VERSION "2.0"
#define REAL Real
#define FMU_STATE FMUstate
#define UNPACK DeSerialize
#define SETUP SetupExperiment
#define GET_RATES GetDerivatives
#define COUNT /* of values, which FMI 3.0 gives besides that of variables */
#define COUNTED(n) 1
#else
typedef bool Boolean;
typedef uint8_t Byte;
#define PREFIX fmi3
#define VERSION "3.0"
#define REAL Float64
#define FMU_STATE FMUState
#define UNPACK Deserialize
#define SETUP EnterInitializationMode
#define GET_RATES GetContinuousStateDerivatives
#define COUNT , size_t m
#define COUNTED(n) (m == (n))
#endif
#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#define API(name) EXPORT int JOIN(PREFIX, name)
#define REAL_API(way) API(JOIN(way, REAL))
#define STATE_API(before, after) API(JOIN(before, JOIN(FMU_STATE, after)))

static const char *const STATUS_WORDS[] = {
    "ok", "unreachable: no chain or contact reaches this pose",
    "singular: efforts or accelerations are not determined at this pose",
    "out of bounds: a value is no number, or too large for the arithmetic",
    "infeasible", "jammed: no pattern of friction is consistent", "uncertified",
    "gimbal lock: beta is +-90 degrees",
    "ambiguous: several patterns of friction are consistent"
};

/* All that a step changes. */
typedef struct {
    char token[sizeof MODEL_TOKEN];
    double v[MODEL_VALUES], time, step;
    int dirty, unprepared, failed;
    unsigned below, late; /* faces of contacts: not above zero, and those of them that land late */
    model_constants constants;
} State;

#if FMI == 2
typedef struct {
    void (*logger)(void *, Text, int, Text, Text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Host;
#else
typedef struct {
    void (*logger)(void *, int, Text, Text);
    void *environment;
} Host;
#endif

typedef struct {
    State state;
    char name[64];
    Boolean logging;
    Host host;
} Instance;

static int report(Instance *me, int status, Text message)
{
    const Host *host = &me->host;
    if (host->logger && (me->logging || status > DISCARD))
#if FMI == 2
        host->logger(host->environment, me->name, status, "logStatus", "%s", message);
#else
        host->logger(host->environment, status, "logStatus", message);
#endif
    return status;
}

static int answered(Instance *me, int code)
{
    if (code == NO_VARIABLE)
        return report(me, ERROR, "unknown variable, or one that cannot be set");
    return code ? report(me, DISCARD, STATUS_WORDS[me->state.failed]) : OK;
}

static void reset(State *s)
{
    static const double start[MODEL_VALUES] = MODEL_START;
    memset(s, 0, sizeof *s);
    memcpy(s->token, MODEL_TOKEN, sizeof s->token);
    memcpy(s->v, start, sizeof start);
    s->dirty = s->unprepared = 1;
}

static void prepare(State *s)
{
    if (s->unprepared)
        model_prepare(s->v, &s->constants);
    s->unprepared = 0;
}

/* Brings all values up to date; 0, or why they could not be had. */
static int update(State *s)
{
    prepare(s);
    if (s->dirty) {
        s->failed = model_evaluate(&s->constants, s->v);
#if !MODEL_TICKS
        s->v[MODEL_STATUS] = (double)s->failed;
#endif
    }
    s->dirty = 0;
    return s->failed;
}

#if MODEL_ORDER
static int update_at(State *s, const double *x)
{
    memcpy(s->v + MODEL_STATES, x, MODEL_ORDER * sizeof *x);
    s->dirty = 1;
    return update(s) ? NO_VALUE : SUCCESS;
}

/* Rates alone: other values are brought up to date where a step ends. */
static int rates_of(void *of, double t, const double *x, double *rates)
{
    State *s = of;
    memcpy(s->v + MODEL_STATES, x, MODEL_ORDER * sizeof *x);
    if ((s->failed = model_rates(&s->constants, s->v)) != 0)
        return NO_VALUE;
    memcpy(rates, s->v + MODEL_DERIVATIVES, MODEL_ORDER * sizeof *x);
    return SUCCESS;
}

/* A step of h by the pair of Dormand and Prince (1980), with inputs held: from x to y, with its error
 * over MODEL_TOLERANCE (1 + |x|), the worst. */
static int step_of(State *s, double h, const double *x, double *y, double *worst)
{
    static const double A[] = {
        1.0 / 5, 3.0 / 40, 9.0 / 40, 44.0 / 45, -56.0 / 15, 32.0 / 9, 19372.0 / 6561,
        -25360.0 / 2187, 64448.0 / 6561, -212.0 / 729, 9017.0 / 3168, -355.0 / 33, 46732.0 / 5247,
        49.0 / 176, -5103.0 / 18656, 35.0 / 384, 0.0, 500.0 / 1113, 125.0 / 192, -2187.0 / 6784,
        11.0 / 84};
    static const double E[7] = {71.0 / 57600, 0.0, -71.0 / 16695, 71.0 / 1920, -17253.0 / 339200,
                                22.0 / 525, -1.0 / 40};
    double k[7][MODEL_ORDER];
    if (rates_of(s, s->time, x, k[0]) ||
        runge_kutta(A, 6, s->time, h, x, MODEL_ORDER, y, k[0], rates_of, s))
        return NO_VALUE;
    *worst = 0.0;
    for (int i = 0; i < MODEL_ORDER; i++) {
        double error = 0.0;
        for (int j = 0; j < 7; j++)
            error += h * E[j] * k[j][i];
        *worst = fmax(*worst, fabs(error) / (s->v[MODEL_TOLERANCE] * (1.0 + fabs(x[i]))));
    }
    return SUCCESS;
}

#if MODEL_FACES
#define INSTANT 1e-12 /* s: events are located within it */
#define LAST_RISE 1e-9 /* of the mechanism's size: a rebound that would rise less is the last */
#define AT_ONCE 50 /* events with hardly any time between them, after which a run ends */

/* What passes zero at an event of a face, after a step of h from x; y is where that leads. */
static double level_after(State *s, double h, const double *x, double *y, int face, double sign)
{
    double level[MODEL_FACES], rate[MODEL_FACES], worst;
    if (step_of(s, h, x, y, &worst))
        return -1.0;
    memcpy(s->v + MODEL_STATES, y, MODEL_ORDER * sizeof *y);
    return model_levels(&s->constants, s->v, level, rate) ? -1.0 : sign * level[face];
}

/* When a level passes zero within a step of h, or h; it may rise from zero first. */
static double passing(State *s, double h, const double *x, double *y, int face, double sign)
{
    enum { LOOKS = 8 };
    double low = 0.0, high = 0.0, at_low = 0.0, at_high = 0.0;
    for (int i = 1; i <= LOOKS && !(at_high < 0.0); i++) {
        low = high;
        at_low = at_high;
        high = h * i / LOOKS;
        at_high = level_after(s, high, x, y, face, sign);
    }
    if (!(at_high < 0.0))
        return h;
    for (int i = 0; low == 0.0 && i < 40; i++) { /* where it begins above zero, or rises to there */
        const double half = high / 2.0, at_half = level_after(s, half, x, y, face, sign);
        *(at_half < 0.0 ? &high : &low) = half;
        *(at_half < 0.0 ? &at_high : &at_low) = at_half;
    }
    for (int i = 0; i < 100 && high - low > INSTANT; i++) {
        const double secant = low + (high - low) * at_low / (at_low - at_high);
        const double margin = fmin(0.4 * INSTANT, 0.1 * (high - low));
        const double inner = fmin(fmax(secant, low + margin), high - margin);
        const double t = i % 3 == 2 ? (low + high) / 2.0 : inner;
        const double at = level_after(s, t, x, y, face, sign);
        *(at < 0.0 ? &high : &low) = t;
        *(at < 0.0 ? &at_high : &at_low) = at;
    }
    return high;
}

/* The step up to the first event within one of h from x to y, and y there. */
static double until_event(State *s, double h, const double *x, double *y)
{
    double level[2][MODEL_FACES], rate[2][MODEL_FACES], first = h, aside[MODEL_ORDER], worst;
    for (int i = 0; i < 2; i++) {
        memcpy(s->v + MODEL_STATES, i ? y : x, MODEL_ORDER * sizeof *x);
        if (model_levels(&s->constants, s->v, level[i], rate[i]))
            return h;
    }
    for (int i = 0; i < MODEL_FACES; i++) {
        const int indented = level[0][i] < 0.0 || (level[0][i] == 0.0 && rate[0][i] < 0.0);
        const double sign = !MODEL_RIGID && indented ? -1.0 : 1.0; /* it waits for the other way */
        double least = sign * level[1][i], none = -1e-12 * MODEL_LENGTH;
        for (int j = 0; j < MODEL_FACES && is_active(s->v, i); j++)
            none = fmin(none, is_active(s->v, j) ? -1e-9 * fabs(level[1][j]) : none);
        for (int j = 1; j < 8 && !is_active(s->v, i); j++) { /* the cubic of gaps and their rates */
            const double u = j / 8.0, w = 1.0 - u;
            const double cubic = w * w * ((1.0 + 2.0 * u) * level[0][i] + u * h * rate[0][i]) +
                                 u * u * ((1.0 + 2.0 * w) * level[1][i] - w * h * rate[1][i]);
            least = fmin(least, sign * cubic);
        }
        if (least < none)
            first = fmin(first, passing(s, h, x, aside, i, sign));
    }
    if (first < h)
        step_of(s, first, x, y, &worst);
    return first;
}
#endif

static int stopped(State *s, const double *x, int why)
{
    update_at(s, x);
    s->failed = why;
    s->v[MODEL_STATUS] = (double)why;
    return NO_VALUE;
}

/* From now to `end`, with inputs held. */
static int advance(State *s, double end)
{
    const double span = end - s->time;
    double x[MODEL_ORDER], y[MODEL_ORDER];
    double h = s->step > 0.0 && s->step < span ? s->step : span;
    int why = 2; /* steps that shrink without end lead to where rates are infinite */
    prepare(s);
    memcpy(x, s->v + MODEL_STATES, sizeof x);
#if MODEL_FACES
    int at_once = 0, failure = model_settle(&s->constants, s->v, 0, LAST_RISE);
    if (failure)
        return stopped(s, x, failure);
    memcpy(x, s->v + MODEL_STATES, sizeof x);
#endif
    while (s->time < end) {
        double worst;
        int failed;
        if (s->time + h > end || end - s->time - h < 1e-9 * span)
            h = end - s->time;
        failed = step_of(s, h, x, y, &worst);
        if (failed || !(worst <= 1.0)) {
            h *= failed ? 0.25 : fmax(0.2, 0.9 * pow(worst, -0.2));
            why = failed ? s->failed : why;
            if (h < 1e-12 * (1.0 + fabs(s->time)))
                return stopped(s, x, why);
            continue;
        }
        s->step = h * fmin(5.0, 0.9 * pow(fmax(worst, 1e-10), -0.2));
#if MODEL_FACES
        h = until_event(s, h, x, y);
        at_once = h > 100.0 * INSTANT ? 0 : at_once + 1;
        memcpy(s->v + MODEL_STATES, y, sizeof y);
        failure = at_once > AT_ONCE ? 5 : model_settle(&s->constants, s->v, 0, LAST_RISE);
        if (failure)
            return stopped(s, x, failure);
        memcpy(y, s->v + MODEL_STATES, sizeof y);
#endif
        memcpy(x, y, sizeof x);
        s->time = h == end - s->time ? end : s->time + h;
        h = s->step;
    }
    return update_at(s, x);
}
#elif MODEL_TICKS
/* A tick where the step begins; its outputs stay until the next one. */
static int advance(State *s, double end)
{
    update(s);
    model_tick(&s->constants, s->v, s->time);
    s->time = end;
    return SUCCESS;
}
#else
static int advance(State *s, double end)
{
    s->time = end;
    return update(s) ? NO_VALUE : SUCCESS;
}
#endif

static Instance *instantiated(Text name, Text token, Boolean logging, const Host *host)
{
    Instance *me;
    if (!token || strcmp(token, MODEL_TOKEN) || !(me = calloc(1, sizeof *me)))
        return NULL;
    strncpy(me->name, name ? name : "", sizeof me->name - 1);
    me->logging = logging;
    if (host)
        me->host = *host;
    reset(&me->state);
    return me;
}

/* From beginning to end. */
EXPORT Text JOIN(PREFIX, GetVersion)(void) { return VERSION; }
EXPORT void JOIN(PREFIX, FreeInstance)(Instance *me) { free(me); }
API(SETUP)(Instance *me, Boolean defined, double tolerance, double start, Boolean stops,
             double stop)
{
#if MODEL_ORDER
    if (defined && tolerance > 0.0)
        me->state.v[MODEL_TOLERANCE] = tolerance;
#endif
    me->state.time = start;
    return OK;
}
API(SetDebugLogging)(Instance *me, Boolean on, size_t n, const Text *categories)
{
    return me->logging = on, OK;
}
API(Reset)(Instance *me) { return reset(&me->state), OK; }
#define NOTHING(name) API(name)(Instance *me) { return OK; }
NOTHING(EnterEventMode)
/* What an event changes; whether states changed, and when the next event in time is, if there is one. */
static int event(Instance *me, Boolean *changed, Boolean *defined, double *next)
{
#if MODEL_FACES
    State *s = &me->state;
    double before[MODEL_ORDER];
    memcpy(before, s->v + MODEL_STATES, sizeof before);
    prepare(s);
    /* A host's solver sees no bounce that is below its tolerance. */
    const double last = fmax(1e-7, 10.0 * s->v[MODEL_TOLERANCE]);
    if ((s->failed = model_settle(&s->constants, s->v, s->late, last)) != 0)
        return answered(me, NO_VALUE);
    *changed = memcmp(before, s->v + MODEL_STATES, sizeof before) != 0;
    s->below = model_below(&s->constants, s->v, &s->late);
    s->late = 0;
    s->dirty = 1;
    *next = s->time + model_highest(&s->constants, s->v);
    *defined = *next > s->time && *next < HUGE_VAL;
#endif
    return OK;
}
API(ExitInitializationMode)(Instance *me)
{
    Boolean changed, defined;
    double next;
    return event(me, &changed, &defined, &next);
}
NOTHING(EnterContinuousTimeMode)
NOTHING(Terminate)

/* Values. */
REAL_API(Get)(Instance *me, const Reference *which, size_t n, double *values COUNT)
{
    State *s = &me->state;
    if (!COUNTED(n))
        return report(me, ERROR, "expected one value for each variable");
    for (size_t i = 0; i < n; i++) {
        if (which[i] > MODEL_VALUES)
            return answered(me, NO_VARIABLE);
        if (which[i] >= MODEL_COMPUTED && which[i] < MODEL_VALUES && update(s) &&
            which[i] != MODEL_STATUS)
            return answered(me, NO_VALUE);
        values[i] = which[i] == MODEL_VALUES ? s->time : s->v[which[i]];
    }
    return OK;
}
REAL_API(Set)(Instance *me, const Reference *which, size_t n, const double *values COUNT)
{
    State *s = &me->state;
    if (!COUNTED(n))
        return report(me, ERROR, "expected one value for each variable");
    for (size_t i = 0; i < n; i++)
        if (which[i] >= MODEL_COMPUTED)
            return answered(me, NO_VARIABLE);
        else if (!model_takes(which[i], values[i]))
            return report(me, ERROR, "a parameter is out of its range: negative, zero or no number");
    for (size_t i = 0; i < n; i++)
        s->v[which[i]] = values[i];
    s->dirty = s->unprepared = 1;
    return OK;
}

/* Derivatives of unknowns u along a direction in knowns k: inputs, states, and parameters that do
 * not shape the mechanism. */
static int directional(Instance *me, const Reference *u, size_t n, const Reference *k, size_t m,
                       const double *seed, double *result)
{
#if MODEL_DIRECTIONAL
    State *s = &me->state;
    double d[MODEL_VALUES] = {0.0};
    for (size_t i = 0; i < m; i++) {
        if (k[i] >= MODEL_COMPUTED || (k[i] >= MODEL_TUNED && k[i] < MODEL_TUNED_END))
            return report(me, ERROR, "no derivative by this variable");
        d[k[i]] += seed[i];
    }
    for (size_t i = 0; i < n; i++)
        if (u[i] >= MODEL_VALUES)
            return answered(me, NO_VARIABLE);
    if (update(s) || (s->failed = model_differentiate(&s->constants, s->v, d)) != 0)
        return answered(me, NO_VALUE);
    for (size_t i = 0; i < n; i++)
        result[i] = d[u[i]];
    return OK;
#else
    return report(me, ERROR, "this FMU has no derivatives");
#endif
}

/* There are real variables alone. */
#define NONE(name, kind)                                                                            \
    API(Get##name)(Instance *me, const Reference *which, size_t n, kind *values COUNT)              \
    {                                                                                               \
        return n ? answered(me, NO_VARIABLE) : OK;                                                  \
    }                                                                                               \
    API(Set##name)(Instance *me, const Reference *which, size_t n, const kind *values COUNT)        \
    {                                                                                               \
        return n ? answered(me, NO_VARIABLE) : OK;                                                  \
    }
NONE(Boolean, Boolean)
NONE(String, Text)

/* And what there is not. */
#define REFUSED(name, ...)                                                                          \
    API(name)(Instance *me, __VA_ARGS__) { return report(me, ERROR, #name " is not supported"); }

/* States of the whole unit, which are no pointers: as bytes they are the same. */
STATE_API(Get, )(Instance *me, State **state)
{
    if (!*state && !(*state = malloc(sizeof **state)))
        return report(me, ERROR, "out of memory");
    **state = me->state;
    return OK;
}
STATE_API(Set, )(Instance *me, const State *state) { return me->state = *state, OK; }
STATE_API(Free, )(Instance *me, State **state) { return free(*state), *state = NULL, OK; }
STATE_API(Serialized, Size)(Instance *me, const State *state, size_t *size)
{
    return *size = sizeof *state, OK;
}
STATE_API(Serialize, )(Instance *me, const State *state, Byte *bytes, size_t size)
{
    if (size < sizeof *state)
        return report(me, ERROR, "the buffer is too small");
    memcpy(bytes, state, sizeof *state);
    return OK;
}
STATE_API(UNPACK, )(Instance *me, const Byte *bytes, size_t size, State **state)
{
    if (size != sizeof **state || memcmp(bytes, MODEL_TOKEN, sizeof MODEL_TOKEN))
        return report(me, ERROR, "not a state of this FMU");
    if (!*state && !(*state = malloc(sizeof **state)))
        return report(me, ERROR, "out of memory");
    memcpy(*state, bytes, size);
    return OK;
}

/* Model exchange. */
API(CompletedIntegratorStep)(Instance *me, Boolean kept, Boolean *event, Boolean *terminate)
{
    *event = *terminate = 0;
#if MODEL_FACES
    State *s = &me->state;
    unsigned deep;
    prepare(s);
    const unsigned below = model_below(&s->constants, s->v, &deep);
    s->late = deep & s->below; /* no sign changed, of which an event would come */
    s->below = below;
    *event = s->late != 0;
#endif
    return OK;
}
API(SetTime)(Instance *me, double time) { return me->state.time = time, OK; }
API(GetEventIndicators)(Instance *me, double *z, size_t n)
{
    if (n != MODEL_FACES)
        return report(me, ERROR, "wrong number of event indicators");
    if (n && update(&me->state))
        return answered(me, NO_VALUE);
    memcpy(z, me->state.v + MODEL_INDICATORS, n * sizeof *z);
    return OK;
}
#define NUMBER_OF_STATES(n)                                                                         \
    if ((n) != MODEL_ORDER)                                                                         \
        return report(me, ERROR, "wrong number of states");
API(SetContinuousStates)(Instance *me, const double *x, size_t n)
{
    NUMBER_OF_STATES(n)
    memcpy(me->state.v + MODEL_STATES, x, n * sizeof *x);
    me->state.dirty = 1;
    return OK;
}
API(GetContinuousStates)(Instance *me, double *x, size_t n)
{
    NUMBER_OF_STATES(n)
    memcpy(x, me->state.v + MODEL_STATES, n * sizeof *x);
    return OK;
}
API(GET_RATES)(Instance *me, double *rates, size_t n)
{
    NUMBER_OF_STATES(n)
    if (n && update(&me->state))
        return answered(me, NO_VALUE);
    memcpy(rates, me->state.v + MODEL_DERIVATIVES, n * sizeof *rates);
    return OK;
}
API(GetNominalsOfContinuousStates)(Instance *me, double *nominal, size_t n)
{
    for (size_t i = 0; i < n; i++)
        nominal[i] = 1.0;
    return OK;
}

/* Co-simulation. A step begins where the last one ended, but for rounding of the host's sums. */
static int stepped(Instance *me, double now, double span)
{
    if (!(fabs(now - me->state.time) <= 1e-9 * (1.0 + fabs(now)) && span >= 0.0 && span < HUGE_VAL))
        return report(me, ERROR, "a step must start at the time of the FMU and must not be negative");
#if MODEL_TICKS
    if (!(fabs(span - MODEL_PERIOD) <= 1e-9 * (1.0 + fabs(now))))
        return report(me, ERROR, "a step must be one period of the ticks: " MODEL_PERIOD_TEXT " s");
#endif
    me->state.time = now;
    return answered(me, advance(&me->state, now + span));
}

#if FMI == 2
EXPORT Text fmi2GetTypesPlatform(void) { return "default"; }
EXPORT Instance *fmi2Instantiate(Text name, int type, Text guid, Text place, const Host *functions,
                                 Boolean visible, Boolean logging)
{
    return MODEL_TICKS && !type ? NULL : instantiated(name, guid, logging, functions);
}
NOTHING(EnterInitializationMode)
NONE(Integer, int)

typedef struct {
    int needed, terminate, nominals, values, defined;
    double next;
} Events;
API(NewDiscreteStates)(Instance *me, Events *events)
{
    memset(events, 0, sizeof *events);
    return event(me, &events->values, &events->defined, &events->next);
}
API(DoStep)(Instance *me, double now, double span, Boolean kept) { return stepped(me, now, span); }
API(CancelStep)(Instance *me) { return report(me, ERROR, "steps are not asynchronous"); }
#define STATUS(name, kind)                                                                          \
    API(Get##name)(Instance *me, int what, kind *value) { return DISCARD; }
STATUS(Status, int)
STATUS(IntegerStatus, int)
STATUS(BooleanStatus, int)
STATUS(StringStatus, Text)
API(GetRealStatus)(Instance *me, int what, double *value)
{
    if (what != 2) /* the last successful time */
        return DISCARD;
    *value = me->state.time;
    return OK;
}
API(GetDirectionalDerivative)(Instance *me, const Reference *u, size_t n, const Reference *k, size_t m,
                              const double *seed, double *result)
{
    return directional(me, u, n, k, m, seed, result);
}
REFUSED(SetRealInputDerivatives, const Reference *r, size_t n, const int *orders, const double *v)
REFUSED(GetRealOutputDerivatives, const Reference *r, size_t n, const int *orders, double *v)
#else
#define SCHEDULED void (*clock)(void), void (*lock)(void), void (*unlock)(void)
typedef void (*Logger)(void *, int, Text, Text);
EXPORT Instance *fmi3InstantiateModelExchange(Text name, Text token, Text place, Boolean visible,
                                              Boolean logging, void *environment, Logger logger)
{
    const Host host = {logger, environment};
    return MODEL_TICKS ? NULL : instantiated(name, token, logging, &host);
}
EXPORT Instance *fmi3InstantiateCoSimulation(Text name, Text token, Text place, Boolean visible,
                                             Boolean logging, Boolean events, Boolean early,
                                             const Reference *wanted, size_t n, void *environment,
                                             Logger logger, void (*update_)(void))
{
    const Host host = {logger, environment};
    return instantiated(name, token, logging, &host);
}
EXPORT Instance *fmi3InstantiateScheduledExecution(Text name, Text token, Text place,
                                                   Boolean visible, Boolean logging,
                                                   void *environment, Logger logger, SCHEDULED)
{
    return NULL;
}
NOTHING(EnterConfigurationMode)
NOTHING(ExitConfigurationMode)
NOTHING(EvaluateDiscreteStates)
NOTHING(EnterStepMode)
NONE(Float32, float)
NONE(Int8, int8_t)
NONE(UInt8, uint8_t)
NONE(Int16, int16_t)
NONE(UInt16, uint16_t)
NONE(Int32, int32_t)
NONE(UInt32, uint32_t)
NONE(Int64, int64_t)
NONE(UInt64, uint64_t)
API(UpdateDiscreteStates)(Instance *me, Boolean *needed, Boolean *terminate, Boolean *nominals,
                          Boolean *values, Boolean *defined, double *next)
{
    *needed = *terminate = *nominals = *values = *defined = 0;
    return event(me, values, defined, next);
}
#define SIZE_API(name, value)                                                                       \
    API(name)(Instance *me, size_t *n) { return *n = value, OK; }
SIZE_API(GetNumberOfEventIndicators, MODEL_FACES)
SIZE_API(GetNumberOfContinuousStates, MODEL_ORDER)
API(DoStep)(Instance *me, double now, double span, Boolean kept, Boolean *event, Boolean *terminate,
            Boolean *early, double *last)
{
    const int status = stepped(me, now, span);
    *event = *terminate = *early = 0;
    *last = me->state.time;
    return status;
}
#define DERIVATIVE const Reference *u, size_t n, const Reference *k, size_t m, const double *seed
API(GetDirectionalDerivative)(Instance *me, DERIVATIVE, size_t a, double *result, size_t b)
{
    if (a != m || b != n)
        return report(me, ERROR, "expected one value for each variable");
    return directional(me, u, n, k, m, seed, result);
}
REFUSED(GetAdjointDerivative, DERIVATIVE, size_t a, double *result, size_t b)
REFUSED(GetBinary, const Reference *r, size_t n, size_t *sizes, const uint8_t **values, size_t m)
REFUSED(SetBinary, const Reference *r, size_t n, const size_t *sizes, const uint8_t *const *values,
        size_t m)
REFUSED(GetClock, const Reference *r, size_t n, bool *values)
REFUSED(SetClock, const Reference *r, size_t n, const bool *values)
REFUSED(GetNumberOfVariableDependencies, Reference r, size_t *n)
REFUSED(GetVariableDependencies, Reference r, size_t *i, Reference *u, size_t *j, int *kinds, size_t n)
REFUSED(GetIntervalDecimal, const Reference *r, size_t n, double *intervals, int *qualifiers)
REFUSED(GetIntervalFraction, const Reference *r, size_t n, uint64_t *c, uint64_t *d, int *qualifiers)
REFUSED(GetShiftDecimal, const Reference *r, size_t n, double *shifts)
REFUSED(GetShiftFraction, const Reference *r, size_t n, uint64_t *counters, uint64_t *resolutions)
REFUSED(SetIntervalDecimal, const Reference *r, size_t n, const double *intervals)
REFUSED(SetIntervalFraction, const Reference *r, size_t n, const uint64_t *c, const uint64_t *d)
REFUSED(SetShiftDecimal, const Reference *r, size_t n, const double *shifts)
REFUSED(SetShiftFraction, const Reference *r, size_t n, const uint64_t *c, const uint64_t *d)
REFUSED(GetOutputDerivatives, const Reference *r, size_t n, const int32_t *orders, double *v, size_t m)
REFUSED(ActivateModelPartition, Reference clock, double time)
#endif
