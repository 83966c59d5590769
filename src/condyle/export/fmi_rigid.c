/* Faces that do not give. A landing is an impulse by Poisson's law; which faces stay
 * active follows from complementarity: of few faces all sets are tried. */
#define TOUCHING (1e-9 * MODEL_LENGTH) /* m: gaps of faces that take part in a landing */
#define STILL (1e-9 * MODEL_LENGTH) /* m/s: rates of gaps that are none */
#define LEAST (1e-12 * MODEL_LENGTH) /* m: indicators of open faces are that above their gaps */
#define NEGLIGIBLE 1e-10 /* of the largest: rounding of none */
#define HALVINGS 40 /* of the factor on restitution */
#define RETURNED 100.0 /* 1/s: how fast gaps that an integrator has opened close */
#define EACH(i, set) for (int i = 0; i < FACES; i++) if ((set) >> i & 1u)

static const double RESTITUTION[FACES] = {@restitution@};

/* y = b + R p. */
static void affine(const double *R, const double *b, const double *p, double *y)
{
    for (int i = 0; i < FACES; i++) {
        y[i] = b[i];
        for (int j = 0; j < FACES; j++)
            y[i] += R[i * FACES + j] * p[j];
    }
}

@elimination@
/* p of (b + R p)_i = 0 on a set, 0 elsewhere; 0 where its rows depend on each other. */
static int solved(const double *R, const double *b, unsigned set, double *p)
{
    double A[FACES * FACES], x[FACES];
    int rows = 0, entries = 0;
    EACH(i, set) {
        EACH(j, set) A[entries++] = R[i * FACES + j];
        x[rows++] = -b[i];
    }
    if (!eliminated(A, x, rows))
        return 0;
    rows = 0;
    memset(p, 0, FACES * sizeof *p);
    EACH(i, set) p[i] = x[rows++];
    return 1;
}

/* Solutions of a = b + R p >= 0, p >= 0, a_i p_i = 0 among some faces: none, one, or 2 for several,
 * which friction may lead to. The first has fewest faces: p, and the set of those that push. */
static int complementary(const double *R, const double *b, unsigned some, double *p, unsigned *active)
{
    double first[FACES];
    int solutions = 0;
    for (int size = 0; size <= FACES; size++)
        for (unsigned set = 0; set < 1u << FACES; set++) {
            double a[FACES], x[FACES], accelerations = 0.0, forces = 0.0, apart = 0.0;
            int count = 0, good = 1;
            EACH(i, set) count++;
            if (count != size || set & ~some || !solved(R, b, set, x))
                continue;
            affine(R, b, x, a);
            EACH(i, some) {
                a[i] = set >> i & 1u ? 0.0 : a[i];
                accelerations = fmax(accelerations, fabs(b[i]) + fabs(a[i] - b[i]));
                forces = fmax(forces, fabs(x[i]));
            }
            EACH(i, some) {
                good &= a[i] >= -NEGLIGIBLE * accelerations && x[i] >= -NEGLIGIBLE * forces;
                apart = fmax(apart, solutions ? fabs(a[i] - first[i]) : 0.0);
            }
            if (!good)
                continue;
            if (solutions && apart > 10.0 * NEGLIGIBLE * accelerations)
                return 2;
            if (solutions)
                continue;
            solutions = 1;
            *active = set;
            memcpy(first, a, sizeof a);
            memcpy(p, x, sizeof x);
            if (!MODEL_FRICTION)
                return 1;
        }
    return solutions;
}

static int is_active(const double *v, int i)
{
    return v[MODEL_ACTIVE + i] != 0.0;
}

/* Magnitudes of the pushes of active faces. */
static int pressing(const Touch *t, const double *v, double *p)
{
    double opening[FACES];
    unsigned set = 0;
    for (int i = 0; i < FACES; i++) {
        set |= (unsigned)is_active(v, i) << i;
        opening[i] = t->gap_bias[i] + RETURNED * (2.0 * t->gap_rate[i] + RETURNED * t->gap[i]);
    }
    return solved(t->gap_response, opening, set, p) ? 0 : 2;
}

/* q and q' of active faces closed. */
static int projected(const model_constants *of, double *v, unsigned set)
{
    double p[FACES];
    Touch t;
    for (int turn = 0; turn < 10 && set; turn++) {
        double off = 0.0;
        const int status = touch_at(of, v, &t);
        if (status)
            return status;
        EACH(i, set) off = fmax(off, fmax(fabs(t.gap[i]), fabs(t.gap_rate[i])));
        if (off <= 1e-14 * MODEL_LENGTH)
            break;
        for (int order = 0; order < 2; order++) {
            if (!solved(t.gap_response, order ? t.gap_rate : t.gap, set, p))
                return 2;
            for (int i = 0; i < FREE; i++)
                EACH(j, set) v[MODEL_STATES + order * FREE + i] += t.q_response[i * FACES + j] * p[j];
        }
    }
    return 0;
}

