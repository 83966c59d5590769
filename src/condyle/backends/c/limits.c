/* Efforts of least sum of squares within limits, where at most two of them are free: one sample.
 *
 *     least |x|^2 / 2 + W |lambda|^2 / 2   with   Q = J^T effort + D lambda,   effort = scale x,
 *     low <= effort <= high,   contact_low <= lambda <= contact_high
 *
 * Six equations for EFFORTS + CONTACTS unknowns leave FREE = 0, 1 or 2 directions, in which the
 * limits cut out a convex polygon: the answer is its point nearest to the least norm. Where it is
 * empty, a linear program in FREE + 1 unknowns gives the number by which all limits of efforts
 * would have to be multiplied at least.
 *
 * EFFORTS and CONTACTS are defined ahead of this text. No heap, no statics; loops are bounded.
 * Whatever the routine is not sure of it leaves to others: UNSURE. */
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define FOUND 0
#define INFEASIBLE 3
#define UNSURE 255

#define EQUATIONS (6 - CONTACTS)
#define FREE (EFFORTS - EQUATIONS)
#if FREE < 0 || FREE > 2
#error "for 0, 1 or 2 efforts more than equations"
#endif
#define COLUMNS (CONTACTS + EFFORTS + 1)
#define BOUNDS (EFFORTS + CONTACTS)
#define SIDES (2 * BOUNDS + 1) /* the last: limits are not multiplied by less than 0 */
#define ROUNDS 64
#define BLOCK 16

#define REGULAR 1e-5    /* sine of an angle to other columns, below which digits are lost */
#define FIXED 1e-9      /* of its size: less than this, a bound does not change with what is free */
#define KEPT 1e-12      /* of the largest effort, by which a bound may be exceeded on the way */
#define TIE 1e-12       /* of a value: nearer than this, patterns are equal and the first counts */
#define CERTIFIED 1e-9  /* of the largest effort: what an answer must be proved to */

/* What bounds a sample, friction's pattern included. */
typedef struct {
    double low[EFFORTS], high[EFFORTS], scale[EFFORTS];
    double contact_low[CONTACTS + 1], contact_high[CONTACTS + 1];
    double weight;
} bounds_t;

/* x = x0 + Z z, lambda = lambda0 + L z: all that meets the equations. */
typedef struct {
    double x0[EFFORTS], Z[EFFORTS][3];
    double lambda0[CONTACTS + 1], L[CONTACTS + 1][3], steep[CONTACTS + 1]; /* greatest |L| */
} family_t;

/* Sides of the polygon: g . z <= f + H t, g of length 1, with limits multiplied by t. */
typedef struct {
    int count;
    double g[SIDES][2], f[SIDES], H[SIDES];
} polygon_t;

/* An answer, with its certificate: parts of the largest effort. */
typedef struct {
    double effort[EFFORTS], force[CONTACTS + 1];
    double value, shortfall, residual, dual;
} answer_t;

static double larger(double a, double b) { return a > b ? a : b; }

/* Reflect columns `first` to `last` of rows `row` and below so that the first of them ends there.
 * Returns 0 where nothing is left of it. */
static int reflect(double M[6][COLUMNS], int row, int first, double whole) {
    double square = 0;
    for (int i = row; i < 6; i++) square += M[i][first] * M[i][first];
    if (!(square > REGULAR * REGULAR * whole)) return 0;
    double length = M[row][first] < 0 ? -sqrt(square) : sqrt(square), v[6] = {0};
    for (int i = row; i < 6; i++) v[i] = M[i][first];
    v[row] += length;
    double factor = 1 / (length * v[row]);
    for (int c = first; c < COLUMNS; c++) {
        double sum = 0;
        for (int i = row; i < 6; i++) sum += v[i] * M[i][c];
        sum *= factor;
        for (int i = row; i < 6; i++) M[i][c] -= sum * v[i];
    }
    return 1;
}

