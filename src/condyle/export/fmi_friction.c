/* Landings with Coulomb's friction: as `condyle simulate` finds them, contact by contact, each with its
 * sliding direction, and from what these converge to exactly. Of each contact the normal, then two
 * tangents. */
enum { SIZE = 3 * FACES, ROUNDS = 40, SWEEPS = 8, QUICK = 5, TURNS = 100, DIRECTIONS = 180 };
enum { FEW = 2, MORE = 12 }; /* turns of one contact's direction: among others, and where these fail */
#define CONVERGED 1e-15 /* of the largest impulse, or of a direction */
#define NEAR 1e-6 /* of the largest impulse: it opens or slides within that */

static const double FRICTION[FACES] = {@friction@};

/* Some faces, n of them: their velocities before, and G, of these to unit impulses, rows of SIZE. */
typedef struct {
    int n;
    double G[SIZE * SIZE], v[SIZE], e[FACES], mu[FACES];
} Impact;

/* v + G P. */
static void left_of(const Impact *of, const double *v, const double *P, double *left)
{
    for (int i = 0; i < 3 * of->n; i++) {
        left[i] = v[i];
        for (int j = 0; j < 3 * of->n; j++)
            left[i] += of->G[i * SIZE + j] * P[j];
    }
}

static double largest(const double *x, int n)
{
    double most = 0.0;
    for (int i = 0; i < n; i++)
        most = fmax(most, fabs(x[i]));
    return most;
}

/* Adds to a contact's own response one of its size along directions in which others hold its point:
 * there are no velocities, hence no impulses. By Jacobi's rotations. */
