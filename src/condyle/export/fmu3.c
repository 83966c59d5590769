/* The functions of FMI 3.0 over fmu_core.c; what they are is from the standard, sections 2 to 4. */

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
typedef uint32_t Reference;
typedef const char *Text;
typedef void (*Logger)(void *, int, const char *, const char *);

static int told(Instance *me, int status, const char *message)
{
    Logger logger;
    memcpy(&logger, &me->logger, sizeof logger);
    if (logger && (me->logging || status > DISCARD))
        logger(me->environment, status, "logStatus", message);
    return status;
}

static int answered(Instance *me, int code)
{
    if (code == 1)
        return told(me, ERROR, "there is no such variable");
    return code ? told(me, DISCARD, STATUS_WORDS[me->failed]) : OK;
}

static Instance *instantiated(const char *name, const char *token, bool logging, void *environment,
                              Logger logger)
{
    Instance *me;
    if (!token || strcmp(token, MODEL_TOKEN) || !(me = calloc(1, sizeof *me)))
        return NULL;
    strncpy(me->name, name ? name : "", sizeof me->name - 1);
    me->logging = logging;
    me->environment = environment;
    memcpy(&me->logger, &logger, sizeof logger);
    instance_reset(me);
    return me;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3SetDebugLogging(Instance *me, bool on, size_t n, const char *const *categories)
{
    (void)n, (void)categories;
    me->logging = on;
    return OK;
}

EXPORT Instance *fmi3InstantiateModelExchange(const char *name, const char *token, const char *place,
                                              bool visible, bool logging, void *environment,
                                              Logger logger)
{
    (void)place, (void)visible;
    return instantiated(name, token, logging, environment, logger);
}

EXPORT Instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *place,
                                             bool visible, bool logging, bool events, bool early,
                                             const Reference *wanted, size_t n, void *environment,
                                             Logger logger, void (*update)(void))
{
    (void)place, (void)visible, (void)events, (void)early, (void)wanted, (void)n, (void)update;
    return instantiated(name, token, logging, environment, logger);
}

EXPORT Instance *fmi3InstantiateScheduledExecution(const char *name, const char *token,
                                                   const char *place, bool visible, bool logging,
                                                   void *environment, Logger logger,
                                                   void (*clock)(void), void (*lock)(void),
                                                   void (*unlock)(void))
{
    (void)name, (void)token, (void)place, (void)visible, (void)logging, (void)environment;
    (void)logger, (void)clock, (void)lock, (void)unlock;
    return NULL;
}

EXPORT void fmi3FreeInstance(Instance *me) { free(me); }

EXPORT int fmi3EnterInitializationMode(Instance *me, bool defined, double tolerance, double start,
                                       bool stops, double stop)
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

#define NOTHING(name) EXPORT int fmi3##name(Instance *me) { return (void)me, OK; }
NOTHING(ExitInitializationMode)
NOTHING(EnterEventMode)
NOTHING(Terminate)
NOTHING(EnterConfigurationMode)
NOTHING(ExitConfigurationMode)
NOTHING(EvaluateDiscreteStates)
NOTHING(EnterContinuousTimeMode)
NOTHING(EnterStepMode)
EXPORT int fmi3Reset(Instance *me) { return instance_reset(me), OK; }

EXPORT int fmi3GetFloat64(Instance *me, const Reference *which, size_t n, double *values, size_t m)
{
    if (m != n)
        return told(me, ERROR, "as many values as variables: all are scalar");
    return answered(me, instance_get(me, which, n, values));
}
EXPORT int fmi3SetFloat64(Instance *me, const Reference *which, size_t n, const double *values,
                          size_t m)
{
    if (m != n)
        return told(me, ERROR, "as many values as variables: all are scalar");
    return answered(me, instance_set(me, which, n, values));
}

/* There are variables of type Float64 alone. */
#define NONE(name, kind)                                                                            \
    EXPORT int fmi3Get##name(Instance *me, const Reference *which, size_t n, kind *values, size_t m) \
    {                                                                                               \
        (void)which, (void)values, (void)m;                                                         \
        return n ? told(me, ERROR, "there is no such variable") : OK;                               \
    }                                                                                               \
    EXPORT int fmi3Set##name(Instance *me, const Reference *which, size_t n, const kind *values,    \
                             size_t m)                                                              \
    {                                                                                               \
        (void)which, (void)values, (void)m;                                                         \
        return n ? told(me, ERROR, "there is no such variable") : OK;                               \
    }
NONE(Float32, float)
NONE(Int8, int8_t)
NONE(UInt8, uint8_t)
NONE(Int16, int16_t)
NONE(UInt16, uint16_t)
NONE(Int32, int32_t)
NONE(UInt32, uint32_t)
NONE(Int64, int64_t)
NONE(UInt64, uint64_t)
NONE(Boolean, bool)
NONE(String, Text)

