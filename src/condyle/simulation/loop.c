/* Runs with fixed steps of Runge and Kutta, as `run.py` and `integrators/rk4.py` have them: plant,
 * loads and controllers, over kernels that are given by address. Mechanisms are numbers here.
 *
 * What is rare is left to the caller, who goes on from there: steps in which a guard passes zero,
 * states that a kernel cannot vouch for, controllers that are not written below. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { DONE, PAUSE, STEP, LOOK };    /* why `advance` returns; PAUSE: after `budget` steps */
enum { CONSTANT, TABLE, SPRING, FOOD };              /* loads */
enum { APART, TOUCHING, BROKEN };                    /* modes of food */
enum { BOUND, LIFT_OFF, SPEED };                     /* guards */
enum { OPEN, ELSEWHERE, JOINT_PD, COMPUTED_TORQUE, BITE_FORCE }; /* who chooses efforts */
enum { FREE, BITING, LEAVING };                      /* of a bite */
enum { ITERATIONS = 8 };                             /* from encoders to a pose */
enum { STATE = 16, LANES = 64 };                     /* most of 2 m + 4, and of n */

/* One evaluation, and places for what goes in and out. */
typedef struct {
    int (*one)(const double *table, const double *in, double *out);
    const double *table;
    double *in, *out;
} Kernel;

/* numbers: constant: wrench; spring: u, stiffness, damping, rest; food: u, thickness, stiffness,
 * damping, break force, break thickness. times, rows: of a table, `count` rows of six. */
typedef struct {
    int64_t kind, mode, count;
    double point[3], numbers[8];
    const double *times, *rows;
} Load;

/* order: where lane j stands among the callers' chains. Results of `instant` begin at `pose`, ..
 * guard_*: kind, contact or lane, and sign of the push or limit of the speed; past: whether a guard
 * is beyond zero already. low, high: bounds of contacts, (k, 3). */
typedef struct {
    int64_t m, n, k, loads, guards;
    const int64_t *order, *guard_kind, *guard_index;
    const double *guard_value, *low, *high;
    const uint8_t *past;
    int64_t pose, R, T, joint, joint_rate, loss, contact_point, rub;
    Kernel instant, forward;
    Load *load;
} Plant;

/* Encoders, as of `sensing.py`. at: the question `instant` of the controller's model, its results and
 * lanes; resolution, turning, weight, before, rate (n,) in the callers' order; scale, q, q1 (m,). */
typedef struct {
    int64_t on, difference, joint, A;
    double smoothing, period;
    Kernel at;
    const int64_t *order;
    const double *resolution, *weight, *scale;
    const uint8_t *turning;
    double *q, *q1, *before, *rate;
    uint8_t *first;
} Observer;

/* A bite, as of `controllers/bite_force.py`. felt: per load, whether it acts at the point. */
typedef struct {
    int64_t R, T, inertia;
    double point[3], direction[3], proportional, integral, damping, threshold, release, period;
    Kernel at;
    const uint8_t *felt;
    double *memory, *force;
} Bite;

/* The run. corners (C,) [s]; is_tick (C,): whether the controller looks there.
 * Open loop: efforts (R, n) at effort_times (R,). Closed: aims (K, 3 m + 2 n + 1): q, q', q'', joint,
 * rate, force; gains: stiffness and damping, of the coordinates or of the chains; inverse: of its own
 * model. Results: times (N,); state (N, 2 m + 4), modes, effort, tick; of looks command and counts
 * (K, n), estimate (K, 2 m). y, effort, limits and all results are in the callers' order. */
typedef struct {
    Plant plant;
    int64_t corners, corner, fresh, budget, drive, tick, delay, gravity, rows;
    const double *corner_time;
    const uint8_t *is_tick;
    double step, t;
    double *y, *effort;
    const double *min, *max;
    uint8_t *cut;
    const double *effort_times, *efforts, *aims, *stiffness, *damping;
    Kernel inverse;
    const int64_t *inverse_order;
    double *command, *counts, *estimate;
    const double *times;
    int64_t count, next;
    double *kept_state, *kept_effort;
    int8_t *kept_modes;
    int64_t *kept_tick;
    Observer observer;
    Bite bite;
} Run;

static double dot3(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* How many of rising times are at or before t. */
static int64_t passed_by(const double *times, int64_t count, double t) {
    int64_t low = 0, high = count;
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (times[middle] <= t) low = middle + 1;
        else high = middle;
    }
    return low;
}

