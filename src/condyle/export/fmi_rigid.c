/* Faces that do not give, without friction. A landing is an impulse by Poisson's law; which faces stay
 * active follows from complementarity: of few faces all sets are tried. */
#define TOUCHING (1e-9 * MODEL_LENGTH) /* m: gaps of faces that take part in a landing */
#define STILL (1e-9 * MODEL_LENGTH) /* m/s: rates of gaps that are none */
#define REST (1e-9 * MODEL_LENGTH) /* m: a rebound that would rise less is the last */
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

/* p of (b + R p)_i = 0 on a set, 0 elsewhere, by L D L^T; 0 where its rows depend on each other. */
static int solved(const double *R, const double *b, unsigned set, double *p)
{
    double L[FACES * FACES], D[FACES];
    memset(p, 0, FACES * sizeof *p);
    EACH(i, set) {
        for (int j = 0; j <= i; j++) {
            double left = R[i * FACES + j];
            if (!(set >> j & 1u))
                continue;
            for (int k = 0; k < j; k++)
                if (set >> k & 1u)
                    left -= L[i * FACES + k] * L[j * FACES + k] * D[k];
            if (j < i)
                L[i * FACES + j] = left / D[j];
            else
                D[i] = left;
        }
        if (!(D[i] > NEGLIGIBLE * R[i * FACES + i]))
            return 0;
        p[i] = -b[i];
        for (int j = 0; j < i; j++)
            if (set >> j & 1u)
                p[i] -= L[i * FACES + j] * p[j];
    }
    for (int i = FACES - 1; i >= 0; i--)
        if (set >> i & 1u) {
            p[i] /= D[i];
            for (int j = i + 1; j < FACES; j++)
                if (set >> j & 1u)
                    p[i] -= L[j * FACES + i] * p[j];
        }
    return 1;
}

/* The set of faces with p > 0 of a = b + R p >= 0, p >= 0, a_i p_i = 0 among some, fewest first; or
 * one of all bits where there is none. */
static unsigned complementary(const double *R, const double *b, unsigned some, double *p)
{
    for (int size = 0; size <= FACES; size++)
        for (unsigned set = 0; set < 1u << FACES; set++) {
            double a[FACES], accelerations = 0.0, forces = 0.0;
            int count = 0, good = 1;
            EACH(i, set) count++;
            if (count != size || set & ~some || !solved(R, b, set, p))
                continue;
            affine(R, b, p, a);
            EACH(i, some) {
                accelerations = fmax(accelerations, fabs(b[i]) + fabs(a[i] - b[i]));
                forces = fmax(forces, fabs(p[i]));
            }
            EACH(i, some) {
                good &= set >> i & 1u || a[i] >= -NEGLIGIBLE * accelerations;
                good &= p[i] >= -NEGLIGIBLE * forces;
            }
            if (good)
                return set;
        }
    return ~0u;
}

/* Impulses P of a landing of some faces: compression ends where none approaches any more, and
 * restitution gives back a part of each impulse: a smaller one where several of them together would
 * add energy. Returns 0 where there are none. */
static int impulses(const double *R, const double *rate, unsigned some, double *P)
{
    double pressed[FACES], least[FACES], more[FACES], after[FACES], low = 0.0, high = 1.0, part = 1.0;
    if (complementary(R, rate, some, pressed) == ~0u)
        return 0;
    for (int turn = 0; turn < HALVINGS + 2; turn++) {
        double added = 0.0, size = 0.0;
        for (int i = 0; i < FACES; i++)
            least[i] = pressed[i] * (1.0 + part * RESTITUTION[i]);
        affine(R, rate, least, after);
        if (complementary(R, after, some, more) == ~0u)
            return 0;
        for (int i = 0; i < FACES; i++)
            P[i] = least[i] + more[i];
        affine(R, rate, P, after);
        EACH(i, some) {
            added += P[i] * (rate[i] + after[i]) / 2.0;
            size += fabs(P[i] * rate[i]);
        }
        if (!turn && added <= NEGLIGIBLE * size)
            break;
        *(added > 0.0 ? &high : &low) = part;
        part = turn < HALVINGS ? (low + high) / 2.0 : low;
    }
    return 1;
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

/* A landing of faces that touch: q' after it. Bounces end: faces that leave so slowly that they would
 * rise less than REST stay. */
static int landed(const Touch *t, unsigned touching, double *v)
{
    double P[FACES], after[FACES], held[FACES], left[FACES] = {0.0};
    unsigned stay = 0, rests = 0;
    if (!impulses(t->gap_response, t->gap_rate, touching, P))
        return 5;
    affine(t->gap_response, t->gap_rate, P, after);
    EACH(i, touching) {
        const double fall = -t->gap_bias[i];
        if (after[i] > 0.0 && after[i] * after[i] < 2.0 * fall * REST) {
            rests |= 1u << i;
            left[i] = after[i];
        }
    }
    for (int i = 0; i < FACES && rests; i++)
        if ((rests >> i & 1u || P[i] > 0.0) && solved(t->gap_response, left, stay | 1u << i, held))
            stay |= 1u << i;
    if (solved(t->gap_response, left, stay, held))
        EACH(i, stay) P[i] += held[i];
    for (int i = 0; i < FREE; i++)
        EACH(j, touching) v[MODEL_STATES + FREE + i] += t->q_response[i * FACES + j] * P[j];
    return 0;
}

/* An event: impulses where faces land, then which of those that touch stay active. */
static int model_settle(const model_constants *of, double *v)
{
    unsigned touching = 0, still = 0, active, lands = 0;
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
    if (lands && (status = landed(&t, touching, v)) == 0)
        status = touch_at(of, v, &t);
    if (status)
        return status;
    EACH(i, touching) still |= (unsigned)(fabs(t.gap_rate[i]) <= STILL) << i;
    active = complementary(t.gap_response, t.gap_bias, still, p);
    if (active == ~0u)
        return 5;
    for (int i = 0; i < FACES; i++)
        v[MODEL_ACTIVE + i] = active >> i & 1u;
    return projected(of, v, active);
}

/* Whether a face has landed without an event: where an integrator saw no change of sign. */
static int model_missed(const model_constants *of, const double *v)
{
    Touch t;
    int missed = 0;
    if (touch_at(of, v, &t))
        return 0;
    for (int i = 0; i < FACES; i++)
        missed |= !is_active(v, i) && t.gap[i] < -TOUCHING && t.gap_rate[i] < 0.0;
    return missed;
}
