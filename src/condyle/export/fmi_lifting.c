/* Contacts that lift and land, in a plant of fmi.c. A contact has a face, or with clearance two; the
 * magnitudes p >= 0 with which faces push are not in the equations of the platform: accelerations and
 * gap'' are affine in them, gap'' = gap_bias + gap_response p. Which faces of rigid contacts are
 * active (gap'' = 0) stands in v, from MODEL_ACTIVE on, and changes at events alone. Faces that give
 * push by their laws. */
enum { FREE = @free@, HELD = @held@, FACES = @faces@, CONTACTS = @contacts@ };

static const double PUSH[FACES] = {@push@}; /* signs of contact forces */
static const int CONTACT_OF[FACES] = {@contact_of@}, HELD_OF[HELD + 1] = {@held_of@};

typedef struct {
    double acceleration[FREE], force[HELD + 1], gap[FACES], gap_rate[FACES], gap_bias[FACES],
        gap_response[FACES * FACES], q_response[FREE * FACES], force_response[HELD * FACES + 1],
        wall_curvature[3 * FACES];
} Touch;

static int touch_at(const model_constants *of, const double *v, Touch *t)
{
    return @call@;
}

@law@
/* The platform at v: rates, or everything that the pushes change. */
static int model_pressed(const model_constants *of, double *v, int everything)
{
    Touch t;
    double p[FACES];
    int status = touch_at(of, v, &t);
    if (!status)
        status = pressing(&t, v, p);
    if (status)
        return status;
    for (int i = 0; i < FREE; i++) {
        v[@acceleration@ + i] = t.acceleration[i];
        for (int j = 0; j < FACES; j++)
            v[@acceleration@ + i] += t.q_response[i * FACES + j] * p[j];
    }
    if (!everything)
        return 0;
    memset(v + @contact_force@, 0, CONTACTS * sizeof *v);
    for (int i = 0; i < HELD; i++) {
        double *force = v + @contact_force@ + HELD_OF[i];
        *force = t.force[i];
        for (int j = 0; j < FACES; j++)
            *force += t.force_response[i * FACES + j] * p[j];
    }
    for (int i = 0; i < FACES; i++) {
        v[@contact_force@ + CONTACT_OF[i]] += PUSH[i] * p[i];
        v[@gap@ + i] = t.gap[i];
        v[MODEL_INDICATORS + i] = is_active(v, i) ? p[i] : t.gap[i] + LEAST;
    }
    return 0;
}

/* What passes zero at an event, and gaps' rates, (FACES) each. */
static int model_levels(const model_constants *of, double *v, double *level, double *gap_rate)
{
    Touch t;
    double p[FACES];
    int status = touch_at(of, v, &t);
    if (!status)
        status = pressing(&t, v, p);
    for (int i = 0; i < FACES && !status; i++) {
        level[i] = is_active(v, i) ? p[i] : t.gap[i];
        gap_rate[i] = t.gap_rate[i];
    }
    return status;
}