/* A length that makes moments of the order of forces. */
static double lever(double M[6][COLUMNS]) {
    double force = 0, moment = 0;
    for (int c = 0; c < COLUMNS - 1; c++)
        for (int i = 0; i < 3; i++) {
            force += M[i][c] * M[i][c];
            moment += M[i + 3][c] * M[i + 3][c];
        }
    return force > 0 && moment > 0 ? sqrt(moment / force) : 1;
}

/* All that meets the equations in M = (D, J^T scale, Q): contacts eliminated by reflections, then
 * the efforts of least norm and an orthonormal basis of what is free. M is overwritten. */
static int family(double M[6][COLUMNS], family_t *out) {
    for (int j = 0; j < CONTACTS; j++) {
        double whole = 0;
        for (int i = 0; i < 6; i++) whole += M[i][j] * M[i][j];
        if (!reflect(M, j, j, whole)) return 0;
    }
    for (int j = CONTACTS - 1; j >= 0; j--) {
        double inverse = 1 / M[j][j];
        for (int c = CONTACTS; c < COLUMNS; c++) {
            for (int l = j + 1; l < CONTACTS; l++) M[j][c] -= M[j][l] * M[l][c];
            M[j][c] *= inverse;
        }
    }
    /* A^T = H_0 H_1 ... R, column by column, with unit reflectors in V. */
    double V[EQUATIONS][EFFORTS], w[EQUATIONS];
    for (int j = 0; j < EQUATIONS; j++) {
        double *v = V[j], square = 0, whole = 0;
        for (int i = 0; i < EFFORTS; i++) v[i] = M[CONTACTS + j][CONTACTS + i];
        for (int i = 0; i < EFFORTS; i++) whole += v[i] * v[i];
        double b = M[CONTACTS + j][COLUMNS - 1];
        for (int l = 0; l < j; l++) {
            double sum = 0;
            for (int i = l; i < EFFORTS; i++) sum += V[l][i] * v[i];
            for (int i = l; i < EFFORTS; i++) v[i] -= 2 * sum * V[l][i];
            b -= v[l] * w[l];
        }
        for (int i = j; i < EFFORTS; i++) square += v[i] * v[i];
        if (!(square > REGULAR * REGULAR * whole)) return 0;
        double length = v[j] < 0 ? -sqrt(square) : sqrt(square);
        w[j] = -b / length;
        double own = 1 / sqrt(2 * (square + length * v[j]));
        v[j] += length;
        for (int i = 0; i < EFFORTS; i++) v[i] = i < j ? 0 : own * v[i];
    }
    double X[1 + FREE][EFFORTS];
    for (int c = 0; c <= FREE; c++)
        for (int i = 0; i < EFFORTS; i++)
            X[c][i] = c ? i == EQUATIONS + c - 1 : i < EQUATIONS ? w[i] : 0;
    for (int j = EQUATIONS - 1; j >= 0; j--)
        for (int c = 0; c <= FREE; c++) {
            double sum = 0;
            for (int i = j; i < EFFORTS; i++) sum += V[j][i] * X[c][i];
            for (int i = j; i < EFFORTS; i++) X[c][i] -= 2 * sum * V[j][i];
        }
    for (int i = 0; i < EFFORTS; i++) {
        out->x0[i] = X[0][i];
        for (int c = 0; c < FREE; c++) out->Z[i][c] = X[c + 1][i];
    }
    for (int j = 0; j < CONTACTS; j++) {
        const double *B = M[j] + CONTACTS;
        double square = 0;
        out->lambda0[j] = B[EFFORTS];
        for (int i = 0; i < EFFORTS; i++) {
            out->lambda0[j] -= B[i] * X[0][i];
            square += B[i] * B[i];
        }
        out->steep[j] = sqrt(square);
        for (int c = 0; c < FREE; c++) {
            out->L[j][c] = 0;
            for (int i = 0; i < EFFORTS; i++) out->L[j][c] -= B[i] * X[c + 1][i];
        }
    }
    return 1;
}

/* Coordinates in which the objective is |z|^2 / 2 and a constant, where contact forces cost W.
 * Returns the constant. */