/* -- loads -------------------------------------------------------------------------------- */

static double squeeze(const Load *l, const double *s) {
    return l->numbers[3] + dot3(l->numbers, s);
}

static double push(const Load *l, const double *s, const double *v) {
    const double *p = l->numbers;
    return p[4] * squeeze(l, s) + p[5] * fmax(dot3(p, v), 0.0);
}

/* Force and moment at the point. */
static void law(const Load *l, double t, const double *s, const double *v, double *f) {
    const double *p = l->numbers;
    double along = 0;
    memset(f, 0, 6 * sizeof *f);
    switch (l->kind) {
    case CONSTANT:
        memcpy(f, p, 6 * sizeof *f);
        return;
    case TABLE: {
        int64_t i = passed_by(l->times, l->count, t);
        if (i == 0 || (i == l->count && t > l->times[l->count - 1])) return;
        if (i == l->count) i--;
        const double *row = l->rows + 6 * i;
        double part = (t - l->times[i - 1]) / (l->times[i] - l->times[i - 1]);
        for (int j = 0; j < 6; j++) f[j] = row[j - 6] + part * (row[j] - row[j - 6]);
        return;
    }
    case SPRING:
        along = -(p[3] * (dot3(p, s) - p[5]) + p[4] * dot3(p, v));
        break;
    case FOOD:
        if (l->mode == TOUCHING && squeeze(l, s) > 0) along = -push(l, s, v);
        break;
    }
    for (int j = 0; j < 3; j++) f[j] = along * p[j];
}

/* Whether a guard of the load is beyond zero. */
static int jumps(const Load *l, const double *s, const double *v) {
    if (l->kind != FOOD) return 0;
    const double *p = l->numbers;
    double q = squeeze(l, s);
    if (l->mode == APART) return q > 0;
    if (l->mode == BROKEN) return q < 0;
    return q < 0 || push(l, s, v) > p[6] || p[3] - q < p[7];
}

/* -- the plant ------------------------------------------------------------------------------ */

/* A load's point at the last look: displacement, velocity, lever. */
static void place(const Plant *p, const Load *l, const double *twist, double *s, double *v,
                  double *r) {
    const double *x = p->instant.out + p->pose, *R = p->instant.out + p->R, *at = l->point;
    for (int i = 0; i < 3; i++) r[i] = dot3(R + 3 * i, at);
    for (int i = 0; i < 3; i++) s[i] = x[i] + r[i] - at[i];
    v[0] = twist[0] + twist[4] * r[2] - twist[5] * r[1];
    v[1] = twist[1] + twist[5] * r[0] - twist[3] * r[2];
    v[2] = twist[2] + twist[3] * r[1] - twist[4] * r[0];
}

static int look(const Plant *p, const double *y, double *twist) {
    memcpy(p->instant.in, y, (size_t)(2 * p->m) * sizeof *y);
    int status = p->instant.one(p->instant.table, p->instant.in, p->instant.out);
    const double *T = p->instant.out + p->T;
    for (int i = 0; i < 6; i++) {
        twist[i] = 0;
        for (int j = 0; j < p->m; j++) twist[i] += T[i * p->m + j] * y[p->m + j];
    }
    return status;
}

/* y' at y; returns the status of the kernels. */
static int rate(const Plant *p, double t, const double *y, const double *effort, double *twist,
                double *f) {
    int64_t m = p->m, n = p->n, k = p->k;
    int status = look(p, y, twist);
    if (status) return status;
    double wrench[6] = {0};
    for (int i = 0; i < p->loads; i++) {
        double s[3], v[3], r[3], g[6];
        place(p, p->load + i, twist, s, v, r);
        law(p->load + i, t, s, v, g);
        for (int j = 0; j < 6; j++) wrench[j] += g[j];
        wrench[3] += r[1] * g[2] - r[2] * g[1];
        wrench[4] += r[2] * g[0] - r[0] * g[2];
        wrench[5] += r[0] * g[1] - r[1] * g[0];
    }
    double *in = p->forward.in;
    const double *at = p->instant.out, *out = p->forward.out;
    memcpy(in, y, (size_t)(2 * m) * sizeof *y);
    for (int j = 0; j < n; j++) in[2 * m + j] = effort[p->order[j]];
    memcpy(in + 2 * m + n, wrench, sizeof wrench);
    status = p->forward.one(p->forward.table, in, p->forward.out);
    if (status) return status;
    double power = 0, loss = 0, load = 0, rubbed = 0;
    for (int j = 0; j < n; j++) {
        power += effort[p->order[j]] * at[p->joint_rate + j];
        loss += at[p->loss + j];
    }
    for (int i = 0; i < 6; i++) load += wrench[i] * twist[i];
    for (int i = 0; i < k; i++) rubbed += fabs(out[m + i]) * at[p->rub + i];
    for (int i = 0; i < m; i++) f[i] = y[m + i], f[m + i] = out[i];
    f[2 * m] = power, f[2 * m + 1] = load, f[2 * m + 2] = loss, f[2 * m + 3] = rubbed;
    return 0;
}

