/* The controller of "@name@". See @prefix@_controller.h. */
#include "@prefix@_controller.h"

#include <math.h>
#include <string.h>

#define N @PREFIX@_JOINTS
#define M @PREFIX@_FREE
#define STILL 0.1 /* of the tolerance: a joint that moves less than this stands at a stop */

const @prefix@_settings @PREFIX@_SETTINGS = {
    @values@};
@tables@
/* The next state, of state and event. */
enum { @events@ };
static const unsigned char NEXT[5][7] = {
@next@
};
static const unsigned HOLDS = @holds@; /* causes with which the law can hold the pose */

static int number(double x) { return fabs(x) < 1e50; }

/* Of a duration that has passed: 0 to 1. */
static double share(double t, double duration)
{
    return duration > 0.0 ? fmin(fmax(t / duration, 0.0), 1.0) : 1.0;
}

/* An offset that begins with a position, a rate and an acceleration, and goes to 0: the rate within T,
   on the way d1 T / 2, and what is left within `homing`. Both of fifth order. */
static void fade(double homing, double T, double t, const double d[3], double s[3])
{
    const double v = d[1] * T, a = d[2] * T * T, D = d[0] + v / 2.0;
    const double x = share(t, homing), y = 1.0 - x, z = share(t, T);
    s[0] = D * (1.0 - x * x * x * (10.0 + x * (6.0 * x - 15.0)));
    s[1] = s[2] = 0.0;
    if (y > 0.0) {
        s[1] -= D * 30.0 * x * x * y * y / homing;
        s[2] -= D * 60.0 * x * y * (y - x) / (homing * homing);
    }
    if (z < 1.0) {
        const double b = -v - 1.5 * a, c = 0.5 * v + 1.5 * a, e = -0.5 * a;
        s[0] += z * (v + z * (a / 2.0 + z * (b + z * (c + z * e)))) - v / 2.0;
        s[1] += (v + z * (a + z * (3.0 * b + z * (4.0 * c + z * 5.0 * e)))) / T;
        s[2] += (a + z * (6.0 * b + z * (12.0 * c + z * 20.0 * e))) / (T * T);
    }
}

int @prefix@_begin(@prefix@_controller *c, const @prefix@_settings *settings, const double q[M],
                   const double q1[M], const @prefix@_measured *measured, int state,
                   @prefix@_record *log, int rows)
{
    double joint[N], rate[N], pose[6], pose_rate[6];
    const int status = @prefix@_joints(q, q1, joint, rate, pose, pose_rate);
    int i;
    memset(c, 0, sizeof *c);
    if (state < @PREFIX@_OFF || state > @PREFIX@_SAFE_STOP) state = @PREFIX@_OFF;
    c->settings = *settings;
    c->state = state;
    c->begun = state == @PREFIX@_OFF;
    c->enable = c->known = state != @PREFIX@_OFF;
    c->status = status;
    c->scale = state == @PREFIX@_OFF ? 0.0 : 1.0;
    c->log = log;
    c->rows = log == NULL || rows < 0 ? 0 : rows;
    memcpy(c->q, q, sizeof c->q);
    memcpy(c->q1, q1, sizeof c->q1);
    memcpy(c->goal, q, sizeof c->goal);
    memcpy(c->follow, q, sizeof c->follow);
@start@    if (status != @PREFIX@_OK) return status;
    for (i = 0; i < N; i++) {
        const int absolute = measured != NULL && (c->known || settings->search == @PREFIX@_NO_SEARCH);
        const double reading = absolute ? measured->joint[i] : joint[i] + ZERO[i];
        const double step = RESOLUTION[i];
        c->joint_kept[i] = reading;
        c->stood[i] = reading - ZERO[i];
        c->rate_kept[i] = c->joint_rate_before[i] = rate[i];
        joint[i] = (step > 0.0 ? reading - remainder(reading, step) : reading) - ZERO[i];
        c->joint_before[i] = joint[i] - settings->period * rate[i];
    }
    memcpy(c->pose_before, pose, sizeof c->pose_before);
@reset@    return status;
}

