/* Faces that give: p = max(N(d) (1 - damping gap'), 0) at d = -gap, N = scale factor d^power [K. H.
 * Hunt and F. R. E. Crossley, J. Applied Mechanics 42, 440 (1975)]. The factor is of the principal
 * relative curvatures of the ball, `along` and `across`, and of the wall, `radius` beyond the surface
 * of the ball's centre. */
enum { STIFF, ELLIPSE, LAYER, LAYER_LINE, THICK_LAYER };
typedef struct {
    int shape;
    double scale, power, damping, along, across, radius, depth;
} Law;
static const Law LAWS[FACES] = {
@laws@};

/* sqrt(D / K^3) of Hertz' ellipse, K and D = (K - E) / m the complete elliptic integrals at its squared
 * eccentricity m, which the ratio >= 1 of the curvatures gives: ratio = (K - D) / ((1 - m) D). By the
 * arithmetic-geometric mean. */
static double ellipse(double ratio)
{
    const double goal = log(ratio);
    double t = 0.0, K, D, change;
    int left = 40;
    do {
        double a = 1.0, b = exp(t), sum = 0.5, power = 1.0, m = -expm1(2.0 * t);
        double share = m / (4.0 * (1.0 + b) * (1.0 + b)); /* (a - b)^2 / 4 over m */
        for (int i = 0; i < 8; i++) {
            const double mean = (a + b) / 2.0;
            sum += power * share;
            power *= 2.0;
            b = sqrt(a * b);
            a = mean;
            share = m > 0.0 ? (a - b) * (a - b) / (4.0 * m) : 0.0;
        }
        K = 2.0 * atan(1.0) / a;
        D = K * sum;
        change = (log((K - D) / D) - 2.0 * t - goal) / 1.75;
        t += change;
    } while (fabs(change) > 1e-15 * (1.0 + fabs(t)) && --left);
    return sqrt(D / (K * K * K));
}

/* Energy of a layer at strain x, over its modulus. */
static double squeeze(double x)
{
    if (x < 1e-3)
        return x * x * (1.0 / 2 + x * (1.0 / 6 + x * (1.0 / 12 + x * (1.0 / 20 + x / 30))));
    return (1.0 - x) * log1p(-x) + x;
}

/* N at an indentation d > 0. Args: bent: xx, yy and xy of the surface of the ball's centre. */
static double elastic(const Law *law, const double *bent, double push, double d)
{
    const double off = push * law->radius, det = bent[0] * bent[1] - bent[2] * bent[2];
    const double by = push / (1.0 - off * (bent[0] + bent[1] - off * det));
    const double xx = law->along + by * (bent[0] - off * det);
    const double yy = law->across + by * (bent[1] - off * det), xy = by * bent[2];
    const double mean = (xx + yy) / 2.0, half = hypot((xx - yy) / 2.0, xy);
    const double low = mean - half, high = mean + half;
    double factor = 1.0;
    if (law->shape == ELLIPSE)
        factor = low > 0.0 ? ellipse(high / low) / sqrt(low) : HUGE_VAL;
    else if (law->shape == LAYER_LINE)
        factor = high > 0.0 ? 1.0 / sqrt(high) : HUGE_VAL;
    else if (law->shape != STIFF)
        factor = low > 0.0 ? 1.0 / sqrt(low * high) : HUGE_VAL;
    if (law->shape == THICK_LAYER)
        factor *= d < law->depth ? squeeze(d / law->depth) : HUGE_VAL;
    return law->scale * factor * pow(d, law->power);
}

#define LEAST 0.0 /* m: indicators are gaps */

static int is_active(const double *v, int i)
{
    return (void)v, (void)i, 0;
}

/* Magnitudes of the pushes; where a law does not hold there are none. */
static int pressing(const Touch *t, const double *v, double *p)
{
    (void)v;
    for (int i = 0; i < FACES; i++) {
        const double damped = 1.0 - LAWS[i].damping * t->gap_rate[i];
        p[i] = 0.0;
        if (t->gap[i] < 0.0 && damped > 0.0)
            p[i] = elastic(LAWS + i, t->wall_curvature + 3 * i, PUSH[i], -t->gap[i]) * damped;
        if (!(p[i] < HUGE_VAL))
            return 1;
    }
    return 0;
}

/* Forces follow from the state: no event changes anything. */
static int model_settle(const model_constants *of, double *v, unsigned late, double rest)
{
    return (void)of, (void)v, (void)late, (void)rest, 0;
}

static unsigned model_below(const model_constants *of, const double *v, unsigned *deep)
{
    return (void)of, (void)v, *deep = 0;
}

static double model_highest(const model_constants *of, const double *v)
{
    return (void)of, (void)v, HUGE_VAL;
}