static void regularise(double *G)
{
    double A[9], V[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, most;
    for (int i = 0; i < 9; i++)
        A[i] = G[i / 3 * SIZE + i % 3];
    for (int turn = 0; turn < 30; turn++) {
        const int p = turn % 3 == 2, q = turn % 3 ? 2 : 1;
        const double across = A[p * 3 + q];
        if (across == 0.0)
            continue;
        const double theta = (A[q * 4] - A[p * 4]) / (2.0 * across);
        const double t = copysign(1.0, theta) / (fabs(theta) + hypot(theta, 1.0));
        const double c = 1.0 / hypot(t, 1.0), s = t * c;
        for (int i = 0; i < 3; i++) {
            const double a = A[i * 3 + p], b = A[i * 3 + q], v = V[i * 3 + p], w = V[i * 3 + q];
            A[i * 3 + p] = c * a - s * b;
            A[i * 3 + q] = s * a + c * b;
            V[i * 3 + p] = c * v - s * w;
            V[i * 3 + q] = s * v + c * w;
        }
        for (int i = 0; i < 3; i++) {
            const double a = A[p * 3 + i], b = A[q * 3 + i];
            A[p * 3 + i] = c * a - s * b;
            A[q * 3 + i] = s * a + c * b;
        }
    }
    most = fmax(A[0], fmax(A[4], A[8]));
    for (int k = 0; k < 3; k++)
        if (A[k * 4] <= NEGLIGIBLE * most)
            for (int i = 0; i < 9; i++)
                G[i / 3 * SIZE + i % 3] += most * V[i / 3 * 3 + k] * V[i % 3 * 3 + k];
}

/* The impulse whose friction has a direction, (2,), and the velocity that is left along the surface.
 * Args: normal: its normal part, or NAN: so that the normal velocity is 0 after it. */
static void slid(const double *G, const double *v, double mu, double normal, const double *way,
                 double *P, double *left)
{
    const double size = isnan(normal) ? -v[0] / (G[0] + mu * (G[1] * way[0] + G[2] * way[1])) : normal;
    P[0] = size;
    P[1] = size * mu * way[0];
    P[2] = size * mu * way[1];
    for (int i = 0; i < 2; i++)
        left[i] = v[i + 1] + G[(i + 1) * SIZE] * P[0] + G[(i + 1) * SIZE + 1] * P[1] +
                  G[(i + 1) * SIZE + 2] * P[2];
}

/* What is left across a direction by angle, and along it. */
static double turning(const double *G, const double *v, double mu, double normal, double angle,
                      double *P, double *with)
{
    const double way[2] = {cos(angle), sin(angle)};
    double left[2];
    slid(G, v, mu, normal, way, P, left);
    *with = left[0] * way[0] + left[1] * way[1];
    return left[0] * way[1] - left[1] * way[0];
}

/* The impulse whose friction is against the velocity that is left: of all directions. */
static void scanned(const double *G, const double *v, double mu, double normal, double *P)
{
    const double part = 8.0 * atan(1.0) / DIRECTIONS;
    double found[3], with, before = turning(G, v, mu, normal, 0.0, found, &with);
    for (int i = 1; i <= DIRECTIONS; i++) {
        const double here = turning(G, v, mu, normal, i * part, found, &with);
        if (here * before <= 0.0 && with < 0.0 && found[0] > 0.0) {
            double low = (i - 1) * part, high = i * part, at_low = before;
            for (int k = 0; k < 60; k++) {
                const double middle = (low + high) / 2.0;
                const double at = turning(G, v, mu, normal, middle, found, &with);
                *(at * at_low > 0.0 ? &low : &high) = middle;
                at_low = low == middle ? at : at_low;
            }
            if (with <= 0.0 && found[0] > 0.0) {
                memcpy(P, found, sizeof found);
                return;
            }
        }
        before = here;
    }
}

/* The impulse of one contact with a normal part, or NAN: see `slid`. */
static void rubbed(const double *G, const double *v, double mu, double normal, int turns, double *P)
{
    double A[9], way[2], left[2], size;
    const int free = isnan(normal), n = free ? 3 : 2, first = 3 - n;
    P[0] = free ? -v[0] / G[0] : normal;
    P[1] = P[2] = 0.0;
    if (mu == 0.0)
        return;
    for (int i = 0; i < n; i++) {
        P[first + i] = -v[first + i] - (free ? 0.0 : G[(first + i) * SIZE] * normal);
        for (int j = 0; j < n; j++)
            A[i * n + j] = G[(first + i) * SIZE + first + j];
    }
    eliminated(A, P + first, n);
    size = hypot(P[1], P[2]);
    if (size <= mu * P[0] || size == 0.0)
        return; /* it sticks */
    way[0] = P[1] / size;
    way[1] = P[2] / size;
    for (int turn = 0; turn < turns; turn++) {
        double change;
        slid(G, v, mu, normal, way, P, left);
        size = hypot(left[0], left[1]);
        if (size == 0.0)
            return;
        change = fmax(fabs(-left[0] / size - way[0]), fabs(-left[1] / size - way[1]));
        if (change <= CONVERGED)
            return;
        way[0] = -left[0] / size;
        way[1] = -left[1] / size;
    }
    if (turns != FEW)
        scanned(G, v, mu, normal, P);
}

/* Whether contacts push, do not approach, and stick or slide against their velocity. */
static int valid(const Impact *of, const double *v, const double *least, const double *P)
{
    double after[SIZE], change[SIZE] = {0.0};
    const double size = largest(P, 3 * of->n);
    left_of(of, v, P, after);
    for (int i = 0; i < 3 * of->n; i++)
        change[i] = after[i] - v[i];
    const double speeds = largest(v, 3 * of->n) + largest(change, 3 * of->n);
    for (int i = 0; i < of->n; i++) {
        const double *p = P + 3 * i, *u = after + 3 * i;
        if (!(p[0] >= least[i] - NEGLIGIBLE * size && u[0] >= -NEGLIGIBLE * speeds &&
              hypot(p[1], p[2]) <= of->mu[i] * p[0] + NEGLIGIBLE * size &&
              u[1] * p[1] + u[2] * p[2] <= NEGLIGIBLE * size * speeds))
            return 0;
    }
    return 1;
}

/* The impulses whose contacts open, stick and slide as those of `guess`, if they do so: linear equations
 * once the sliding directions are known, which are repeated. */
static int exactly(const Impact *of, const double *v, const double *least, const double *guess,
                   double *P)
{
    const int n = 3 * of->n;
    const double most = largest(guess, n);
    double way[SIZE], A[SIZE * SIZE], after[SIZE];
    for (int i = 0; i < of->n; i++) {
        const double size = hypot(guess[3 * i + 1], guess[3 * i + 2]);
        for (int a = 1; a < 3; a++)
            way[3 * i + a] = size > 0.0 ? guess[3 * i + a] / size : guess[3 * i + a];
    }
    for (int turn = 0; turn < TURNS; turn++) {
        double change = 0.0;
        for (int i = 0; i < n; i++) {
            const int face = i / 3, axis = i % 3;
            const double *one = guess + 3 * face;
            const int opens = one[0] <= least[face] + NEAR * most;
            const int slides = hypot(one[1], one[2]) >= of->mu[face] * one[0] * (1.0 - NEAR);
            P[i] = -v[i];
            for (int j = 0; j < n; j++)
                A[i * n + j] = of->G[i * SIZE + j];
            if (axis ? !slides : !opens)
                continue;
            P[i] = axis ? 0.0 : least[face];
            for (int j = 0; j < n; j++)
                A[i * n + j] = (double)(i == j);
            if (axis)
                A[i * n + 3 * face] = -of->mu[face] * way[i];
        }
        if (!eliminated(A, P, n))
            return 0;
        left_of(of, v, P, after);
        for (int i = 0; i < of->n; i++) {
            const double *one = guess + 3 * i, speed = hypot(after[3 * i + 1], after[3 * i + 2]);
            if (hypot(one[1], one[2]) < of->mu[i] * one[0] * (1.0 - NEAR) || speed == 0.0)
                continue;
            for (int a = 1; a < 3; a++) {
                const double turned = -after[3 * i + a] / speed;
                change = fmax(change, fabs(turned - way[3 * i + a]));
                way[3 * i + a] = turned;
            }
        }
        if (change <= CONVERGED)
            break;
    }
    return valid(of, v, least, P);
}

/* Impulses of at least `least` along the normals, and more where a contact would approach. */
static int phase(const Impact *of, const double *v, const double *least, double *P)
{
    const int n = 3 * of->n;
    int turns = of->n == 1 ? MORE : FEW;
    double before[SIZE], exact[SIZE];
    memset(P, 0, SIZE * sizeof *P);
    for (int i = 0; i < of->n; i++)
        P[3 * i] = least[i];
    for (int round = 0; round < ROUNDS; round++) {
        if (round == QUICK)
            turns = MORE;
        for (int sweep = 0; sweep < SWEEPS; sweep++) {
            double change = 0.0;
            memcpy(before, P, sizeof before);
            for (int i = 0; i < of->n; i++) {
                const double *own = of->G + 3 * i * SIZE + 3 * i;
                double at[3], *p = P + 3 * i;
                for (int a = 0; a < 3; a++) {
                    at[a] = v[3 * i + a];
                    for (int j = 0; j < n; j++)
                        at[a] += j / 3 == i ? 0.0 : of->G[(3 * i + a) * SIZE + j] * P[j];
                }
                rubbed(own, at, of->mu[i], least[i], turns, p);
                if (!(at[0] + own[0] * p[0] + own[1] * p[1] + own[2] * p[2] >= 0.0))
                    rubbed(own, at, of->mu[i], NAN, turns, p);
            }
            for (int i = 0; i < n; i++)
                change = fmax(change, fabs(P[i] - before[i]));
            if (change <= CONVERGED * largest(P, n)) {
                if (valid(of, v, least, P))
                    return 1;
                if (turns == MORE)
                    return 0;
                turns = MORE;
            }
        }
        if (exactly(of, v, least, P, exact)) {
            memcpy(P, exact, sizeof exact);
            return 1;
        }
    }
    return 0;
}

/* Impulses by Poisson's law: see fmi_landing.c. */
static int impulses(const Impact *of, double *P)
{
    const double none[FACES] = {0.0};
    double pressed[SIZE], least[FACES], more[SIZE], after[SIZE], left[SIZE];
    Factor factor = {0.0, 1.0, 1.0};
    if (!phase(of, of->v, none, pressed))
        return 0;
    left_of(of, of->v, pressed, left);
    for (int turn = 0; turn < HALVINGS + 2; turn++) {
        double added = 0.0, size = 0.0;
        for (int i = 0; i < of->n; i++)
            least[i] = factor.part * of->e[i] * pressed[3 * i];
        if (!phase(of, left, least, more))
            return 0;
        for (int i = 0; i < 3 * of->n; i++)
            P[i] = pressed[i] + more[i];
        left_of(of, of->v, P, after);
        for (int i = 0; i < 3 * of->n; i++) {
            added += P[i] * (of->v[i] + after[i]) / 2.0;
            size += fabs(P[i] * of->v[i]);
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
    double velocity[SIZE], response[SIZE * SIZE], q_response[FREE * SIZE];
    double P[SIZE], after[SIZE], normal[FACES * FACES] = {0.0};
    double leaving[FACES] = {0.0}, fall[FACES] = {0.0}, held[FACES];
    int face[FACES] = {0}, status = @impact@;
    unsigned pushing = 0;
    Impact one = {0};
    if (status)
        return status;
    EACH(i, touching) face[one.n++] = i;
    for (int i = 0; i < 3 * one.n; i++) {
        const int from = 3 * face[i / 3] + i % 3;
        one.v[i] = velocity[from];
        for (int j = 0; j < 3 * one.n; j++)
            one.G[i * SIZE + j] = response[from * SIZE + 3 * face[j / 3] + j % 3];
    }
    for (int i = 0; i < one.n; i++) {
        one.e[i] = late >> face[i] & 1u ? 0.0 : RESTITUTION[face[i]];
        one.mu[i] = FRICTION[face[i]];
        regularise(one.G + 3 * i * SIZE + 3 * i);
        for (int j = 0; j < one.n; j++)
            normal[i * FACES + j] = one.G[3 * i * SIZE + 3 * j];
    }
    if (!impulses(&one, P))
        return 5;
    left_of(&one, one.v, P, after);
    for (int i = 0; i < one.n; i++) {
        leaving[i] = after[3 * i];
        fall[i] = -t->gap_bias[face[i]];
        pushing |= (unsigned)(P[3 * i] > 0.0) << i;
    }
    const unsigned every = (1u << one.n) - 1u;
    const unsigned stay = held_down(normal, leaving, fall, every, pushing, rest, held);
    EACH(i, stay) P[3 * i] += held[i];
    for (int i = 0; i < FREE; i++)
        for (int j = 0; j < 3 * one.n; j++)
            v[MODEL_STATES + FREE + i] += q_response[i * SIZE + 3 * face[j / 3] + j % 3] * P[j];
    return 0;
}