int @prefix@_reference_at(const double q[M], const double q1[M], const double q2[M], double force,
                          @prefix@_reference *r)
{
    double pose[6], pose_rate[6];
    memcpy(r->q, q, sizeof r->q);
    memcpy(r->q1, q1, sizeof r->q1);
    memcpy(r->q2, q2, sizeof r->q2);
    r->force = force;
    return @prefix@_joints(q, q1, r->joint, r->joint_rate, pose, pose_rate);
}

/* Whether the law is asked for nothing: efforts are off, or fade. */
static int free_now(const @prefix@_controller *c)
{
    return c->state == @PREFIX@_OFF || (c->state == @PREFIX@_SAFE_STOP && c->releasing);
}

static void release(@prefix@_controller *c)
{
    c->releasing = 1;
    c->entered = c->clock;
    memcpy(c->braking, c->effort, sizeof c->braking);
}

/* What is followed goes on from where it is: to the reference, or to the goal. */
static void lead(@prefix@_controller *c, int run, const @prefix@_reference *r)
{
    const double T = c->settings.period;
    int i;
    for (i = 0; i < M; i++) {
        c->offset[i] = c->follow[i]
                       - (run ? r->q[i] - T * (r->q1[i] - T / 2.0 * r->q2[i]) : c->goal[i]);
        c->offset_1[i] = c->follow_1[i] - (run ? r->q1[i] - T * r->q2[i] : 0.0);
        c->offset_2[i] = c->follow_2[i] - (run ? r->q2[i] : 0.0);
    }
}

/* Enters the next state, so that what is followed changes smoothly. Returns whether there is one. */
static int turn(@prefix@_controller *c, int event, const @prefix@_reference *r)
{
    const int before = c->state, state = NEXT[before][event];
    int i;
    if (state == before) return 0;
    c->state = state;
    c->entered = c->clock - c->settings.period; /* what was followed is of the last tick */
    c->searching = state == @PREFIX@_HOMING && c->settings.search != @PREFIX@_NO_SEARCH && !c->known;
    c->known |= event == DONE && before == @PREFIX@_HOMING;
    if (before == @PREFIX@_OFF) {
        for (i = 0; i < M; i++) c->goal[i] = c->searching ? c->q[i] + c->settings.reach[i] : r->q[i];
        memcpy(c->due, c->correction, sizeof c->due);
        memcpy(c->uncorrected, c->correction, sizeof c->uncorrected);
        memset(c->seen, 0, sizeof c->seen);
        c->pressed = 0.0;
        memset(c->taxed, 0, sizeof c->taxed);
        c->scale = c->unloaded = 0.0;
        for (i = 0; i < N; i++) c->stood[i] = r->joint[i];
@reset@    }
    if (before == @PREFIX@_RUN || (before == @PREFIX@_HOMING && event != DONE))
        for (i = 0; i < M; i++)
            c->goal[i] = c->follow[i] + c->follow_1[i] * c->settings.halting / 2.0;
    lead(c, state == @PREFIX@_RUN, r);
    c->releasing = 0;
    return 1;
}

/* The next state, by what is wanted. */
static void decide(@prefix@_controller *c, int wanted, const @prefix@_reference *r)
{
    static const int events[] = {0, 3, 1, 2}; /* of the next state's table */
    const int event = wanted < 0 || wanted > @PREFIX@_WANT_RUN ? 3 : events[wanted];
    const double since = c->clock - c->entered;
    if (c->state == @PREFIX@_OFF) {
        if (wanted == @PREFIX@_WANT_OFF) { /* somebody has seen why it stopped */
            c->why = @PREFIX@_FINE;
            c->faults = 0;
        }
        if (c->why == @PREFIX@_FINE && !c->active) turn(c, event, r);
    } else if (!turn(c, event, r)) {
        if (c->state == @PREFIX@_HOMING && !c->searching
            && since >= fmax(c->settings.homing, c->settings.halting))
            turn(c, DONE, r);
        if (c->state != @PREFIX@_SAFE_STOP) return;
        if (c->releasing && since >= c->settings.stopping) turn(c, DONE, r);
    }
    if (c->state == @PREFIX@_SAFE_STOP && !c->releasing) {
        const int stop = c->settings.stop;
        const int holds = stop == @PREFIX@_HOLD_ON
                              ? wanted != @PREFIX@_WANT_OFF
                              : stop == @PREFIX@_HOLD_THEN_RELEASE && since < c->settings.hold;
        if (!holds || (c->faults & ~HOLDS)) release(c);
    }
}

