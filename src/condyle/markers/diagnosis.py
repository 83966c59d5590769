"""What is wrong with a recording, in words: why frames have no pose, which markers are suspect."""

from __future__ import annotations

import numpy as np

from ..motion.arrays import runs_of
from .bodies import Bodies
from .recording import Recording
from .rigid import FEWEST
from .suspects import exchanged, loose, outlier

_SMALLEST, _LARGEST = 5e-3, 1.0  # m, of a body of markers
_STRETCHES = 10  # in which exchanged labels are looked for


def why_none(bodies: Bodies, run: slice, max_residual: float) -> str:
    """Why there is no pose in a run of frames."""
    for body in bodies.both:
        seen = np.isfinite(body.points[run]).all(axis=-1)
        lost = [name for name, s in zip(body.names, seen.T, strict=True) if not s.all()]
        few = int(seen.sum(axis=1).min())
        if few < FEWEST:
            return f"{few} of {len(body.names)} {body.what} markers seen, not {', '.join(lost)}"
        if not body.fit.found[run].all() and lost:
            return f"without {', '.join(lost)} the {body.what} markers are on one line"
    body = max(bodies.both, key=lambda body: np.nanmax(body.fit.largest()[run]))
    frame = run.start + int(np.nanargmax(body.fit.largest()[run]))
    if found := outlier(body.shape, body.points[frame], max_residual):
        name, off = body.names[found[0]], found[1]
        said = f"{name} is {off * 1e3:.3g} mm off the place that the other {body.what} markers give"
    else:
        residual = body.fit.residual[frame]
        name, off = body.names[int(np.nanargmax(residual))], float(np.nanmax(residual))
        said = f"{name} is {off * 1e3:.3g} mm off its place in its body"
    return f"{said}; the limit is {max_residual * 1e3:g} mm"


def suspects_in(recording: Recording, bodies: Bodies, bad: np.ndarray) -> list[str]:
    """Exchanged labels in the frames whose residuals are too large, and loose markers elsewhere."""
    found, clean = [], np.ones(len(bad), dtype=bool)
    for run in sorted(runs_of(bad), key=lambda run: run.start - run.stop)[:_STRETCHES]:
        said = exchanged(
            [body.shape for body in bodies.both],
            [body.names for body in bodies.both],
            [body.points[run] for body in bodies.both],
        )
        if said:
            t = recording.t
            found.append((run.start, f"from {t[run][0]:.4g} to {t[run][-1]:.4g} s {said}"))
            clean[run] = False
    moving = [said for body in bodies.both for said in loose(body.names, body.points[clean])]
    return [said for _, said in sorted(found)] + moving


def odd_sizes(recording: Recording, bodies: Bodies) -> list[str]:
    """Bodies of markers that no head carries: a wrong unit."""
    said = []
    for body in bodies.both:
        size = float(np.linalg.norm(body.shape[:, None] - body.shape, axis=-1).max())
        if not _SMALLEST <= size <= _LARGEST:
            said.append(
                f"{recording.source}: the {body.what} markers are {size * 1e3:.3g} mm apart. Is "
                f"its unit of length {recording.unit}? --units (unit=...) names another"
            )
    return said