static double centred(family_t *a, double W) {
    double value = 0, shift[2] = {0, 0};
#if FREE > 0 && CONTACTS > 0
    if (W > 0) {
        /* I + W L^T L = C C^T;  z = C^-T y + shift. */
        double S[2][2] = {{1, 0}, {0, 1}}, r[2] = {0, 0}, inverse[2][2] = {{1, 0}, {0, 1}};
        for (int j = 0; j < CONTACTS; j++)
            for (int c = 0; c < FREE; c++) {
                r[c] -= W * a->L[j][c] * a->lambda0[j];
                for (int d = 0; d < FREE; d++) S[c][d] += W * a->L[j][c] * a->L[j][d];
            }
        double c00 = sqrt(S[0][0]), c10 = S[1][0] / c00, c11 = sqrt(S[1][1] - c10 * c10);
        inverse[0][0] = 1 / c00, inverse[1][1] = 1 / c11;
        inverse[0][1] = -c10 / (c00 * c11); /* of C^T, upper triangular */
        double y[2] = {r[0] / c00, (r[1] - c10 * r[0] / c00) / c11};
        shift[0] = inverse[0][0] * y[0] + inverse[0][1] * y[1];
        shift[1] = inverse[1][1] * y[1];
        for (int i = 0; i < EFFORTS + CONTACTS; i++) {
            double *at = i < EFFORTS ? &a->x0[i] : &a->lambda0[i - EFFORTS];
            double *row = i < EFFORTS ? a->Z[i] : a->L[i - EFFORTS], old[2] = {row[0], 0};
            if (FREE > 1) old[1] = row[1];
            *at += old[0] * shift[0] + old[1] * shift[1];
            row[0] = old[0] * inverse[0][0];
            row[1] = old[0] * inverse[0][1] + old[1] * inverse[1][1];
        }
    }
#endif
    (void)shift;
    for (int i = 0; i < EFFORTS; i++) value += a->x0[i] * a->x0[i];
    for (int j = 0; j < CONTACTS; j++) value += W * a->lambda0[j] * a->lambda0[j];
    return value / 2;
}

/* One side of bound `at + g . z`, unless it is infinite, or does not change with z, which it could
 * as `steep` says: then whether it is kept for sure. H: whether t multiplies the bound. */
static int side(polygon_t *p, const double *g, double sign, double bound, double at, int H,
                double steep) {
    if (isinf(bound)) return 1;
    double u[2] = {FREE > 0 ? sign * g[0] : 0, FREE > 1 ? sign * g[1] : 0};
    double length = sqrt(u[0] * u[0] + u[1] * u[1]), f = -sign * at, h = sign * bound;
    if (FREE == 0) length = 1;
    if (!(length > FIXED * steep)) return f + h >= 0;
    int i = p->count++;
    p->g[i][0] = u[0] / length, p->g[i][1] = u[1] / length;
    p->f[i] = (H ? f : f + h) / length;
    p->H[i] = H ? h / length : 0;
    return 1;
}

static int polygon(const family_t *a, const bounds_t *b, polygon_t *p) {
    int sure = 1;
    p->count = 0;
    for (int i = 0; i < EFFORTS; i++) {
        sure &= side(p, a->Z[i], 1, b->high[i] / b->scale[i], a->x0[i], 1, 1);
        sure &= side(p, a->Z[i], -1, b->low[i] / b->scale[i], a->x0[i], 1, 1);
    }
    for (int j = 0; j < CONTACTS; j++) {
        sure &= side(p, a->L[j], 1, b->contact_high[j], a->lambda0[j], 0, a->steep[j]);
        sure &= side(p, a->L[j], -1, b->contact_low[j], a->lambda0[j], 0, a->steep[j]);
    }
    return sure;
}

/* The point of the polygon nearest to 0. A side that it breaks most becomes active, and the nearest
 * point moves along it, within the sides that were active before: at most COUNT turns, since the
 * distance grows in each.
 *
 * z: the point;  active: sides it rests on, -1 for none, or three that no point meets;
 * price: multipliers of the sides it rests on. */