/* What the law is to follow now: smooth from where the machine is to the reference. */
static int aim(@prefix@_controller *c, const @prefix@_reference *r, @prefix@_reference *to)
{
    const int run = c->state == @PREFIX@_RUN;
    const double homing = c->searching ? c->settings.within : c->settings.homing;
    int i, moved = 0;
    if (free_now(c)) {
        memcpy(c->follow, c->q, sizeof c->follow);
        memcpy(c->follow_1, c->q1, sizeof c->follow_1);
        memset(c->follow_2, 0, sizeof c->follow_2);
        to->force = 0.0;
        return @prefix@_reference_at(c->q, c->follow_2, c->follow_2, 0.0, to);
    }
    for (i = 0; i < M; i++) {
        const double d[3] = {c->offset[i], c->offset_1[i], c->offset_2[i]};
        double s[3];
        fade(homing, c->settings.halting, c->clock - c->entered, d, s);
        moved |= s[0] != 0.0 || s[1] != 0.0 || s[2] != 0.0;
        c->follow[i] = (run ? r->q[i] : c->goal[i]) + s[0];
        c->follow_1[i] = (run ? r->q1[i] : 0.0) + s[1];
        c->follow_2[i] = (run ? r->q2[i] : 0.0) + s[2];
    }
    if (run && !moved) {
        *to = *r;
        return @PREFIX@_OK;
    }
    return @prefix@_reference_at(c->follow, c->follow_1, c->follow_2, r->force, to);
}

static void write_down(@prefix@_controller *c, double now, const @prefix@_measured *m,
                       const @prefix@_reference *to)
{
    @prefix@_record *row;
    if (c->rows == 0) return;
    row = c->log + c->logged % (unsigned)c->rows;
    if (++c->logged == 2u * (unsigned)c->rows) c->logged = (unsigned)c->rows;
    row->t = now;
    row->state = c->state;
    row->status = c->status;
    memcpy(row->joint, m->joint, sizeof row->joint);
    memcpy(row->joint_rate, m->joint_rate, sizeof row->joint_rate);
    memcpy(row->effort, c->effort, sizeof row->effort);
    memcpy(row->q, c->q, sizeof row->q);
    memcpy(row->q1, c->q1, sizeof row->q1);
    memcpy(row->q_d, to->q, sizeof row->q_d);
}

/* Counts bad ticks, less what good ones take away; after too many, one good tick is enough to begin
   again. Returns whether there are too many. */
static int too_many(double *count, int bad, int most, double recovery)
{
    *count = bad ? fmin(*count + 1.0, most + recovery) : fmax(*count - recovery, 0.0);
    return bad && *count > most;
}

/* By how much time has moved on, whatever the clock says. Returns whether it was in time. */
static int in_time(@prefix@_controller *c, double now)
{
    const double period = c->settings.period, dt = c->timed ? now - c->last : period;
    if (fabs(dt) > c->settings.gap * period) c->active |= 1u << @PREFIX@_LATE;
    c->clock += dt > 0.0 && dt <= c->settings.gap * period ? dt : period;
    c->timed |= number(now);
    if (number(now)) c->last = now;
    return dt > 0.0 && dt <= c->settings.late * period;
}

/* Lost encoders: carried on by their rates for a few ticks. Returns the cause, FINE without any. */
static int lost_readings(@prefix@_controller *c, @prefix@_measured *m)
{
    const @prefix@_settings *given = &c->settings;
    int i, cause = @PREFIX@_FINE;
    for (i = 0; i < N; i++) {
        const double step = c->counts[1] > given->lost_most ? 0.0 : given->period * c->rate_kept[i];
        const double expected = c->joint_kept[i] + step;
        const int gone = m->lost[i] || !number(m->joint[i]) || !number(m->joint_rate[i]);
        const int jumps = !gone && !free_now(c) && fabs(m->joint[i] - expected) > given->jump;
        if (gone || jumps) {
            m->joint[i] = expected;
            m->joint_rate[i] = c->rate_kept[i];
            if (cause != @PREFIX@_ENCODER) cause = jumps ? @PREFIX@_ENCODER : @PREFIX@_LOST;
        }
        c->joint_kept[i] = m->joint[i];
    }
    return cause;
}

