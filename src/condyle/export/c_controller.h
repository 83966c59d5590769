/* The controller of "@name@": @law@ at @rate@ Hz, on encoders, with what a machine needs around it.
   No heap, no globals, no input or output, bounded time. Written by condyle @version@. */
#ifndef @PREFIX@_CONTROLLER_H
#define @PREFIX@_CONTROLLER_H

#include "@prefix@.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { @PREFIX@_JOINTS = @n@, @PREFIX@_FREE = @m@ };

/* What it does. */
enum {
@states@
};

/* What may be asked for, as `wanted`. Any other number is WANT_STOP. */
enum {
    @PREFIX@_WANT_OFF,      /* stop, then off; off again acknowledges a fault */
    @PREFIX@_WANT_HOLD = 2,
    @PREFIX@_WANT_RUN,
    @PREFIX@_WANT_STOP      /* a safe stop */
};

/* Why it stopped: until `wanted` is OFF, it stays off. */
enum {
@causes@
};

/* What a safe stop does. */
enum { @PREFIX@_BRAKE, @PREFIX@_HOLD_THEN_RELEASE, @PREFIX@_HOLD_ON };

/* Where homing finds what encoders are off: nowhere, they are absolute; at marks; at a hard stop. */
enum { @PREFIX@_NO_SEARCH, @PREFIX@_INDEX, @PREFIX@_HARD_STOP };

typedef struct {
    double joint[@n@];      /* readings of the encoders: @joints@ */
    double joint_rate[@n@]; /* of tachometers; @tachometers@ */
    double force[3];        /* of the load at the law's point, axes of {S} [N]; @forced@ */
    unsigned char lost[@n@]; /* not 0: @lost@ */@acted@
    unsigned char inhibit, drive_fault, e_stop; /* not 0: @inhibit@,
                                  @drive_fault@, @e_stop@ */
    unsigned char index[@n@]; /* not 0: @index@ */
} @prefix@_measured;

typedef struct {
    double q[@m@], q1[@m@], q2[@m@];         /* @free@, and rates */
    double joint[@n@], joint_rate[@n@];      /* the same as joints: see @prefix@_reference_at */
    double force;                            /* to be held [N], of laws that hold one */
} @prefix@_reference;

/* One tick, for the log. */
typedef struct {
    double t;
    int state, status; /* of the enumerations above; status: of @prefix@.h */
    double joint[@n@], joint_rate[@n@], effort[@n@], q[@m@], q1[@m@], q_d[@m@];
} @prefix@_record;

typedef struct {
@settings@} @prefix@_settings;

extern const @prefix@_settings @PREFIX@_SETTINGS; /* those of the scenario */

typedef struct {
    @prefix@_settings settings;
    int state, why, status;
    int late, lost;         /* bad ticks, less what good ones took away */
    unsigned ticks;         /* wraps */
    double last;            /* `now` of the last tick [s] */
    double entered;         /* by `clock` [s] */
    double scale;           /* of efforts, rising */
    double q[@m@], q1[@m@]; /* the state as estimated */
    double goal[@m@], offset[@m@];
    double effort[@n@], braking[@n@], joint_kept[@n@], rate_kept[@n@];
@carried@    @prefix@_record *log; /* ring of `rows`, or NULL */
    int rows;
    unsigned logged;        /* rows written; from 2 rows on back to rows, where the ring is the same */
    int enable;             /* 1: the drives are to be enabled */
    unsigned faults;        /* all causes since the last acknowledgement: bits 1 << cause */
    unsigned active;        /* those of this tick */
    int begun, timed;       /* an effort, and a time, were seen */
    int releasing;          /* a safe stop lets efforts go */
    double clock;           /* [s], goes on evenly where `now` does not */
    double counts[4];       /* late, lost, without a pose, too fast */
    double taxed[@n@], unloaded, stood[@n@];
    double follow[@m@], follow_1[@m@], follow_2[@m@]; /* what was followed last */
    double offset_1[@m@], offset_2[@m@];
    int searching, known;   /* for marks; which were found */
    unsigned char seen[@n@], counts_from[@n@];
    double correction[@n@], due[@n@], uncorrected[@n@]; /* of readings [rad or m] */
    double pressed;         /* [s] */
    unsigned unconverged;   /* ticks whose steps did not suffice for the best efforts within limits:
                               they were within them, and the next tick went on; wraps */
} @prefix@_controller;

/* Begins at a known state, off, or in another state: a machine that already moves. `measured` are the
   readings there, or NULL; with a search, off, encoders count from there, whatever they read; `log` is memory for `rows` ticks, or NULL. Returns a status of @prefix@.h. */
int @prefix@_begin(@prefix@_controller *c, const @prefix@_settings *settings, const double q[@m@],
                   const double q1[@m@], const @prefix@_measured *measured, int state,
                   @prefix@_record *log, int rows);

/* q, q1 and q2 with the joints that belong to them. Returns a status of @prefix@.h. */
int @prefix@_reference_at(const double q[@m@], const double q1[@m@], const double q2[@m@], double force,
                          @prefix@_reference *reference);

/* One tick at time `now` [s]: `wanted` is one of WANT_, and is reached by homing. Efforts are always
   written, finite, and within limits and rates, whatever is given. Returns the state that it is in. */
int @prefix@_step(@prefix@_controller *c, double now, const @prefix@_measured *measured, int wanted,
                  const @prefix@_reference *reference, double effort[@n@]);

#ifdef __cplusplus
}
#endif
#endif