static int nearest(const polygon_t *p, double size, double *z, int *active, double *price) {
    int before[SIDES], turns = 0;
    z[0] = z[1] = 0;
    active[0] = active[1] = active[2] = -1;
    price[0] = price[1] = 0;
    for (;;) {
        int worst = -1;
        double most = KEPT * size;
        for (int i = 0; i < p->count; i++) {
            double over = p->g[i][0] * z[0] + p->g[i][1] * z[1] - p->f[i] - p->H[i];
            if (over > most) most = over, worst = i;
        }
        if (worst < 0) return FOUND;
        for (int i = 0; i < turns; i++)
            if (before[i] == worst) return UNSURE;
        const double *g = p->g[worst], h = p->f[worst] + p->H[worst];
        double along[2] = {-g[1], g[0]}, from = -INFINITY, to = INFINITY;
        int lower = -1, upper = -1;
        active[0] = worst, active[1] = active[2] = -1;
        if (FREE == 0) return most > CERTIFIED * size ? INFEASIBLE : UNSURE;
        for (int i = 0; i < turns; i++) {
            int j = before[i];
            double slope = p->g[j][0] * along[0] + p->g[j][1] * along[1];
            double room = p->f[j] + p->H[j] - h * (p->g[j][0] * g[0] + p->g[j][1] * g[1]);
            if (fabs(slope) < FIXED) {
                if (room >= 0) continue;
                active[1] = j;
                return -room > CERTIFIED * size ? INFEASIBLE : UNSURE;
            }
            double t = room / slope;
            if (slope > 0 && t < to) to = t, upper = j;
            if (slope < 0 && t > from) from = t, lower = j;
        }
        if (from > to) {
            active[1] = lower, active[2] = upper;
            return from - to > CERTIFIED * size ? INFEASIBLE : UNSURE;
        }
        double t = from > 0 ? from : to < 0 ? to : 0;
        if (t != 0) active[1] = t > 0 ? lower : upper;
        z[0] = h * g[0] + t * along[0], z[1] = h * g[1] + t * along[1];
        price[0] = -h, price[1] = 0;
        if (active[1] >= 0) {
            const double *other = p->g[active[1]];
            price[1] = -t / (other[0] * along[0] + other[1] * along[1]);
            price[0] -= price[1] * (other[0] * g[0] + other[1] * g[1]);
        }
        before[turns++] = worst;
    }
}

/* x with M x = r, or M^T x = r, of FREE + 1 unknowns; 0 where M is singular. */
static int solved(double M[3][3], const double *r, int transposed, double *x) {
    enum { D = FREE + 1 };
    double A[3][4];
    for (int i = 0; i < D; i++) {
        for (int j = 0; j < D; j++) A[i][j] = transposed ? M[j][i] : M[i][j];
        A[i][D] = r[i];
    }
    for (int j = 0; j < D; j++) {
        int pivot = j;
        for (int i = j + 1; i < D; i++)
            if (fabs(A[i][j]) > fabs(A[pivot][j])) pivot = i;
        if (!(fabs(A[pivot][j]) > 1e-12)) return 0;
        for (int c = 0; c <= D; c++) {
            double other = A[pivot][c];
            A[pivot][c] = A[j][c], A[j][c] = other;
        }
        for (int i = j + 1; i < D; i++) {
            double factor = A[i][j] / A[j][j];
            for (int c = j; c <= D; c++) A[i][c] -= factor * A[j][c];
        }
    }
    for (int j = D - 1; j >= 0; j--) {
        x[j] = A[j][D];
        for (int c = j + 1; c < D; c++) x[j] -= A[j][c] * x[c];
        x[j] /= A[j][j];
    }
    return 1;
}

/* The least t >= 0 for which the polygon has a point, by the dual simplex method from sides that
 * no point meets at t = 1: prices of the basis stay 0 or more, so each of its corners is a bound. */