/* Whether a guard is on the other side of zero than it was, at the state of the last rate. */
static int passed(const Plant *p, const double *twist) {
    const double *at = p->instant.out;
    for (int g = 0; g < p->guards; g++) {
        int64_t i = p->guard_index[g];
        double value = 0, margin = INFINITY;
        switch (p->guard_kind[g]) {
        case BOUND:
            for (int a = 0; a < 3; a++) {
                double x = at[p->contact_point + 3 * i + a];
                margin = fmin(margin, fmin(x - p->low[3 * i + a], p->high[3 * i + a] - x));
            }
            value = -margin;
            break;
        case LIFT_OFF:
            value = -p->guard_value[g] * p->forward.out[p->m + i];
            break;
        case SPEED:
            value = fabs(at[p->joint_rate + i]) - p->guard_value[g];
            break;
        }
        if ((value > 0) != p->past[g]) return 1;
    }
    for (int i = 0; i < p->loads; i++) {
        double s[3], v[3], r[3];
        place(p, p->load + i, twist, s, v, r);
        if (jumps(p->load + i, s, v)) return 1;
    }
    return 0;
}

/* -- efforts -------------------------------------------------------------------------------- */

/* Efforts at t, within limits, in open loop. */
static void given(const Run *r, double t, double *effort) {
    int64_t n = r->plant.n, after = passed_by(r->effort_times, r->rows, t);
    int64_t before = after > 0 ? after - 1 : 0;
    if (after == r->rows) after = before;
    double width = r->effort_times[after] - r->effort_times[before];
    double part = width > 0 ? (t - r->effort_times[before]) / width : 0;
    for (int j = 0; j < n; j++) {
        double a = r->efforts[before * n + j], b = r->efforts[after * n + j];
        effort[j] = fmin(fmax(a + part * (b - a), r->min[j]), r->max[j]);
    }
}

/* What a controller sees, in the callers' order. */
typedef struct {
    double q[STATE], q1[STATE], joint[LANES], rate[LANES];
} Seen;

/* x of M x = b, (m, m), by elimination with pivots, both overwritten; 0 where there is none. */
static int solved(double *M, double *b, int64_t m) {
    for (int64_t k = 0; k < m; k++) {
        int64_t p = k;
        for (int64_t i = k + 1; i < m; i++)
            if (fabs(M[i * m + k]) > fabs(M[p * m + k])) p = i;
        if (!(fabs(M[p * m + k]) > 0)) return 0;
        for (int64_t j = 0; j < m; j++) {
            double held = M[k * m + j];
            M[k * m + j] = M[p * m + j], M[p * m + j] = held;
        }
        double held = b[k];
        b[k] = b[p], b[p] = held;
        for (int64_t i = k + 1; i < m; i++) {
            double f = M[i * m + k] / M[k * m + k];
            for (int64_t j = k; j < m; j++) M[i * m + j] -= f * M[k * m + j];
            b[i] -= f * b[k];
        }
    }
    for (int64_t k = m - 1; k >= 0; k--) {
        for (int64_t j = k + 1; j < m; j++) b[k] -= M[k * m + j] * b[j];
        b[k] /= M[k * m + k];
    }
    return 1;
}

