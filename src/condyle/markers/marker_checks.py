"""Checks of a recording: frames without a pose, exchanged labels, loose markers, contacts."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ..mechanism.mechanism import Mechanism
from ..motion.arrays import runs_of
from .marker_bodies import Bodies
from .recording import Recording
from .rigid import FEWEST, fit, orders

_SMALLEST, _LARGEST = 5e-3, 1.0  # m, of a body of markers
_STRETCHES = 10  # in which exchanged labels are looked for
_BETTER = 1 / 3  # of the misfit, once mended, so that a suspect is named
_LOOSE = 1e-3  # m, root mean square change of distances in a body that has a loose marker
_SAMPLES = 12  # frames looked at of a stretch


def why_none(bodies: Bodies, max_residual: float, run: slice) -> str:
    """Why there is no pose in a run of frames."""
    for body in bodies.both:
        seen = np.isfinite(body.points[run]).all(axis=-1)
        lost = [name for name, s in zip(body.names, seen.T, strict=True) if not s.all()]
        few = int(seen.sum(axis=1).min())
        if few < FEWEST:
            return f"{few} of {len(body.names)} {body.what} markers seen, not {', '.join(lost)}"
        if not body.fit.determined[run].all() and lost:
            return f"without {', '.join(lost)} the {body.what} markers are on one line"
    body = max(bodies.both, key=lambda body: np.nanmax(body.fit.largest()[run]))
    frame = run.start + int(np.nanargmax(body.fit.largest()[run]))
    if found := outlier(body.shape, body.points[frame], max_residual):
        name, off = body.names[found[0]], found[1]
        reason = (
            f"{name} is {off * 1e3:.3g} mm off the place that the other {body.what} markers give"
        )
    else:
        residual = body.fit.residual[frame]
        name, off = body.names[int(np.nanargmax(residual))], float(np.nanmax(residual))
        reason = f"{name} is {off * 1e3:.3g} mm off its place in its body"
    return f"{reason}; the limit is {max_residual * 1e3:g} mm"


def exchanged_and_loose(recording: Recording, bodies: Bodies, bad: np.ndarray) -> list[str]:
    """Exchanged labels in the frames whose residuals are too large, and loose markers elsewhere."""
    sentences, clean = [], np.ones(len(bad), dtype=bool)
    for run in sorted(runs_of(bad), key=lambda run: run.start - run.stop)[:_STRETCHES]:
        sentence = exchanged(
            [body.shape for body in bodies.both],
            [body.names for body in bodies.both],
            [body.points[run] for body in bodies.both],
        )
        if sentence:
            t = recording.t
            sentences.append((run.start, f"from {t[run][0]:.4g} to {t[run][-1]:.4g} s {sentence}"))
            clean[run] = False
    moving = [
        sentence for body in bodies.both for sentence in loose(body.names, body.points[clean])
    ]
    return [sentence for _, sentence in sorted(sentences)] + moving


def odd_sizes(recording: Recording, bodies: Bodies) -> list[str]:
    """Bodies of markers that no head carries: a wrong unit."""
    sentences = []
    for body in bodies.both:
        size = float(np.linalg.norm(body.shape[:, None] - body.shape, axis=-1).max())
        if not _SMALLEST <= size <= _LARGEST:
            sentences.append(
                f"{recording.source}: the {body.what} markers are {size * 1e3:.3g} mm apart. Is "
                f"its unit of length {recording.unit}? --units (unit=...) names another"
            )
    return sentences


def exchanged(
    shapes: list[np.ndarray], names: list[list[str]], points: list[np.ndarray]
) -> str | None:
    """Which labels seem to be exchanged in a stretch of frames, in words; None if none.

    Args: shapes: of the bodies, (m, 3) each;  names: of their markers.
          points: (F, m, 3) each [m], in the laboratory.
    """
    some = np.unique(np.linspace(0, len(points[0]) - 1, _SAMPLES).astype(int))
    cut = np.cumsum([len(shape) for shape in shapes])[:-1]
    together = np.concatenate(points, axis=1)[some]
    together = together[np.isfinite(together).all(axis=(1, 2))]
    if not len(together):
        return None

    def misfit(order: list[int]) -> float:
        parts = np.split(together[:, order], cut, axis=1)
        residual = [fit(s, p).residual for s, p in zip(shapes, parts, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(residual, axis=1) ** 2)))

    tried = orders([len(shape) for shape in shapes])
    misfits = [misfit(order) for order in tried]
    best = int(np.nanargmin(misfits))
    if not misfits[best] < _BETTER * misfits[0]:
        return None
    every = [name for body in names for name in body]
    moved = [every[i] for i, k in enumerate(tried[best]) if i != k]
    return (
        f"{' and '.join(moved) if len(moved) == 2 else ', '.join(moved)} look exchanged: "
        f"{misfits[0] * 1e3:.3g} mm off their bodies as labelled, {misfits[best] * 1e3:.3g} mm "
        "exchanged"
    )


def outlier(shape: np.ndarray, points: np.ndarray, within: float) -> tuple[int, float] | None:
    """The one marker of a frame without which the others fit, and how far it is off [m].

    Args: shape: (m, 3);  points: (m, 3), NaN where not seen;  within: residual of the others [m].
    """
    one = np.eye(len(shape), dtype=bool)
    body = fit(shape, np.where(one[..., None], np.nan, points))  # without each in turn
    left = np.where(np.isfinite(points).all(axis=1), body.largest(), np.nan)
    if not (left <= within).any():
        return None
    i = int(np.nanargmin(left))
    place = body.rotation[i] @ shape[i] + body.position[i]
    return i, float(np.linalg.norm(points[i] - place))


def loose(names: list[str], points: np.ndarray) -> list[str]:
    """Markers that move against their body, the most so alone: distances of the others stay.

    Args: names: of the body's markers;  points: (F, m, 3) [m], in any frame.
    """
    m, change = len(names), _changes(points)
    total, own = change.sum(), change.sum(axis=0)
    whole, its = np.sqrt(total / (m * (m - 1))), np.sqrt(own / (m - 1))
    rest = np.sqrt(np.maximum(total - 2 * own, 0.0) / ((m - 1) * (m - 2)))
    best = int(np.argmin(rest))
    if whole < _LOOSE or not rest[best] < _BETTER * whole:
        return []
    return [
        f"{names[best]} moves against the markers it is listed with: its distances from them vary "
        f"by {its[best] * 1e3:.3g} mm, theirs by {rest[best] * 1e3:.2g} mm"
    ]


def _changes(points: np.ndarray) -> np.ndarray:
    """Variances of the distances of all pairs where both are seen, (m, m)."""
    distance = np.linalg.norm(points[:, :, None] - points[:, None], axis=-1)
    known = np.isfinite(distance)
    count = np.maximum(known.sum(axis=0), 1)
    mean = np.where(known, distance, 0.0).sum(axis=0) / count
    return np.where(known, (distance - mean) ** 2, 0.0).sum(axis=0) / count


def off_contacts(
    mechanism: Mechanism, rotation: np.ndarray, position: np.ndarray
) -> dict[str, np.ndarray]:
    """Distance of every ball from its surface, by contact, (F,) [m]; along the normal.

    Args: rotation: R of {M} in {S}, (F, 3, 3);  position: of O_M, (F, 3) [m].
    """
    distances = {}
    for contact in mechanism.contacts:
        p = ca.SX.sym("p", 3)
        phi = contact.offset_surface.phi(p)
        slope = ca.norm_2(ca.gradient(phi, p))
        distance = ca.Function("distance", [p], [phi / slope]).map(len(position))
        balls = rotation @ np.array(contact.point) + position
        distances[contact.name] = np.asarray(distance(balls.T)).ravel()
    return distances
