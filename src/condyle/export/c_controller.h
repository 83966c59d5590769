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
    @PREFIX@_OFF,      /* no efforts; encoders are read */
    @PREFIX@_HOMING,   /* from where it is to the reference, smoothly */
    @PREFIX@_HOLD,     /* stays at the reference that homing went to */
    @PREFIX@_RUN,      /* follows the reference */
    @PREFIX@_SAFE_STOP /* brakes, lets efforts go, then off: after late ticks or lost encoders */
};

/* Why it stopped: until `wanted` is OFF, it stays off. */
enum { @PREFIX@_FINE, @PREFIX@_LATE, @PREFIX@_LOST };

typedef struct {
    double joint[@n@];      /* readings of the encoders: @joints@ */
    double joint_rate[@n@]; /* of tachometers; @tachometers@ */
    double force[3];        /* of the load at the law's point, axes of {S} [N]; @forced@ */
    unsigned char lost[@n@]; /* 1: this encoder has no reading */@acted@
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
    double period;      /* [s] */
    double homing;      /* duration of homing, and of joining the reference [s] */
    double ramp;        /* efforts rise from 0 in this time after off [s] */
    double stopping;    /* duration of a safe stop [s] */
    double brake[@n@];  /* damping in a safe stop [N m s/rad or N s/m] */
    double late;        /* a tick is late when it comes later than this, in periods */
    int late_most;      /* late ticks in a row that are borne */
    int lost_most;      /* ticks in a row with lost encoders, or without a pose, that are borne */
@gains@} @prefix@_settings;

extern const @prefix@_settings @PREFIX@_SETTINGS; /* those of the scenario */

typedef struct {
    @prefix@_settings settings;
    int state, why, status;
    int late, lost;         /* in a row */
    long ticks;
    double last, entered;   /* times [s] */
    double scale;           /* of efforts, rising */
    double q[@m@], q1[@m@]; /* the state as estimated */
    double from[@m@], from_1[@m@], goal[@m@], offset[@m@];
    double effort[@n@], braking[@n@], joint_kept[@n@], rate_kept[@n@];
@carried@    @prefix@_record *log; /* ring of `rows`, or NULL */
    int rows;
    long logged;
} @prefix@_controller;

/* Begins at a known state, off, or in another state: a machine that already moves. `measured` are the
   readings there, or NULL; `log` is memory for `rows` ticks, or NULL. Returns a status of @prefix@.h. */
int @prefix@_begin(@prefix@_controller *c, const @prefix@_settings *settings, const double q[@m@],
                   const double q1[@m@], const @prefix@_measured *measured, int state,
                   @prefix@_record *log, int rows);

/* q, q1 and q2 with the joints that belong to them. Returns a status of @prefix@.h. */
int @prefix@_reference_at(const double q[@m@], const double q1[@m@], const double q2[@m@], double force,
                          @prefix@_reference *reference);

/* One tick at time `now` [s]: `wanted` is OFF, HOLD or RUN, and is reached by homing. Efforts are
   always written. Returns the state that it is in. */
int @prefix@_step(@prefix@_controller *c, double now, const @prefix@_measured *measured, int wanted,
                  const @prefix@_reference *reference, double effort[@n@]);

#ifdef __cplusplus
}
#endif
#endif