static int least_stretch(polygon_t *p, const int *infeasible, double size, double *t) {
    enum { D = FREE + 1 };
    int last = p->count++, basis[3], inside = 0, stretching = 0;
    p->g[last][0] = p->g[last][1] = p->f[last] = 0, p->H[last] = size;
    for (int i = 0; i < D; i++)
        if ((basis[i] = infeasible[i]) >= 0) inside++, stretching |= p->H[basis[i]] != 0;
    if (!stretching) { /* contacts alone: t has no part in it */
        *t = INFINITY;
        return INFEASIBLE;
    }
    if (inside < D) { /* two that are parallel: a third without a price makes a corner */
        double most = 0;
        if (FREE < 2) return UNSURE;
        for (int i = 0; i < last; i++) {
            const double *g = p->g[basis[0]];
            double sine = fabs(g[0] * p->g[i][1] - g[1] * p->g[i][0]);
            if (sine > most) most = sine, basis[2] = i;
        }
        if (!(most > FIXED)) return UNSURE;
    }
    double M[3][3], r[3], y[3], w[3], u[3];
    for (int turn = 0; turn < ROUNDS; turn++) {
        double aim[3] = {0, 0, 0};
        aim[FREE] = size;
        for (int i = 0; i < D; i++) {
            for (int c = 0; c < FREE; c++) M[i][c] = p->g[basis[i]][c];
            M[i][FREE] = p->H[basis[i]] / size; /* t in the unit 1 / size, and turned around */
            r[i] = p->f[basis[i]];
        }
        if (!solved(M, r, 0, w) || !solved(M, aim, 1, y)) return UNSURE;
        double highest = 0, t_here = -w[FREE] / size;
        for (int i = 0; i < D; i++) highest = larger(highest, fabs(y[i]));
        for (int i = 0; i < D; i++)
            if (y[i] < -CERTIFIED * highest) return UNSURE;
        int worst = -1;
        double most = 0, reach = fabs(w[0]) + (FREE > 1 ? fabs(w[1]) : 0);
        for (int i = 0; i < p->count; i++) {
            double over = -p->f[i] - p->H[i] * t_here;
            for (int c = 0; c < FREE; c++) over += p->g[i][c] * w[c];
            double terms = size + reach + fabs(p->f[i]) + fabs(p->H[i] * t_here);
            if (over > KEPT * terms && over > most) most = over, worst = i;
        }
        if (worst < 0) {
            *t = t_here;
            return INFEASIBLE;
        }
        double row[3] = {p->g[worst][0], p->g[worst][1], 0};
        row[FREE] = p->H[worst] / size;
        if (!solved(M, row, 1, u)) return UNSURE;
        int leaving = -1;
        double least = INFINITY, steepest = 0;
        for (int i = 0; i < D; i++) steepest = larger(steepest, fabs(u[i]));
        for (int i = 0; i < D; i++)
            if (u[i] > FIXED * steepest && y[i] / u[i] < least) least = y[i] / u[i], leaving = i;
        if (leaving < 0) { /* a sum of sides that hold with nothing on the left, broken for any t */
            if (most <= CERTIFIED * size) return UNSURE;
            *t = INFINITY;
            return INFEASIBLE;
        }
        basis[leaving] = worst;
    }
    return UNSURE;
}

/* Efforts and forces at z within their bounds, and how well they meet the equations in M. */
static int certified(const double M[6][COLUMNS], const family_t *a, const bounds_t *b,
                     const polygon_t *p, const double *z, const int *active, const double *price,
                     answer_t *out) {
    double x[EFFORTS], size = 0, terms = 0, error = 0;
    for (int i = 0; i < EFFORTS; i++) {
        x[i] = a->x0[i];
        for (int c = 0; c < FREE; c++) x[i] += a->Z[i][c] * z[c];
        double low = b->low[i] / b->scale[i], high = b->high[i] / b->scale[i];
        x[i] = x[i] < low ? low : x[i] > high ? high : x[i];
        out->effort[i] = x[i] * b->scale[i];
        size = larger(size, fabs(x[i]));
    }
    for (int j = 0; j < CONTACTS; j++) {
        double force = a->lambda0[j];
        for (int c = 0; c < FREE; c++) force += a->L[j][c] * z[c];
        double low = b->contact_low[j], high = b->contact_high[j];
        out->force[j] = force < low ? low : force > high ? high : force;
    }
    for (int i = 0; i < 6; i++) {
        double left = M[i][COLUMNS - 1], sum = fabs(left);
        for (int c = 0; c < COLUMNS - 1; c++) {
            double part = M[i][c] * (c < CONTACTS ? out->force[c] : x[c - CONTACTS]);
            left -= part, sum += fabs(part);
        }
        error = larger(error, fabs(left)), terms = larger(terms, sum);
    }
    out->residual = terms > 0 ? error / terms : 0;
    /* z = -sum price g, with prices of 0 or more. */
    double slack = 0;
    for (int c = 0; c < FREE; c++) {
        double left = z[c];
        for (int i = 0; i < 2; i++)
            if (active[i] >= 0) left += price[i] * p->g[active[i]][c];
        slack = larger(slack, fabs(left));
    }
    for (int i = 0; i < 2; i++)
        if (active[i] >= 0) slack = larger(slack, -price[i]);
    out->dual = size > 0 ? slack / size : slack;
    return out->residual <= CERTIFIED && out->dual <= CERTIFIED;
}