/* x of A x ~ right (n,), by least squares with the observer's weights, at its last look. */
static int fitted(const Observer *o, int64_t m, int64_t n, const double *right, double *x) {
    double M[36] = {0};
    for (int i = 0; i < m; i++) x[i] = 0;
    for (int j = 0; j < n; j++) {
        const double *row = o->at.out + o->A + j; /* entry i stands n i further */
        double w = o->weight[o->order[j]] * o->weight[o->order[j]];
        for (int i = 0; i < m; i++) {
            x[i] += w * row[n * i] * right[o->order[j]];
            for (int k = 0; k < m; k++) M[i * m + k] += w * row[n * i] * row[n * k];
        }
    }
    return solved(M, x, m);
}

static int observed_at(const Observer *o, int64_t m, const double *q, const double *q1) {
    memcpy(o->at.in, q, (size_t)m * sizeof *q);
    memcpy(o->at.in + m, q1, (size_t)m * sizeof *q);
    return o->at.one(o->at.table, o->at.in, o->at.out);
}

/* The state that the encoders' counts give, in place of the true one; whether they give any. */
static int observed(const Observer *o, int64_t m, int64_t n, Seen *seen) {
    const double turn = 6.283185307179586;
    double off[LANES], dq[6], largest = INFINITY;
    int first = o->first[0];
    for (int j = 0; j < n; j++) {
        double step = o->resolution[j], part = o->smoothing, count = seen->joint[j];
        if (step > 0) count = step * nearbyint(count / step);
        if (o->difference && first) seen->rate[j] = o->rate[j];
        else if (o->difference)
            seen->rate[j] = part * o->rate[j] + (1 - part) * (count - o->before[j]) / o->period;
        seen->joint[j] = count;
    }
    for (int i = 0; i < m; i++) seen->q[i] = first ? o->q[i] : o->q[i] + o->period * o->q1[i];
    for (int k = 0; k < ITERATIONS && !(largest < 1e-13); k++) {
        if (observed_at(o, m, seen->q, o->q1)) return 0;
        for (int j = 0; j < n; j++) {
            int64_t i = o->order[j];
            off[i] = seen->joint[i] - o->at.out[o->joint + j];
            if (o->turning[i]) off[i] -= turn * nearbyint(off[i] / turn);
        }
        if (!fitted(o, m, n, off, dq)) return 0;
        largest = 0;
        for (int i = 0; i < m; i++) {
            seen->q[i] += dq[i];
            if (!(fabs(dq[i] / o->scale[i]) <= largest)) largest = fabs(dq[i] / o->scale[i]);
        }
    }
    return largest < 1e-6 && fitted(o, m, n, seen->rate, seen->q1);
}

/* The load that a bite's efforts bear, and what it does to the acceleration; whether there is. */
static int bitten(const Run *r, const Seen *seen, const double *aim, const double *force,
                  double *acceleration, double *load, double *memory) {
    const Bite *b = &r->bite;
    const double *u = b->direction, *out = b->at.out;
    int64_t m = r->plant.m, n = r->plant.n;
    double J[6], by[6], M[36], lever[3], ahead = 0, closing = 0, along = 0, speed = 0, mass = 0;
    memcpy(b->at.in, seen->q, (size_t)m * sizeof *J);
    memcpy(b->at.in + m, seen->q1, (size_t)m * sizeof *J);
    if (b->at.one(b->at.table, b->at.in, b->at.out)) return 0;
    for (int i = 0; i < 3; i++) lever[i] = dot3(out + b->R + 3 * i, b->point);
    double turned[3] = {lever[1] * u[2] - lever[2] * u[1], lever[2] * u[0] - lever[0] * u[2],
                        lever[0] * u[1] - lever[1] * u[0]};
    for (int i = 0; i < m; i++) {
        J[i] = 0;
        for (int a = 0; a < 3; a++)
            J[i] += u[a] * out[b->T + a * m + i] + turned[a] * out[b->T + (3 + a) * m + i];
        ahead += J[i] * (aim[i] - seen->q[i]);
        closing += J[i] * aim[m + i];
        along += J[i] * acceleration[i];
        speed += J[i] * seen->q1[i];
        by[i] = J[i];
    }
    double felt = -dot3(u, force), push = felt;
    int mode = (int)memory[0];
    if (felt < b->threshold / 2) mode = FREE;
    else if (mode == BITING) mode = ahead < -b->release && closing < 0 ? LEAVING : BITING;
    else if (mode == FREE && felt > b->threshold && closing > 0) mode = BITING;
    double total = mode == BITING ? memory[1] : 0;
    if (mode == BITING) {
        double wanted = aim[3 * m + 2 * n], error = wanted - felt;
        memcpy(M, out + b->inertia, (size_t)(m * m) * sizeof *M);
        if (!solved(M, by, m)) return 0;
        for (int i = 0; i < m; i++) mass += J[i] * by[i];
        for (int i = 0; i < m; i++) acceleration[i] -= by[i] / mass * (along + b->damping * speed);
        push = wanted + b->proportional * error + b->integral * total;
        total += error * b->period;
    }
    for (int a = 0; a < 3; a++) load[a] = -push * u[a], load[3 + a] = 0, load[6 + a] = b->point[a];
    memory[0] = mode, memory[1] = total;
    return 1;
}

