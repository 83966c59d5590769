/* Impulses P of a landing of some faces: compression ends where none approaches any more, and
 * restitution gives back a part of each impulse: a smaller one where several of them together would
 * add energy. Returns 0 where there are none. */
static int impulses(const double *R, const double *rate, const double *e, unsigned some, double *P)
{
    double pressed[FACES], least[FACES], more[FACES], after[FACES];
    Factor factor = {0.0, 1.0, 1.0};
    unsigned set;
    if (!complementary(R, rate, some, pressed, &set))
        return 0;
    for (int turn = 0; turn < HALVINGS + 2; turn++) {
        double added = 0.0, size = 0.0;
        for (int i = 0; i < FACES; i++)
            least[i] = pressed[i] * (1.0 + factor.part * e[i]);
        affine(R, rate, least, after);
        if (!complementary(R, after, some, more, &set))
            return 0;
        for (int i = 0; i < FACES; i++)
            P[i] = least[i] + more[i];
        affine(R, rate, P, after);
        EACH(i, some) {
            added += P[i] * (rate[i] + after[i]) / 2.0;
            size += fabs(P[i] * rate[i]);
        }
        if (factor_found(&factor, turn, added, size))
            break;
    }
    return 1;
}

/* A landing of faces that touch: q' after it. */
static int landed(const model_constants *of, const Touch *t, unsigned touching, unsigned late,
                  double rest, double *v)
{
    double P[FACES], after[FACES], e[FACES], fall[FACES], held[FACES];
    unsigned pushing = 0;
    (void)of;
    for (int i = 0; i < FACES; i++)
        e[i] = late >> i & 1u ? 0.0 : RESTITUTION[i];
    if (!impulses(t->gap_response, t->gap_rate, e, touching, P))
        return 5;
    affine(t->gap_response, t->gap_rate, P, after);
    for (int i = 0; i < FACES; i++) {
        fall[i] = -t->gap_bias[i];
        pushing |= (unsigned)(P[i] > 0.0) << i;
    }
    const unsigned stay = held_down(t->gap_response, after, fall, touching, pushing, rest, held);
    EACH(i, stay) P[i] += held[i];
    for (int i = 0; i < FREE; i++)
        EACH(j, touching) v[MODEL_STATES + FREE + i] += t->q_response[i * FACES + j] * P[j];
    return 0;
}
