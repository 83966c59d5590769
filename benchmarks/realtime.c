/* A periodic loop, as a controller has it: what the machine is late by, and what a tick takes.
 *
 * realtime RATE SECONDS WORK: WORK 1 computes, 0 does nothing. Prints numbers by name. */
#define _GNU_SOURCE
#include "exported.h"
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

enum { BINS = 24 }; /* late by up to 2^i ns, from 2^8 on */

static int64_t now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void wait_until(int64_t at) {
    struct timespec t = {.tv_sec = at / 1000000000, .tv_nsec = at % 1000000000};
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL)) continue;
}

static int fifo(void) {
    struct sched_param p = {.sched_priority = 80};
    return sched_setscheduler(0, SCHED_FIFO, &p) == 0;
}

int main(int count, char **words) {
    if (count != 4) return 2;
    const int64_t period = 1000000000 / atol(words[1]);
    const long ticks = (long)(atof(words[2]) * 1e9 / (double)period);
    const int work = atoi(words[3]);
    const int first = fifo(), locked = mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
    long late[BINS] = {0}, missed = 0, failed = 0;
    int64_t latest = 0, longest = 0, total = 0, next = now() + 2 * period;
    double effort[CHAINS], sample[INPUTS];
    for (int i = 0; i < INPUTS; i++) sample[i] = 0.0;
    for (long i = 0; i < ticks; i++) {
        wait_until(next);
        const int64_t woken = now();
        if (work) {
            sample[0] = 1e-3 * (double)(i % 100) / 100.0;
            failed += CALL(sample, effort) != 0;
        }
        const int64_t done = now();
        const int64_t off = woken - next;
        int bin = 0;
        while (bin < BINS - 1 && off > (int64_t)256 << bin) bin++;
        late[bin]++;
        latest = off > latest ? off : latest;
        longest = done - woken > longest ? done - woken : longest;
        total += done - woken;
        next += period;
        /* Ticks whose time has come before this one was done are missed. */
        while (next < done) next += period, missed++, i++;
    }
    printf("fifo %d\nlocked %d\nmissed %ld\nfailed %ld\nlatest %lld\nlongest %lld\nmean %lld\n", first,
           locked, missed, failed, (long long)latest, (long long)longest,
           (long long)(total / (ticks ? ticks : 1)));
    for (int i = 0; i < BINS; i++) printf("bin%d %ld\n", i, late[i]);
    return 0;
}