/* Gaps of faces that an integrator has taken a little below zero: raised to it, so that indicators are
 * positive where they leave. */
static int lifted(const model_constants *of, double *v, unsigned some)
{
    double p[FACES];
    unsigned set = 0;
    Touch t;
    const int status = some ? touch_at(of, v, &t) : 0;
    if (status || !some)
        return status;
    EACH(i, some) set |= (unsigned)(t.gap[i] < 0.0 && t.gap[i] >= -TOUCHING) << i;
    if (set && solved(t.gap_response, t.gap, set, p))
        for (int i = 0; i < FREE; i++)
            EACH(j, set) v[MODEL_STATES + i] += t.q_response[i * FACES + j] * p[j];
    return 0;
}

/* A factor on restitution: the greatest that adds no energy, by bisection. */
typedef struct {
    double low, high, part;
} Factor;

/* Whether the factor is found; else the next one is to be tried. Args: added: energy;  size: of its
 * terms. */
static int factor_found(Factor *f, int turn, double added, double size)
{
    if (!turn && added <= NEGLIGIBLE * size)
        return 1;
    *(added > 0.0 ? &f->high : &f->low) = f->part;
    f->part = turn < HALVINGS ? (f->low + f->high) / 2.0 : f->low;
    return 0;
}

/* Bounces end: faces that leave so slowly that they would rise less than `rest` stay, and so do those
 * that push. Returns these; `more`: impulses that hold them. Args: after: rates of gaps;  fall: how
 * these fall back. */
static unsigned held_down(const double *R, const double *after, const double *fall, unsigned some,
                          unsigned pushing, double rest, double *more)
{
    double left[FACES] = {0.0};
    unsigned rests = 0, stay = 0;
    EACH(i, some) {
        if (!(after[i] > 0.0 && after[i] * after[i] < 2.0 * fall[i] * rest))
            continue;
        rests |= 1u << i;
        left[i] = after[i];
    }
    EACH(i, rests ? rests | pushing : 0u) {
        if (solved(R, left, stay | 1u << i, more))
            stay |= 1u << i;
    }
    return solved(R, left, stay, more) ? stay : 0u;
}

@landing@
/* An event: impulses where faces land, then which of those that touch stay active. Those that are
 * `late`, of a bounce that an integrator's step has passed over, land without restitution; a rebound
 * that would rise less than `rest` of the mechanism's size is the last. */
static int model_settle(const model_constants *of, double *v, unsigned late, double rest)
{
    unsigned touching = 0, still = 0, active = 0, lands = 0;
    double p[FACES];
    Touch t;
    int status = touch_at(of, v, &t);
    if (status)
        return status;
    for (int i = 0; i < FACES; i++) {
        const int open = !is_active(v, i);
        touching |= (unsigned)(!open || t.gap[i] <= TOUCHING) << i;
        lands |= (unsigned)(open && t.gap[i] <= TOUCHING && t.gap_rate[i] < -STILL) << i;
    }
    if (lands && (status = landed(of, &t, touching, late, rest * MODEL_LENGTH, v)) == 0)
        status = touch_at(of, v, &t);
    if (status)
        return status;
    EACH(i, touching) still |= (unsigned)(fabs(t.gap_rate[i]) <= STILL) << i;
    const int solutions = complementary(t.gap_response, t.gap_bias, still, p, &active);
    if (solutions != 1)
        return solutions ? 8 : 5;
    for (int i = 0; i < FACES; i++)
        v[MODEL_ACTIVE + i] = active >> i & 1u;
    status = projected(of, v, active);
    return status ? status : lifted(of, v, touching & ~active);
}

/* Open faces whose indicators are not above zero, and of these, in `deep`, those that go on sinking in. */
static unsigned model_below(const model_constants *of, const double *v, unsigned *deep)
{
    Touch t;
    unsigned below = 0;
    *deep = 0;
    if (touch_at(of, v, &t))
        return 0;
    for (int i = 0; i < FACES; i++) {
        const int open = !is_active(v, i);
        below |= (unsigned)(open && t.gap[i] <= -LEAST) << i;
        *deep |= (unsigned)(open && t.gap[i] < -TOUCHING && t.gap_rate[i] < 0.0) << i;
    }
    return below;
}

/* Time until the first face that has just left its surface is highest [s], or infinite: a solver that
 * stops there sees it land, however short the bounce. */
static double model_highest(const model_constants *of, const double *v)
{
    double p[FACES], opening[FACES], first = HUGE_VAL;
    Touch t;
    if (touch_at(of, v, &t) || pressing(&t, v, p))
        return first;
    affine(t.gap_response, t.gap_bias, p, opening);
    for (int i = 0; i < FACES; i++) {
        const double rate = t.gap_rate[i], more = rate * rate / -2.0 / opening[i]; /* that it rises */
        const int leaves = !is_active(v, i) && t.gap[i] <= TOUCHING && rate > STILL;
        if (leaves && more > t.gap[i])
            first = fmin(first, 2.0 * more / rate);
    }
    return first;
}
