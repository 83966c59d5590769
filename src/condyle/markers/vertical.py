"""Gravity and the base's motion from a recording: the laboratory's vertical, turned into {S}.

The fixed markers say where {S} is in the laboratory, W(t) its axes and o(t) its origin. In {S}

    gravity = -g W^T up,    a = W^T o'',    [w x] = W^T W'.

Derivatives are those of smoothing splines of o and of a quaternion Q of W, (x, y, z, w), which
needs no unit length: with N = Q.Q and the product of quaternions

    w = 2 Im(Q* Q') / N,    w' = 2 Im(Q* Q'') / N - w N' / N.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism.mechanism import Mechanism
from ..motion.column_units import BASE, GRAVITY
from ..motion.smoothing import smoothing_spline
from ..motion.spline import Spline
from .marker_bodies import Bodies
from .marker_file import Vertical
from .marker_gaps import filled
from .registration import Registration
from .rigid import quaternion_rotations

_UPRIGHT = np.radians(60)
_OVER = np.radians(120)  # beyond, nobody stood on their head: a sign is wrong


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """Gravity and the base's motion at K times, components in {S}.

    Attributes: gravity: (K, 3) [m/s^2].
                base: acceleration of the origin [m/s^2], angular velocity [rad/s] and acceleration
                    [rad/s^2], (K, 9); included: whether the motion has it.
                tilt: between this gravity and the mechanism's own, (K,) [rad].
                felt: acceleration of the base at the platform's mass centre at home, (K,) [m/s^2].
                mass: of the platform [kg].
    """

    gravity: np.ndarray
    base: np.ndarray
    included: bool
    tilt: np.ndarray
    felt: np.ndarray
    mass: float

    def at(self, samples: slice) -> BaseMotion:
        """The same at some of the times."""
        gravity, base, tilt, felt = (
            a[samples] for a in (self.gravity, self.base, self.tilt, self.felt)
        )
        return replace(self, gravity=gravity, base=base, tilt=tilt, felt=felt)

    def columns(self) -> dict[str, np.ndarray]:
        """The columns of a motion."""
        found = dict(zip(GRAVITY, self.gravity.T, strict=True))
        return found | (dict(zip(BASE, self.base.T, strict=True)) if self.included else {})

    def data(self) -> dict[str, Any]:
        """Their sizes, in SI, as JSON has them."""
        turning = np.linalg.norm(self.base[:, 3:6], axis=1)
        return {
            "gravity": self.gravity.mean(axis=0).tolist(),
            "tilt": {"least": float(self.tilt.min()), "largest": float(self.tilt.max())},
            "base_acceleration": _size(self.felt),
            "base_angular_velocity": _size(turning),
            "inertia_force": _size(self.felt * self.mass),
            "moving": self.included,
        }

    @property
    def warnings(self) -> tuple[str, ...]:
        """A warning where the vertical may be another axis of the laboratory."""
        if not self.tilt.mean() > _UPRIGHT:
            return ()
        return (
            f"gravity is {np.degrees(self.tilt.mean()):.3g} degrees from the mechanism's own: if "
            "the person did not lie down, name the laboratory's vertical (vertical.up)",
        )

    def __str__(self) -> str:
        """Two lines of text."""
        d = self.data()
        least, most = (f"{np.degrees(v):.3g}" for v in d["tilt"].values())
        g = ", ".join(f"{v:.3g}" for v in d["gravity"])
        a, w, f = (d[n] for n in ("base_acceleration", "base_angular_velocity", "inertia_force"))
        where = "in the motion" if self.included else "left out (moving = false)"
        return (
            f"Gravity in {{S}}: on average ({g}) m/s^2, {least} to {most} degrees from the "
            "mechanism's own\n"
            f"Motion of the base, {where}: {a['rms']:.2g} m/s^2 RMS, {a['largest']:.2g} at most at "
            f"the platform ({f['rms']:.2g} N RMS, {f['largest']:.2g} at most); {w['rms']:.2g} "
            f"rad/s RMS, {w['largest']:.2g} at most"
        )


def base_motion(
    table: Vertical,
    bodies: Bodies,
    registration: Registration,
    mechanism: Mechanism,
    frames: slice,
) -> BaseMotion:
    """Gravity and the base's motion at the frames kept, interpolated where it is not seen.

    Raises: InputError: for a vertical that is upside down.
    """
    recording, fixed = bodies.recording, bodies.fixed.fit
    A, b = registration.rotation, registration.position
    W = fixed.rotation[frames] @ A.T
    origin = fixed.position[frames] - W @ b
    t = recording.t[frames] - recording.t[frames][0]
    both = filled(t, np.hstack([origin, _quaternions(W)]))
    spline = _smoothed(t, both, table.cutoff, recording.rate)
    (_, Q), (_, Q1), (a, Q2) = (np.split(spline(t, nu), [3], axis=1) for nu in range(3))
    N = (Q * Q).sum(axis=1, keepdims=True)
    W = quaternion_rotations(Q / np.sqrt(N))
    w = 2 * _imaginary(Q, Q1) / N
    w_rate = 2 * _imaginary(Q, Q2) / N - w * 2 * (Q * Q1).sum(axis=1, keepdims=True) / N
    a = np.einsum("fji,fj->fi", W, a)

    up = np.array(recording.up if table.up is None else table.up, dtype=float)
    own = np.array(mechanism.gravity)
    size = float(np.linalg.norm(own))
    gravity = -size * np.einsum("fji,j->fi", W, up / np.linalg.norm(up))
    cosine = gravity @ own / max(size * size, np.finfo(float).tiny)
    tilt = np.arccos(np.clip(cosine, -1, 1))
    if tilt.mean() > _OVER:
        whose = "the recording's" if table.up is None else "vertical.up"
        raise InputError(
            f"{recording.source}: gravity would point {np.degrees(tilt.mean()):.3g} degrees from "
            f"the mechanism's own, upwards: {whose} = [{_axis(up)}] has the wrong sign.",
            f"If the person sat or stood, write up = [{_axis(-up)}] under [vertical]",
        )
    r = np.array(mechanism.platform.com)
    felt = a + np.cross(w_rate, r) + np.cross(w, np.cross(w, r))
    return BaseMotion(
        gravity,
        np.hstack([a, w, w_rate]),
        table.moving,
        tilt,
        np.linalg.norm(felt, axis=1),
        mechanism.platform.mass,
    )


def _smoothed(t: np.ndarray, values: np.ndarray, cutoff: float, rate: float) -> Spline:
    """Smoothed where the recording is long and dense enough for the cut-off."""
    if t[-1] * cutoff < 2 or rate <= 2 * cutoff:
        return Spline.through(t, values)
    return smoothing_spline(t, values, cutoff)


def _quaternions(R: np.ndarray) -> np.ndarray:
    """Unit quaternions (x, y, z, w), (F, 4), of rotations, without leaps; NaN stays NaN.

    The eigenvector to the eigenvalue 1 of Bar-Itzhack's matrix.
    """
    quaternions = np.full((len(R), 4), np.nan)
    known = np.isfinite(R).all(axis=(1, 2))
    M = R[known]
    trace = np.trace(M, axis1=1, axis2=2)
    K = np.empty((len(M), 4, 4))
    K[:, :3, :3] = M + M.transpose(0, 2, 1) - trace[:, None, None] * np.eye(3)
    z = np.stack([M[:, 2, 1] - M[:, 1, 2], M[:, 0, 2] - M[:, 2, 0], M[:, 1, 0] - M[:, 0, 1]], 1)
    K[:, :3, 3] = K[:, 3, :3] = z
    K[:, 3, 3] = trace
    Q = np.linalg.eigh(K)[1][..., -1]
    signs = np.sign((Q[1:] * Q[:-1]).sum(axis=1))
    Q[1:] *= np.cumprod(np.where(signs < 0, -1.0, 1.0))[:, None]
    quaternions[known] = Q
    return quaternions


def _imaginary(P: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Im(P* Q), (F, 3)."""
    return P[:, 3:] * Q[:, :3] - Q[:, 3:] * P[:, :3] - np.cross(P[:, :3], Q[:, :3])


def _axis(direction: np.ndarray) -> str:
    return ", ".join(f"{v + 0.0:g}" for v in direction)


def _size(values: np.ndarray) -> dict[str, float]:
    return {"rms": float(np.sqrt(np.mean(values**2))), "largest": float(values.max())}