/* The controller looks: 0, or LOOK where the caller has to. */
static int controlled(Run *r) {
    const Plant *p = &r->plant;
    const Observer *o = &r->observer;
    int64_t m = p->m, n = p->n, k = r->tick + 1;
    double twist[6], asked[LANES], now[LANES], *in = r->inverse.in, force[3] = {0}, memory[2];
    const double *at = p->instant.out, *aim = r->aims + k * (3 * m + 2 * n + 1);
    Seen seen;
    if (r->drive == ELSEWHERE || look(p, r->y, twist)) return LOOK;
    memcpy(seen.q, r->y, (size_t)m * sizeof *seen.q);
    memcpy(seen.q1, r->y + m, (size_t)m * sizeof *seen.q);
    for (int j = 0; j < n; j++) {
        seen.joint[p->order[j]] = at[p->joint + j];
        seen.rate[p->order[j]] = at[p->joint_rate + j];
    }
    if (r->drive == BITE_FORCE)
        for (int i = 0; i < p->loads; i++) {
            double s[3], v[3], lever[3], f[6];
            if (!r->bite.felt[i]) continue;
            place(p, p->load + i, twist, s, v, lever);
            law(p->load + i, r->t, s, v, f);
            for (int a = 0; a < 3; a++) force[a] += f[a];
        }
    if (o->on && !observed(o, m, n, &seen)) return LOOK;
    memset(in, 0, (size_t)(3 * m + 9) * sizeof *in);
    memset(asked, 0, (size_t)n * sizeof *asked);
    memcpy(in, r->drive == JOINT_PD ? aim : seen.q, (size_t)m * sizeof *in);
    if (r->drive != JOINT_PD)
        for (int i = 0; i < m; i++) {
            in[m + i] = seen.q1[i];
            in[2 * m + i] = aim[2 * m + i] + r->damping[i] * (aim[m + i] - seen.q1[i]) +
                            r->stiffness[i] * (aim[i] - seen.q[i]);
        }
    if (r->drive == BITE_FORCE) {
        memcpy(memory, r->bite.memory, sizeof memory);
        if (!bitten(r, &seen, aim, force, in + 2 * m, in + 3 * m, memory)) return LOOK;
    }
    if (r->drive != JOINT_PD || r->gravity) {
        if (r->inverse.one(r->inverse.table, in, r->inverse.out)) return LOOK;
        for (int j = 0; j < n; j++) asked[r->inverse_order[j]] = r->inverse.out[j];
    }
    for (int i = 0; i < n && r->drive == JOINT_PD; i++)
        asked[i] += r->stiffness[i] * (aim[3 * m + i] - seen.joint[i]) +
                    r->damping[i] * (aim[3 * m + n + i] - seen.rate[i]);
    memcpy(r->command + k * n, asked, (size_t)n * sizeof *asked);
    const double *due = r->command + (k > r->delay ? k - r->delay : 0) * n;
    for (int j = 0; j < n; j++) {
        now[j] = fmin(fmax(due[j], r->min[j]), r->max[j]);
        if (!isfinite(asked[j]) || (now[j] != due[j]) != r->cut[j]) return LOOK;
    }
    /* Nothing is handed back any more: what lasts until the next look. */
    memcpy(r->effort, now, (size_t)n * sizeof *now);
    memcpy(r->counts + k * n, seen.joint, (size_t)n * sizeof *now);
    memcpy(r->estimate + k * 2 * m, seen.q, (size_t)m * sizeof *seen.q);
    memcpy(r->estimate + k * 2 * m + m, seen.q1, (size_t)m * sizeof *seen.q);
    if (o->on) {
        memcpy(o->q, seen.q, (size_t)m * sizeof *seen.q);
        memcpy(o->q1, seen.q1, (size_t)m * sizeof *seen.q);
        memcpy(o->before, seen.joint, (size_t)n * sizeof *now);
        memcpy(o->rate, seen.rate, (size_t)n * sizeof *now);
        o->first[0] = 0;
    }
    if (r->drive == BITE_FORCE) {
        memcpy(r->bite.memory, memory, sizeof memory);
        r->bite.force[k] = sqrt(dot3(force, force));
    }
    r->tick = k;
    return 0;
}