/* One sample, whatever sign its contact forces have.
 * Returns FOUND with the answer, INFEASIBLE with its shortfall, or UNSURE. */
int within_limits(const double Q[6], const double J[][6], const double D[][6], const bounds_t *b,
                  answer_t *out) {
    double M[6][COLUMNS], whole[6][COLUMNS];
    for (int i = 0; i < 6; i++) {
        for (int j = 0; j < CONTACTS; j++) M[i][j] = D[j][i];
        for (int j = 0; j < EFFORTS; j++) M[i][CONTACTS + j] = J[j][i] * b->scale[j];
        M[i][COLUMNS - 1] = Q[i];
    }
    double shorter = 1 / lever(M), size = 0;
    if (!isfinite(shorter)) return UNSURE;
    for (int i = 0; i < 6; i++)
        for (int c = 0; c < COLUMNS; c++) {
            if (i > 2) M[i][c] *= shorter;
            if (!isfinite(M[i][c])) return UNSURE;
            whole[i][c] = M[i][c];
        }
    family_t a;
    polygon_t p;
    double z[2], price[2];
    int active[3];
    if (!family(M, &a)) return UNSURE;
    out->value = centred(&a, b->weight);
    for (int i = 0; i < EFFORTS; i++) size = larger(size, fabs(a.x0[i]));
    if (!(size > 0)) return UNSURE;
    if (!polygon(&a, b, &p)) return UNSURE;
    int status = nearest(&p, size, z, active, price);
    out->shortfall = 1;
    if (status == FOUND) {
        out->value += (z[0] * z[0] + z[1] * z[1]) / 2;
        return certified((const double(*)[COLUMNS])whole, &a, b, &p, z, active, price, out)
                   ? FOUND
                   : UNSURE;
    }
    if (status == INFEASIBLE) status = least_stretch(&p, active, size, &out->shortfall);
    return status == INFEASIBLE && out->shortfall > 1 + CERTIFIED ? INFEASIBLE : UNSURE;
}

/* The least of all signs of the contacts that rub; without an answer the least shortfall. */
static int all_patterns(const double Q[6], const double J[][6], const double N[][6], const double T[][6],
                  const int *rubs, const bounds_t *b, answer_t *best) {
    int patterns = 1, found = 0;
    double shortfall = INFINITY, D[CONTACTS + 1][6];
    for (int j = 0; j < CONTACTS; j++) patterns <<= rubs[j] != 0;
    for (int pattern = 0; pattern < patterns; pattern++) {
        bounds_t own = *b;
        answer_t one;
        int bit = patterns;
        for (int j = 0; j < CONTACTS; j++) {
            double sigma = 0;
            if (rubs[j]) {
                bit >>= 1;
                sigma = pattern & bit ? -1 : 1;
                if (sigma > 0 && own.contact_low[j] < 0) own.contact_low[j] = 0;
                if (sigma < 0 && own.contact_high[j] > 0) own.contact_high[j] = 0;
            }
            for (int i = 0; i < 6; i++) D[j][i] = N[j][i] - sigma * T[j][i];
        }
        int status = UNSURE;
        for (int j = 0; j < CONTACTS; j++)
            if (own.contact_low[j] > own.contact_high[j]) status = INFEASIBLE;
        one.shortfall = INFINITY;
        if (status == UNSURE) status = within_limits(Q, J, (const double(*)[6])D, &own, &one);
        if (status == UNSURE) return UNSURE;
        if (status == INFEASIBLE) {
            if (one.shortfall < shortfall) shortfall = one.shortfall;
            continue;
        }
        if (!found || one.value < best->value - TIE * larger(one.value, best->value)) *best = one;
        found = 1;
    }
    if (!found) best->shortfall = shortfall;
    return found ? FOUND : INFEASIBLE;
}

