/* The functions of FMI 2.0.4 over fmu_core.c; what they are is from the standard, sections 2 to 4. */

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };
typedef const char *Text;

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;

typedef struct {
    int needed, terminate, nominals, values, defined;
    double next;
} Events;

static int told(Instance *me, int status, const char *message)
{
    const Callbacks *f = me->callbacks;
    if (f && f->logger && (me->logging || status > DISCARD))
        f->logger(f->environment, me->name, status, "logStatus", "%s", message);
    return status;
}

static int answered(Instance *me, int code)
{
    if (code == 1)
        return told(me, ERROR, "there is no such variable");
    return code ? told(me, DISCARD, STATUS_WORDS[me->failed]) : OK;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(Instance *me, int on, size_t n, const char *const *categories)
{
    (void)n, (void)categories;
    me->logging = on;
    return OK;
}

EXPORT Instance *fmi2Instantiate(const char *name, int type, const char *guid, const char *place,
                                 const Callbacks *functions, int visible, int logging)
{
    Instance *me;
    (void)type, (void)place, (void)visible;
    if (!guid || strcmp(guid, MODEL_TOKEN) || !(me = calloc(1, sizeof *me)))
        return NULL;
    strncpy(me->name, name ? name : "", sizeof me->name - 1);
    me->callbacks = functions;
    me->logging = logging;
    instance_reset(me);
    return me;
}

EXPORT void fmi2FreeInstance(Instance *me) { free(me); }

EXPORT int fmi2SetupExperiment(Instance *me, int defined, double tolerance, double start, int stops,
                               double stop)
{
    (void)stops, (void)stop;
#if MODEL_ORDER
    if (defined && tolerance > 0.0)
        me->v[MODEL_TOLERANCE] = tolerance;
#else
    (void)defined, (void)tolerance;
#endif
    me->time = start;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(Instance *me) { return (void)me, OK; }
EXPORT int fmi2ExitInitializationMode(Instance *me) { return (void)me, OK; }
EXPORT int fmi2Terminate(Instance *me) { return (void)me, OK; }
EXPORT int fmi2Reset(Instance *me) { return instance_reset(me), OK; }

EXPORT int fmi2GetReal(Instance *me, const uint32_t *which, size_t n, double *values)
{
    return answered(me, instance_get(me, which, n, values));
}
EXPORT int fmi2SetReal(Instance *me, const uint32_t *which, size_t n, const double *values)
{
    return answered(me, instance_set(me, which, n, values));
}

/* There are real variables alone. */
#define NONE(name, kind)                                                                            \
    EXPORT int fmi2Get##name(Instance *me, const uint32_t *which, size_t n, kind *values)           \
    {                                                                                               \
        return (void)which, (void)values, n ? told(me, ERROR, "there is no such variable") : OK;    \
    }                                                                                               \
    EXPORT int fmi2Set##name(Instance *me, const uint32_t *which, size_t n, const kind *values)     \
    {                                                                                               \
        return (void)which, (void)values, n ? told(me, ERROR, "there is no such variable") : OK;    \
    }
NONE(Integer, int)
NONE(Boolean, int)
NONE(String, Text)

EXPORT int fmi2GetFMUstate(Instance *me, Instance **state)
{
    if (!*state && !(*state = malloc(sizeof **state)))
        return told(me, ERROR, "no memory");
    memcpy(*state, me, sizeof *me);
    return OK;
}
EXPORT int fmi2SetFMUstate(Instance *me, const Instance *state)
{
    const Callbacks *callbacks = me->callbacks;
    const int logging = me->logging;
    memcpy(me, state, sizeof *me);
    me->callbacks = callbacks;
    me->logging = logging;
    return OK;
}
EXPORT int fmi2FreeFMUstate(Instance *me, Instance **state)
{
    (void)me;
    free(*state);
    *state = NULL;
    return OK;
}
EXPORT int fmi2SerializedFMUstateSize(Instance *me, const Instance *state, size_t *size)
{
    (void)me, (void)state;
    *size = sizeof *me;
    return OK;
}
EXPORT int fmi2SerializeFMUstate(Instance *me, const Instance *state, char *bytes, size_t size)
{
    if (size < sizeof *me)
        return told(me, ERROR, "too little room");
    memcpy(bytes, state, sizeof *me);
    return OK;
}
EXPORT int fmi2DeSerializeFMUstate(Instance *me, const char *bytes, size_t size, Instance **state)
{
    if (size != sizeof *me || (!*state && !(*state = malloc(sizeof **state))))
        return told(me, ERROR, "not a state of this FMU");
    memcpy(*state, bytes, size);
    return OK;
}
EXPORT int fmi2GetDirectionalDerivative(Instance *me, const uint32_t *u, size_t n, const uint32_t *k,
                                        size_t m, const double *dk, double *du)
{
    (void)u, (void)n, (void)k, (void)m, (void)dk, (void)du;
    return told(me, ERROR, "no directional derivatives");
}

/* Model exchange. */
EXPORT int fmi2EnterEventMode(Instance *me) { return (void)me, OK; }
EXPORT int fmi2EnterContinuousTimeMode(Instance *me) { return (void)me, OK; }
EXPORT int fmi2NewDiscreteStates(Instance *me, Events *events)
{
    (void)me;
    memset(events, 0, sizeof *events);
    return OK;
}
EXPORT int fmi2CompletedIntegratorStep(Instance *me, int kept, int *event, int *terminate)
{
    (void)me, (void)kept;
    *event = *terminate = 0;
    return OK;
}
EXPORT int fmi2SetTime(Instance *me, double time)
{
    me->time = time;
    return OK;
}
EXPORT int fmi2GetEventIndicators(Instance *me, double *z, size_t n)
{
    return (void)z, n ? told(me, ERROR, "there are no event indicators") : OK;
}
#if MODEL_ORDER
EXPORT int fmi2SetContinuousStates(Instance *me, const double *x, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    memcpy(me->v + MODEL_STATES, x, n * sizeof *x);
    me->dirty = 1;
    return OK;
}
EXPORT int fmi2GetContinuousStates(Instance *me, double *x, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    memcpy(x, me->v + MODEL_STATES, n * sizeof *x);
    return OK;
}
EXPORT int fmi2GetDerivatives(Instance *me, double *rates, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    if (instance_update(me))
        return answered(me, 2);
    memcpy(rates, me->v + MODEL_DERIVATIVES, n * sizeof *rates);
    return OK;
}
#else
EXPORT int fmi2SetContinuousStates(Instance *me, const double *x, size_t n)
{
    return (void)x, n ? told(me, ERROR, "there are no states") : OK;
}
EXPORT int fmi2GetContinuousStates(Instance *me, double *x, size_t n)
{
    return (void)x, n ? told(me, ERROR, "there are no states") : OK;
}
EXPORT int fmi2GetDerivatives(Instance *me, double *rates, size_t n)
{
    return (void)rates, n ? told(me, ERROR, "there are no states") : OK;
}
#endif
EXPORT int fmi2GetNominalsOfContinuousStates(Instance *me, double *nominal, size_t n)
{
    (void)me;
    for (size_t i = 0; i < n; i++)
        nominal[i] = 1.0;
    return OK;
}

/* Co-simulation. */
EXPORT int fmi2SetRealInputDerivatives(Instance *me, const uint32_t *which, size_t n,
                                       const int *order, const double *values)
{
    (void)which, (void)n, (void)order, (void)values;
    return told(me, ERROR, "inputs are held during a step");
}
EXPORT int fmi2GetRealOutputDerivatives(Instance *me, const uint32_t *which, size_t n,
                                        const int *order, double *values)
{
    (void)which, (void)n, (void)order, (void)values;
    return told(me, ERROR, "no derivatives of outputs");
}
EXPORT int fmi2DoStep(Instance *me, double now, double span, int kept)
{
    (void)kept;
    me->time = now;
    return answered(me, instance_advance(me, now + span) ? 2 : 0);
}
EXPORT int fmi2CancelStep(Instance *me) { return told(me, ERROR, "steps are not asynchronous"); }
#define STATUS(name, kind)                                                                          \
    EXPORT int fmi2Get##name(Instance *me, int what, kind *value)                                   \
    {                                                                                               \
        return (void)me, (void)what, (void)value, DISCARD;                                          \
    }
STATUS(Status, int)
STATUS(IntegerStatus, int)
STATUS(BooleanStatus, int)
STATUS(StringStatus, const char *)
EXPORT int fmi2GetRealStatus(Instance *me, int what, double *value)
{
    if (what != 2) /* the last successful time */
        return DISCARD;
    *value = me->time;
    return OK;
}
