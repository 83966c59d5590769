/* The controller of "@name@". See @prefix@_controller.h. */
#include "@prefix@_controller.h"

#include <math.h>
#include <string.h>

#define N @PREFIX@_JOINTS
#define M @PREFIX@_FREE

const @prefix@_settings @PREFIX@_SETTINGS = {
    @period@, 2.0, 0.2, 0.5, {@brakes@}, 1.5, 3, 3,
@numbers@};
@tables@
/* Position, rate and acceleration of a path of fifth order from 0 to 1, at rest at both ends. */
static void blend(double t, double duration, double s[3])
{
    const double x = fmin(fmax(t / duration, 0.0), 1.0), y = 1.0 - x;
    s[0] = x * x * x * (10.0 + x * (6.0 * x - 15.0));
    s[1] = 30.0 * x * x * y * y / duration;
    s[2] = 60.0 * x * y * (y - x) / (duration * duration);
}

int @prefix@_begin(@prefix@_controller *c, const @prefix@_settings *settings, const double q[M],
                   const double q1[M], const @prefix@_measured *measured, int state,
                   @prefix@_record *log, int rows)
{
    double joint[N], rate[N], pose[6], pose_rate[6];
    const int status = @prefix@_joints(q, q1, joint, rate, pose, pose_rate);
    int i;
    memset(c, 0, sizeof *c);
    c->settings = *settings;
    c->state = state;
    c->status = status;
    c->scale = state == @PREFIX@_OFF ? 0.0 : 1.0;
    c->last = c->entered = -1.0;
    c->log = log;
    c->rows = log == NULL ? 0 : rows;
    memcpy(c->q, q, sizeof c->q);
    memcpy(c->q1, q1, sizeof c->q1);
@start@    if (status != @PREFIX@_OK) return status;
    for (i = 0; i < N; i++) {
        const double reading = measured == NULL ? joint[i] + ZERO[i] : measured->joint[i];
        const double step = RESOLUTION[i];
        c->joint_kept[i] = reading;
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

static void enter(@prefix@_controller *c, int state, double now)
{
    c->state = state;
    c->entered = now;
    memcpy(c->from, c->q, sizeof c->from);
    memcpy(c->from_1, c->q1, sizeof c->from_1);
    if (state == @PREFIX@_SAFE_STOP) memcpy(c->braking, c->effort, sizeof c->braking);
}

/* The next state, by what is wanted. */
static void decide(@prefix@_controller *c, double now, int wanted, const @prefix@_reference *r)
{
    const double since = now - c->entered;
    int i;
    switch (c->state) {
    case @PREFIX@_OFF:
        if (wanted == @PREFIX@_OFF) {
            c->why = @PREFIX@_FINE; /* somebody has seen why it stopped */
        } else if (c->why == @PREFIX@_FINE) {
            memcpy(c->goal, r->q, sizeof c->goal);
            c->scale = 0.0;
@reset@            enter(c, @PREFIX@_HOMING, now);
        }
        break;
    case @PREFIX@_HOMING:
        if (wanted == @PREFIX@_OFF) enter(c, @PREFIX@_SAFE_STOP, now);
        else if (since >= c->settings.homing) enter(c, @PREFIX@_HOLD, now);
        break;
    case @PREFIX@_HOLD:
        if (wanted == @PREFIX@_OFF) enter(c, @PREFIX@_SAFE_STOP, now);
        else if (wanted == @PREFIX@_RUN) {
            for (i = 0; i < M; i++) c->offset[i] = c->goal[i] - r->q[i];
            enter(c, @PREFIX@_RUN, now);
        }
        break;
    case @PREFIX@_RUN:
        if (wanted == @PREFIX@_OFF) enter(c, @PREFIX@_SAFE_STOP, now);
        else if (wanted == @PREFIX@_HOLD) {
            memcpy(c->goal, r->q, sizeof c->goal);
            enter(c, @PREFIX@_HOLD, now);
        }
        break;
    default:
        if (since >= c->settings.stopping) enter(c, @PREFIX@_OFF, now);
    }
}

/* What the law is to follow now: smooth from where the machine is to the reference. */
static int aim(@prefix@_controller *c, double now, const @prefix@_reference *r,
               @prefix@_reference *to)
{
    double s[3], q[M], q1[M], q2[M];
    int i, moved = 0;
    if (c->state == @PREFIX@_RUN) {
        for (i = 0; i < M; i++) moved |= c->offset[i] != 0.0;
        if (!moved || now - c->entered >= c->settings.homing) {
            *to = *r;
            return @PREFIX@_OK;
        }
        blend(now - c->entered, c->settings.homing, s);
        for (i = 0; i < M; i++) {
            q[i] = r->q[i] + c->offset[i] * (1.0 - s[0]);
            q1[i] = r->q1[i] - c->offset[i] * s[1];
            q2[i] = r->q2[i] - c->offset[i] * s[2];
        }
        return @prefix@_reference_at(q, q1, q2, r->force, to);
    }
    blend(c->state == @PREFIX@_HOMING ? now - c->entered : c->settings.homing, c->settings.homing, s);
    for (i = 0; i < M; i++) {
        const double from = c->state == @PREFIX@_HOMING ? c->from[i] : c->goal[i];
        const double to_i = c->state == @PREFIX@_OFF ? c->q[i] : c->goal[i];
        q[i] = c->state == @PREFIX@_OFF ? to_i : from + (to_i - from) * s[0];
        q1[i] = c->state == @PREFIX@_HOMING ? (to_i - from) * s[1] : 0.0;
        q2[i] = c->state == @PREFIX@_HOMING ? (to_i - from) * s[2] : 0.0;
    }
    return @prefix@_reference_at(q, q1, q2, r->force, to);
}

static void write_down(@prefix@_controller *c, double now, const @prefix@_measured *m,
                       const @prefix@_reference *to)
{
    @prefix@_record *row;
    if (c->rows == 0) return;
    row = c->log + c->logged++ % c->rows;
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

int @prefix@_step(@prefix@_controller *c, double now, const @prefix@_measured *measured, int wanted,
                  const @prefix@_reference *reference, double effort[N])
{
    @prefix@_measured m = *measured;
    @prefix@_reference to = *reference;
    double asked[N] = {0}, rate[N];
    int i, missing = 0, status;
@locals@
    /* Late ticks: the law takes every period for a whole one, as the simulation does. */
    if (c->ticks++ > 0 && now - c->last > c->settings.late * c->settings.period) c->late++;
    else c->late = 0;
    c->last = now;

    /* Lost encoders: carried on by their rates for a few ticks. */
    for (i = 0; i < N; i++) {
        const int gone = m.lost[i] || !(fabs(m.joint[i]) < 1e50);
        if (gone) m.joint[i] = c->joint_kept[i] + c->settings.period * c->rate_kept[i];
        if (gone) m.joint_rate[i] = c->rate_kept[i];
        missing |= gone;
        c->joint_kept[i] = m.joint[i];
    }

    if (c->entered < 0.0) c->entered = now;
    decide(c, now, wanted, reference);
    status = aim(c, now, reference, &to);
    if (status == @PREFIX@_OK) status = @prefix@_tick(@call@);
    c->status = status;
    if (status == @PREFIX@_OK) {
@keep@        for (i = 0; i < N; i++) c->rate_kept[i] = rate[i];
    } else {
        memcpy(rate, c->rate_kept, sizeof rate);
        memcpy(asked, c->effort, sizeof asked); /* what it was */
    }
    c->lost = missing || status != @PREFIX@_OK ? c->lost + 1 : 0;

    if (c->state == @PREFIX@_HOMING || c->state == @PREFIX@_HOLD || c->state == @PREFIX@_RUN) {
        if (c->late > c->settings.late_most) c->why = @PREFIX@_LATE;
        if (c->lost > c->settings.lost_most) c->why = @PREFIX@_LOST;
        if (c->why != @PREFIX@_FINE) enter(c, @PREFIX@_SAFE_STOP, now);
    }
    if (c->scale < 1.0 && c->state != @PREFIX@_OFF)
        c->scale = c->settings.ramp > 0.0
                       ? fmin(1.0, c->scale + c->settings.period / c->settings.ramp) : 1.0;
    for (i = 0; i < N; i++) {
        if (c->state == @PREFIX@_OFF) {
            c->effort[i] = 0.0;
        } else if (c->state == @PREFIX@_SAFE_STOP) {
            const double left = 1.0 - fmin((now - c->entered) / c->settings.stopping, 1.0);
            const double known = missing || status != @PREFIX@_OK ? 0.0 : 1.0;
            const double brake = c->braking[i] - known * c->settings.brake[i] * rate[i];
            c->effort[i] = left * fmin(fmax(brake, LOW[i]), HIGH[i]);
        } else if (status == @PREFIX@_OK) {
            c->effort[i] = c->scale * asked[i];
        } /* else what it was */
    }
    write_down(c, now, &m, &to);
    memcpy(effort, c->effort, sizeof c->effort);
    return c->state;
}