/* One sample with friction: D = N - sigma T, sigma the signs of the contact forces, which an answer
 * has to have. Returns as `within_limits` does; what friction alone jams is UNSURE. */
int least_pattern(const double Q[6], const double J[][6], const double N[][6], const double T[][6],
                  const int *rubs, const bounds_t *b, answer_t *best) {
    int status = all_patterns(Q, J, N, T, rubs, b, best), rubbing = 0;
    for (int j = 0; j < CONTACTS; j++) rubbing |= rubs[j];
    if (status != INFEASIBLE || !rubbing || !isinf(best->shortfall)) return status;
    bounds_t none = *b;
    answer_t other;
    for (int i = 0; i < EFFORTS; i++) none.low[i] = -INFINITY, none.high[i] = INFINITY;
    for (int j = 0; j < CONTACTS; j++)
        none.contact_low[j] = -INFINITY, none.contact_high[j] = INFINITY;
    return all_patterns(Q, J, N, T, rubs, &none, &other) == FOUND ? INFEASIBLE : UNSURE;
}

/* Samples side by side: rows of Q (6), J (6, EFFORTS), N and T (CONTACTS, 6), each `step` apart.
 *
 * status: FOUND, INFEASIBLE or UNSURE;  effort, force, shortfall: rows `count` apart, written where
 * the status is not UNSURE;  certificate: residual and slack of the multipliers. */
void within_limits_batch(size_t count, const double *const *in, const ptrdiff_t *step,
                         const int *rubs, const bounds_t *b, double *effort, double *force,
                         double *shortfall, double *certificate, uint8_t *status) {
    double Q[BLOCK][6], J[BLOCK][EFFORTS][6], N[BLOCK][CONTACTS + 1][6], T[BLOCK][CONTACTS + 1][6];
    for (size_t start = 0; start < count; start += BLOCK) {
        size_t some = count - start < BLOCK ? count - start : BLOCK;
        /* Columns are far apart in memory: each is read by the block. */
        for (int i = 0; i < 6; i++) {
            const double *from = in[0] + i * step[0] + start;
            for (size_t s = 0; s < some; s++) Q[s][i] = from[s];
            for (int j = 0; j < EFFORTS; j++) {
                from = in[1] + (i * EFFORTS + j) * step[1] + start;
                for (size_t s = 0; s < some; s++) J[s][j][i] = from[s];
            }
            for (int j = 0; j < CONTACTS; j++) {
                from = in[2] + (j * 6 + i) * step[2] + start;
                for (size_t s = 0; s < some; s++) N[s][j][i] = from[s];
                from = in[3] + (j * 6 + i) * step[3] + start;
                for (size_t s = 0; s < some; s++) T[s][j][i] = from[s];
            }
        }
        for (size_t s = 0; s < some; s++) {
            answer_t found;
            size_t to = start + s;
            int own = least_pattern(Q[s], (const double(*)[6])J[s], (const double(*)[6])N[s],
                                    (const double(*)[6])T[s], rubs, b, &found);
            status[to] = (uint8_t)own;
            if (own == UNSURE) continue;
            for (int i = 0; i < EFFORTS; i++)
                effort[i * count + to] = own == FOUND ? found.effort[i] : NAN;
            for (int j = 0; j < CONTACTS; j++)
                force[j * count + to] = own == FOUND ? found.force[j] : NAN;
            shortfall[to] = found.shortfall;
            certificate[to] = own == FOUND ? found.residual : NAN;
            certificate[count + to] = own == FOUND ? found.dual : NAN;
        }
    }
}
