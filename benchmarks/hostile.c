/* Hostile ticks: clocks, sensors, references, inputs and wishes at random. Counts efforts that are not
   finite, beyond limits or rates, and states that are none. Arguments: ticks, seed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "@prefix@_controller.h"

#define N @PREFIX@_JOINTS
#define M @PREFIX@_FREE

static unsigned long long seed;

static double uniform(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (double)(seed >> 11) / 9007199254740992.0;
}

static double odd(double x)
{
    static const double other[] = {0.0, -0.0, 5e-324, 1e49, 1e300, HUGE_VAL, -HUGE_VAL, 0.0, 1e3, -1e3};
    const int k = (int)(10.0 * uniform());
    return k == 7 ? nan("") : other[k] + (k > 7 ? x : 0.0);
}

static double now_and_then(double x, double share) { return uniform() < share ? odd(x) : x; }

int main(int count, char **given)
{
    static const double low[N] = {@low@}, high[N] = {@high@}, step[N] = {@step@};
    static @prefix@_record log[100];
    const long ticks = count > 1 ? atol(given[1]) : 1000;
    const double period = @PREFIX@_SETTINGS.period, zero[M] = {0};
    @prefix@_controller c;
    @prefix@_reference reference, row;
    @prefix@_measured m;
    double effort[N] = {0}, before[N], now = 0.0, share = 0.0;
    long k, bad = 0, beyond = 0, quick = 0, lost = 0, edges[5][5] = {{0}};
    int i, j, wanted = 0, state, last = @PREFIX@_OFF, first = 1;
    seed = count > 2 ? (unsigned long long)atol(given[2]) + 1 : 1;
    for (k = 0; k < ticks; k++) {
        if (k % 2000 == 0) { /* from calm to wild; begins anew, in a state at random */
            const double shares[] = {0.0, 1e-3, 0.02, 0.3};
            share = shares[(int)(4.0 * uniform())];
            last = (int)(7.0 * uniform()) - 1;
            @prefix@_begin(&c, &@PREFIX@_SETTINGS, zero, zero, NULL, last, log, 100);
            c.settings.stop = (int)(3.0 * uniform());
            c.settings.homing = c.settings.halting = c.settings.stopping = c.settings.hold = 0.03;
            c.settings.ramp = 0.01;
            c.settings.search = (int)(3.0 * uniform());
            c.settings.reach[M - 1] = c.settings.tolerance = 0.02;
            c.settings.within = 0.05;
            c.settings.search_effort = 0.2;
            if (uniform() < 0.5) c.logged = c.ticks = 4294967290u;
            c.logged %= 200;
            first = c.state != @PREFIX@_OFF;
            last = c.state;
            memset(effort, 0, sizeof effort);
        }
        if (uniform() < (last == @PREFIX@_OFF ? 0.2 : 0.01))
            wanted = last == @PREFIX@_HOLD ? @PREFIX@_WANT_RUN : (int)(7.0 * uniform()) - 1;
        if (uniform() < 1e-3) wanted = (int)(4e9 * (uniform() - 0.5));
        now = now_and_then(now + period * (uniform() < share ? 4.0 * uniform() - 1.0 : 1.0), share);
        if (!(fabs(now) < 1e6)) now = uniform() < 0.5 ? 0.0 : now;
        memset(&m, 0, sizeof m);
        memset(&row, 0, sizeof row);
        row.q[M - 1] = 0.01 * sin(0.01 * (double)k);
        row.q1[M - 1] = 0.1 / 1000.0 / period * cos(0.01 * (double)k);
        if (@prefix@_reference_at(row.q, row.q1, row.q2, 10.0, &row) == @PREFIX@_OK) reference = row;
        for (i = 0; i < N; i++) {
            m.joint[i] = now_and_then(reference.joint[i] + 1e-3 * (uniform() - 0.5), share);
            m.joint_rate[i] = now_and_then(reference.joint_rate[i], share);
            m.index[i] = uniform() < 0.1;
            m.lost[i] = uniform() < share ? (unsigned char)(256.0 * uniform()) : 0;
        }
        for (i = 0; i < 3; i++) m.force[i] = now_and_then(0.0, share);
        m.inhibit = uniform() < 0.1 * share;
        m.drive_fault = uniform() < 0.1 * share;
        m.e_stop = uniform() < 0.1 * share;
        for (i = 0; i < M; i++) {
            row = reference;
            row.q[i] = now_and_then(row.q[i], share);
            row.q1[i] = now_and_then(row.q1[i], share);
        }
        memcpy(before, effort, sizeof before);
        state = @prefix@_step(&c, now, &m, wanted, &row, effort);
        if (state < 0 || state > 4 || (state == @PREFIX@_OFF) == (c.enable == 1)) lost++;
        else edges[last][state]++;
        last = state;
        for (i = 0; i < N; i++) {
            bad += !(fabs(effort[i]) < 1e50);
            beyond += !(effort[i] >= fmin(low[i], 0.0) && effort[i] <= fmax(high[i], 0.0));
            quick += !first && !(fabs(effort[i] - before[i]) <= step[i] * (1.0 + 1e-12) + 1e-15);
        }
        first = 0;
    }
    printf("%ld %ld %ld %ld %ld\n", ticks, bad, beyond, quick, lost);
    for (i = 0; i < 5; i++)
        for (j = 0; j < 5; j++) printf("%ld%c", edges[i][j], j < 4 ? ' ' : '\n');
    return bad + beyond + quick + lost != 0;
}