/* -- time ----------------------------------------------------------------------------------- */

/* States at the results' times before `end`, by the cubic with these values and rates. */
static void keep(Run *r, double t, double h, double end, const double *y0, const double *f0,
                 const double *y1, const double *f1) {
    int64_t n = r->plant.n, loads = r->plant.loads, size = 2 * r->plant.m + 4;
    for (; r->next < r->count && r->times[r->next] < end - 1e-12; r->next++) {
        double when = fmax(r->times[r->next], t), s = (when - t) / h;
        double a = s * s * (3 - 2 * s), b = h * s * (1 - s);
        double *state = r->kept_state + r->next * size, *effort = r->kept_effort + r->next * n;
        for (int i = 0; i < size; i++)
            state[i] = y0[i] + a * (y1[i] - y0[i]) + b * ((1 - s) * f0[i] - s * f1[i]);
        if (r->drive == OPEN) given(r, r->times[r->next], effort);
        else memcpy(effort, r->effort, (size_t)n * sizeof *effort);
        for (int i = 0; i < loads; i++)
            r->kept_modes[r->next * loads + i] = (int8_t)r->plant.load[i].mode;
        r->kept_tick[r->next] = r->tick;
    }
}

/* y' with the efforts that act then. */
static int slope(Run *r, double t, const double *y, double *twist, double *f) {
    double effort[LANES];
    if (r->drive != OPEN) return rate(&r->plant, t, y, r->effort, twist, f);
    given(r, t, effort);
    return rate(&r->plant, t, y, effort, twist, f);
}

/* Equal steps to `until`. */
static int between(Run *r, double until) {
    int64_t size = 2 * r->plant.m + 4;
    double start = r->t, *y = r->y, twist[6], f0[STATE];
    int64_t steps = (int64_t)fmax(ceil((until - start) / r->step - 1e-9), 1);
    double h = (until - start) / (double)steps;
    if (slope(r, start, y, twist, f0) || passed(&r->plant, twist)) return STEP;
    for (int64_t k = 0; k < steps; k++) {
        double k2[STATE], k3[STATE], k4[STATE], f1[STATE], y1[STATE];
        double t0 = start + (double)k * h, t1 = k + 1 < steps ? start + (double)(k + 1) * h : until;
        if (r->budget-- <= 0) return PAUSE;
        for (int i = 0; i < size; i++) y1[i] = y[i] + h / 2 * f0[i];
        if (slope(r, t0 + h / 2, y1, twist, k2)) return STEP;
        for (int i = 0; i < size; i++) y1[i] = y[i] + h / 2 * k2[i];
        if (slope(r, t0 + h / 2, y1, twist, k3)) return STEP;
        for (int i = 0; i < size; i++) y1[i] = y[i] + h * k3[i];
        if (slope(r, t1, y1, twist, k4)) return STEP;
        for (int i = 0; i < size; i++)
            y1[i] = y[i] + h / 6 * (f0[i] + 2 * (k2[i] + k3[i]) + k4[i]);
        if (slope(r, t1, y1, twist, f1) || passed(&r->plant, twist)) return STEP;
        keep(r, t0, h, t1, y, f0, y1, f1);
        memcpy(y, y1, (size_t)size * sizeof *y);
        memcpy(f0, f1, (size_t)size * sizeof *f0);
        r->t = t1;
    }
    return 0;
}

/* From where the run is to its end, or to what the caller has to see to. */
int advance(Run *r) {
    for (; r->corner + 1 < r->corners; r->corner++, r->fresh = 1) {
        int code;
        if (r->fresh) {
            r->t = r->corner_time[r->corner];
            if (r->is_tick[r->corner] && (code = controlled(r))) return code;
            r->fresh = 0;
        }
        if ((code = between(r, r->corner_time[r->corner + 1]))) return code;
    }
    return DONE;
}