/* And what there is not: clocks, binaries, variable structure, derivatives by direction. */
#define REFUSED(name, ...)                                                                          \
    EXPORT int fmi3##name(Instance *me, __VA_ARGS__)                                                \
    {                                                                                               \
        return told(me, ERROR, "fmi3" #name " is not supported");                                   \
    }
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
REFUSED(GetBinary, const Reference *r, size_t n, size_t *sizes, const uint8_t **values, size_t m)
REFUSED(SetBinary, const Reference *r, size_t n, const size_t *sizes, const uint8_t *const *values,
        size_t m)
REFUSED(GetClock, const Reference *r, size_t n, bool *values)
REFUSED(SetClock, const Reference *r, size_t n, const bool *values)
REFUSED(GetNumberOfVariableDependencies, Reference r, size_t *n)
REFUSED(GetVariableDependencies, Reference r, size_t *i, Reference *u, size_t *j, int *kinds, size_t n)
REFUSED(GetDirectionalDerivative, const Reference *u, size_t n, const Reference *k, size_t m,
        const double *seed, size_t a, double *result, size_t b)
REFUSED(GetAdjointDerivative, const Reference *u, size_t n, const Reference *k, size_t m,
        const double *seed, size_t a, double *result, size_t b)
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
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

EXPORT int fmi3GetFMUState(Instance *me, Instance **state)
{
    if (!*state && !(*state = malloc(sizeof **state)))
        return told(me, ERROR, "no memory");
    memcpy(*state, me, sizeof *me);
    return OK;
}
EXPORT int fmi3SetFMUState(Instance *me, const Instance *state)
{
    const Instance kept = *me;
    memcpy(me, state, sizeof *me);
    me->logger = kept.logger;
    me->environment = kept.environment;
    me->logging = kept.logging;
    return OK;
}
EXPORT int fmi3FreeFMUState(Instance *me, Instance **state)
{
    (void)me;
    free(*state);
    *state = NULL;
    return OK;
}
EXPORT int fmi3SerializedFMUStateSize(Instance *me, const Instance *state, size_t *size)
{
    (void)me, (void)state;
    *size = sizeof *me;
    return OK;
}
EXPORT int fmi3SerializeFMUState(Instance *me, const Instance *state, uint8_t *bytes, size_t size)
{
    if (size < sizeof *me)
        return told(me, ERROR, "too little room");
    memcpy(bytes, state, sizeof *me);
    return OK;
}
EXPORT int fmi3DeserializeFMUState(Instance *me, const uint8_t *bytes, size_t size, Instance **state)
{
    if (size != sizeof *me || (!*state && !(*state = malloc(sizeof **state))))
        return told(me, ERROR, "not a state of this FMU");
    memcpy(*state, bytes, size);
    return OK;
}

EXPORT int fmi3UpdateDiscreteStates(Instance *me, bool *needed, bool *terminate, bool *nominals,
                                    bool *values, bool *defined, double *next)
{
    (void)me, (void)next;
    *needed = *terminate = *nominals = *values = *defined = false;
    return OK;
}

/* Model exchange. */
EXPORT int fmi3CompletedIntegratorStep(Instance *me, bool kept, bool *event, bool *terminate)
{
    (void)me, (void)kept;
    *event = *terminate = false;
    return OK;
}
EXPORT int fmi3SetTime(Instance *me, double time)
{
    me->time = time;
    return OK;
}
EXPORT int fmi3GetEventIndicators(Instance *me, double *z, size_t n)
{
    return (void)z, n ? told(me, ERROR, "there are no event indicators") : OK;
}
EXPORT int fmi3GetNumberOfEventIndicators(Instance *me, size_t *n)
{
    (void)me;
    *n = 0;
    return OK;
}
EXPORT int fmi3GetNumberOfContinuousStates(Instance *me, size_t *n)
{
    (void)me;
    *n = MODEL_ORDER;
    return OK;
}
#if MODEL_ORDER
EXPORT int fmi3SetContinuousStates(Instance *me, const double *x, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    memcpy(me->v + MODEL_STATES, x, n * sizeof *x);
    me->dirty = 1;
    return OK;
}
EXPORT int fmi3GetContinuousStates(Instance *me, double *x, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    memcpy(x, me->v + MODEL_STATES, n * sizeof *x);
    return OK;
}
EXPORT int fmi3GetContinuousStateDerivatives(Instance *me, double *rates, size_t n)
{
    if (n != MODEL_ORDER)
        return told(me, ERROR, "that is not the number of states");
    if (instance_update(me))
        return answered(me, 2);
    memcpy(rates, me->v + MODEL_DERIVATIVES, n * sizeof *rates);
    return OK;
}
#else
#define STATELESS(name, kind)                                                                       \
    EXPORT int fmi3##name(Instance *me, kind *x, size_t n)                                          \
    {                                                                                               \
        return (void)x, n ? told(me, ERROR, "there are no states") : OK;                            \
    }
STATELESS(SetContinuousStates, const double)
STATELESS(GetContinuousStates, double)
STATELESS(GetContinuousStateDerivatives, double)
#endif
EXPORT int fmi3GetNominalsOfContinuousStates(Instance *me, double *nominal, size_t n)
{
    (void)me;
    for (size_t i = 0; i < n; i++)
        nominal[i] = 1.0;
    return OK;
}

/* Co-simulation. */
EXPORT int fmi3DoStep(Instance *me, double now, double span, bool kept, bool *event, bool *terminate,
                      bool *early, double *last)
{
    int failed;
    (void)kept;
    me->time = now;
    failed = instance_advance(me, now + span);
    *event = *terminate = *early = false;
    *last = me->time;
    return answered(me, failed ? 2 : 0);
}