/* Readings with what they are off: before a search by where it began, and then, little by little on
   the way from the marks, by these. */
static void correct(@prefix@_controller *c, @prefix@_measured *m)
{
    const double part = share(c->clock - c->entered, c->settings.homing);
    const int relative = c->settings.search != @PREFIX@_NO_SEARCH && !c->known;
    int i;
    for (i = 0; i < N; i++) {
        if (c->state == @PREFIX@_HOMING && !c->searching)
            c->correction[i] = c->uncorrected[i] + part * (c->due[i] - c->uncorrected[i]);
        if (relative && !c->counts_from[i] && !m->lost[i] && number(m->joint[i])) {
            c->counts_from[i] = 1;
            c->correction[i] = c->joint_kept[i] - m->joint[i];
        }
        m->joint[i] += c->correction[i];
    }
}

/* Marks, while it searches. Where all are known, homing goes on from there to the reference. */
static void look(@prefix@_controller *c, const @prefix@_measured *m, const @prefix@_reference *to,
                 const double before[N], const @prefix@_reference *r)
{
    const @prefix@_settings *given = &c->settings;
    const int stops = given->search == @PREFIX@_HARD_STOP;
    int i, moves = 0, leads = 0, known = 1, wrong = 0;
    for (i = 0; i < N; i++) {
        leads |= fabs(to->joint[i] - (m->joint[i] - ZERO[i])) > given->tolerance;
        moves |= fabs(m->joint[i] - c->stood[i]) > STILL * given->tolerance;
    }
    c->pressed = leads && !moves ? c->pressed + given->period : 0.0;
    for (i = 0; i < N; i++) {
        const double here = (stops ? m->joint[i] : (m->joint[i] + before[i]) / 2.0) - ZERO[i];
        if (moves) c->stood[i] = m->joint[i];
        if (!c->seen[i] && (stops ? c->pressed > 0.0 && c->pressed >= given->press : m->index[i])) {
            c->seen[i] = 1;
            c->due[i] = c->correction[i] + given->mark[i] - here;
            wrong |= !(fabs(given->mark[i] - here) <= given->tolerance);
        }
        known &= c->seen[i];
    }
    if (wrong || (!known && c->clock - c->entered >= given->within)) {
        c->active |= 1u << @PREFIX@_NO_MARK;
    } else if (known) {
        c->searching = 0;
        c->entered = c->clock;
        for (i = 0; i < N; i++) c->stood[i] = to->joint[i];
        memcpy(c->goal, r->q, sizeof c->goal);
        lead(c, 0, r);
    }
}

/* What trips, of the joints and efforts of a tick that has a result. */
static void watch(@prefix@_controller *c, const @prefix@_measured *m, const @prefix@_reference *to,
                  const double before[N], const double asked[N])
{
    const @prefix@_settings *given = &c->settings;
    int i;
    for (i = 0; i < N; i++) {
        const int high = HIGH[i] > 0.0 && asked[i] >= HIGH[i] * (1.0 - 1e-9);
        const int low = LOW[i] < 0.0 && asked[i] <= LOW[i] * (1.0 - 1e-9);
        c->taxed[i] = high || low ? c->taxed[i] + given->period : 0.0;
        if (c->taxed[i] > given->overtaxed) c->active |= 1u << @PREFIX@_OVERTAXED;
        if (fabs(m->joint[i] - ZERO[i] - to->joint[i]) > given->tracking)
            c->active |= 1u << @PREFIX@_TRACKING;
        if (m->joint[i] != before[i]) c->stood[i] = to->joint[i];
        if (fabs(to->joint[i] - c->stood[i]) > given->stuck) c->active |= 1u << @PREFIX@_ENCODER;
    }
@contact@}

/* The last before the outputs: efforts that are finite, within limits, and within rates. */
static void put(@prefix@_controller *c, const double wanted[N])
{
    const double part = c->searching ? c->settings.search_effort : 1.0;
    int i;
    for (i = 0; i < N; i++) {
        const double step = c->begun ? RATE[i] * c->settings.period : (double)INFINITY;
        double effort = number(wanted[i]) ? wanted[i] : 0.0;
        effort = fmin(fmax(effort, c->effort[i] - step), c->effort[i] + step);
        c->effort[i] = fmin(fmax(effort, part * fmin(LOW[i], 0.0)), part * fmax(HIGH[i], 0.0));
    }
    c->begun = 1;
}

