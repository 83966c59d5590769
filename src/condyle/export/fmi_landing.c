/* Impulses P of a landing of some faces: compression ends where none approaches any more, and
 * restitution gives back a part of each impulse: a smaller one where several of them together would
 * add energy. Returns 0 where there are none. */
static int impulses(const double *R, const double *rate, const double *e, unsigned some, double *P)
{
    double pressed[FACES], least[FACES], more[FACES], after[FACES], low = 0.0, high = 1.0, part = 1.0;
    unsigned set;
    if (!complementary(R, rate, some, pressed, &set))
        return 0;
    for (int turn = 0; turn < HALVINGS + 2; turn++) {
        double added = 0.0, size = 0.0;
        for (int i = 0; i < FACES; i++)
            least[i] = pressed[i] * (1.0 + part * e[i]);
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
        if (!turn && added <= NEGLIGIBLE * size)
            break;
        *(added > 0.0 ? &high : &low) = part;
        part = turn < HALVINGS ? (low + high) / 2.0 : low;
    }
    return 1;
}

/* A landing of faces that touch: q' after it. Bounces end: faces that leave so slowly that they would
 * rise less than `rest` stay. */
static int landed(const model_constants *of, const Touch *t, unsigned touching, unsigned late,
                  double rest, double *v)
{
    double P[FACES], after[FACES], e[FACES], held[FACES], left[FACES] = {0.0};
    unsigned stay = 0, rests = 0;
    (void)of;
    for (int i = 0; i < FACES; i++)
        e[i] = late >> i & 1u ? 0.0 : RESTITUTION[i];
    if (!impulses(t->gap_response, t->gap_rate, e, touching, P))
        return 5;
    affine(t->gap_response, t->gap_rate, P, after);
    EACH(i, touching) {
        const double fall = -t->gap_bias[i];
        if (after[i] > 0.0 && after[i] * after[i] < 2.0 * fall * rest) {
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