int @prefix@_step(@prefix@_controller *c, double now, const @prefix@_measured *measured, int wanted,
                  const @prefix@_reference *reference, double effort[N])
{
    const @prefix@_settings *given = &c->settings;
    @prefix@_measured m = *measured;
    @prefix@_reference to = *reference;
    double asked[N] = {0}, rate[N], before[N];
    int i, missing, status, fast = 0;
@locals@
    c->ticks++;
    c->active = 0;
    if (too_many(&c->counts[0], !in_time(c, now), given->late_most, given->recovery))
        c->active |= 1u << @PREFIX@_LATE;
    memcpy(before, c->joint_kept, sizeof before);
    correct(c, &m);
    missing = lost_readings(c, &m);
    if (too_many(&c->counts[1], missing, given->lost_most, given->recovery))
        c->active |= 1u << missing;
    if (m.inhibit) c->active |= 1u << @PREFIX@_INHIBIT;
    if (m.drive_fault) c->active |= 1u << @PREFIX@_DRIVE_FAULT;
    if (m.e_stop) c->active |= 1u << @PREFIX@_E_STOP;

    decide(c, wanted, reference);
    status = aim(c, reference, &to);
    if (c->state != @PREFIX@_RUN) { /* forces are held in RUN alone */
        to.force = 0.0;
@rest@    }
    if (status == @PREFIX@_OK) status = @prefix@_tick(@call@);
    c->status = status;
    if (status == @PREFIX@_OK) {
@keep@        for (i = 0; i < N; i++) {
            c->rate_kept[i] = rate[i];
            fast |= fabs(rate[i]) > given->speed[i];
        }
        if (c->searching && !missing) look(c, &m, &to, before, reference);
        if (!free_now(c) && !c->searching) watch(c, &m, &to, before, asked);
    } else {
        memcpy(rate, c->rate_kept, sizeof rate);
        memcpy(asked, c->effort, sizeof asked); /* what it was */
    }
    if (too_many(&c->counts[2], status != @PREFIX@_OK, given->lost_most, given->recovery))
        c->active |= 1u << @PREFIX@_NO_POSE;
    if (too_many(&c->counts[3], fast, given->lost_most, given->recovery))
        c->active |= 1u << @PREFIX@_SPEED;
    if (c->active & (1u << @PREFIX@_LOST | 1u << @PREFIX@_ENCODER)) {
        c->known = 0; /* where encoders count from */
        memset(c->counts_from, 0, sizeof c->counts_from);
    }
    c->late = (int)c->counts[0];
    c->lost = (int)c->counts[1];

    if (c->state != @PREFIX@_OFF && c->active) {
        for (i = 1; c->why == @PREFIX@_FINE; i++)
            if (c->active >> i & 1u) c->why = i;
        c->faults |= c->active;
        turn(c, c->active >> @PREFIX@_DRIVE_FAULT & 1u ? CUT : FAULT, reference);
        if (c->state == @PREFIX@_SAFE_STOP && !c->releasing
            && (given->stop == @PREFIX@_BRAKE || (c->faults & ~HOLDS)))
            release(c);
    }
    c->enable = c->state != @PREFIX@_OFF;
    if (c->scale < 1.0 && c->enable)
        c->scale = given->ramp > 0.0 ? fmin(1.0, c->scale + given->period / given->ramp) : 1.0;
    for (i = 0; i < N; i++) {
        if (c->state == @PREFIX@_OFF) {
            asked[i] = 0.0;
        } else if (free_now(c)) {
            const double left = 1.0 - share(c->clock - c->entered, given->stopping);
            const double known = missing || status != @PREFIX@_OK ? 0.0 : 1.0;
            asked[i] = left * c->braking[i] - known * given->brake[i] * rate[i];
        } else if (status == @PREFIX@_OK) {
            asked[i] *= c->scale;
        } /* else what it was */
    }
    put(c, asked);
    write_down(c, now, &m, &to);
    memcpy(effort, c->effort, sizeof c->effort);
    return c->state;
}
