"""The fit: weighted least squares over the identifiable numbers, physically consistent."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .. import progress
from ..errors import InputError, join
from ..extras import require
from .base_parameters import identifiable_columns
from .equations import EquationRows, LogEquations
from .lack_of_fit import MissingTerm, lack_of_fit
from .residual_spectrum import covariance, in_band, spectra, stacked
from .unknowns import Unknowns

ITERATIONS = 30
WEIGHTED = 12  # of these, at most, that find the noise's spectrum
MIN_TURNS = 3  # of these
CONVERGED = 1e-3  # of a step, in standard deviations
DOUBT = 1.0  # standard deviation over the size of a number, beyond which data do not tell it
HIDDEN = 0.5  # of what only this number explains, that may be noise
CULPRITS = 4  # at most, that a number is said not to be told apart from
BORDER = 1e-9  # of a cone's size, nearer than which a number is held at the border


class UnsettledFitError(InputError):
    """A fit that does not converge."""


@dataclass(frozen=True)
class Fit:
    """Unknowns of the file, then the extras.

    x: (U + E,);  covariance: (U + E, U + E), zero where held;
    identified: (U + E,), whether fitted;
    why: number -> why it is not;  held: words of what the rules hold at a border;
    rows: of each log, at x;  missing: terms that the residual follows, by which the covariance is
    widened.
    """

    x: np.ndarray
    covariance: np.ndarray
    identified: np.ndarray
    why: dict[int, str]
    held: tuple[str, ...]
    rows: tuple[EquationRows, ...]
    missing: tuple[MissingTerm, ...]


@dataclass(frozen=True)
class _Cones:
    """Rules: C x + d in the nonnegative numbers, and one pseudo-inertia per (M, d): M x + d >= 0.

    words: of the linear ones.
    """

    C: np.ndarray
    d: np.ndarray
    words: list[str]


def fit(logs: Sequence[LogEquations], unknowns: Unknowns, names: Sequence[str]) -> Fit:
    """The fit of several logs.

    Args:   names: of the unknowns and the extras.
    Raises: InputError: where it does not converge.
    """
    U, E = len(unknowns.all), len(names) - len(unknowns.all)
    x = np.concatenate([unknowns.prior, np.zeros(E)])
    identified: np.ndarray | None = None
    why: dict[int, str] = {}
    known = np.concatenate([unknowns.spread, np.full(E, np.inf)])
    mean, prior = x.copy(), np.flatnonzero(np.isfinite(known))
    spectrum: list[np.ndarray] = []
    with progress.step("fitting"):
        for turn in range(ITERATIONS):
            rows = [log.rows(x[:U], x[U:]) for log in logs]
            A, r = ([in_band(block, values) for block, values in both] for both in _parts(rows))
            if identified is None:  # by the noise as stated
                spectrum = [np.ones(block.shape) for block in r]
            elif turn < WEIGHTED:
                spectrum = spectra([block[..., identified] for block in A], r, spectrum)[0]
            weight = [(1 / block).mean(axis=1) for block in spectrum]
            columns, left = stacked(A, spectrum), stacked(r, spectrum)[:, 0]
            data = len(left)
            columns = np.concatenate([columns, np.eye(len(x))[prior] / known[prior, None]])
            left = np.concatenate([left, (x - mean)[prior] / known[prior]])
            each = [
                log.attenuation(x[:U], block.V, w)
                for log, block, w in zip(logs, rows, weight, strict=True)
            ]
            bent, noise = (np.sum([block[i] for block in each], axis=0) for i in range(2))
            if identified is None:
                identified, why = _identified(columns, left, unknowns, x, names)
                _hidden(columns, noise, identified, why)
            normal = (
                columns[:, identified].T @ columns[:, identified]
                - noise[np.ix_(identified, identified)]
            )
            step = np.zeros(len(x))
            right = columns[:, identified].T @ left - bent[identified]
            step[identified] = -np.linalg.solve(normal, right)
            if not _allowed(unknowns, x[:U] + step[:U]):
                step[identified] = _in_cones(unknowns, x, identified, normal, right)
            size = np.sqrt(max(0.0, float(step[identified] @ normal @ step[identified])))
            if turn >= MIN_TURNS and size < CONVERGED * max(1, identified.sum()) ** 0.5:
                break
            x = x + step
        else:
            raise UnsettledFitError(
                "the fit does not converge: take fewer numbers, priors or a log of larger motions"
            )
    held = tuple(_held(unknowns, x[:U], np.linalg.inv(normal), identified))
    columns = columns[:, identified]
    missing, change = lack_of_fit(
        logs, x, rows, identified, spectrum, (columns[data:], left[data:])
    )
    spread = np.zeros((len(x), len(x)))
    own = covariance(columns, left, normal, data, bool(missing)) + np.outer(change, change)
    spread[np.ix_(identified, identified)] = own
    return Fit(x, spread, identified, why, held, tuple(rows), missing)


def _parts(rows: Sequence[EquationRows]) -> Iterator[list[tuple[EquationRows, np.ndarray]]]:
    yield [(one, one.A) for one in rows]
    yield [(one, one.r) for one in rows]


def _identified(
    A: np.ndarray, r: np.ndarray, unknowns: Unknowns, x: np.ndarray, names: Sequence[str]
) -> tuple[np.ndarray, dict[int, str]]:
    """Which numbers the data identify, each to within its size, and why the others are not."""
    lengths = np.linalg.norm(A, axis=0)
    size = _sizes(unknowns, x)
    bare = size == 0
    # Of a number that is 0 in the file: what would make up for all that is measured.
    size[bare] = np.linalg.norm(A @ x - r) / np.where(lengths > 0, lengths, np.inf)[bare]
    split = identifiable_columns(A * size, 1 / DOUBT, relative=False)
    identified = np.zeros(len(x), dtype=bool)
    identified[split.known] = True
    why = {}
    for column, j in zip(split.follow.T, split.rest, strict=True):
        if lengths[j] * size[j] <= 1 / DOUBT:
            why[int(j)] = "the data say nothing of it"
            continue
        share = np.abs(column)
        nearest = np.argsort(-share)[:CULPRITS]
        with_it = [names[split.known[i]] for i in nearest if share[i] > 0.1 * share.max()]
        why[int(j)] = f"not told apart from {join(with_it)}"
    return identified, why


def _hidden(A: np.ndarray, noise: np.ndarray, identified: np.ndarray, why: dict[int, str]) -> None:
    """Leave out numbers whose columns, beyond what others explain, are noise; in place."""
    while identified.any():
        own = np.flatnonzero(identified)
        beyond = 1 / np.diag(np.linalg.inv(A[:, own].T @ A[:, own]))
        share = np.diag(noise)[own] / beyond
        worst = int(np.argmax(share))
        if share[worst] <= HIDDEN:
            return
        identified[own[worst]] = False
        why[int(own[worst])] = "the noise of the encoders hides what it does"


def _sizes(unknowns: Unknowns, x: np.ndarray) -> np.ndarray:
    """How large numbers are: those of a vector as its largest entry."""
    size = np.abs(x)
    paths = np.array([one.path for one in unknowns.all])
    for path in set(paths):
        own = np.flatnonzero(paths == path)
        size[own] = size[own].max()
    return size


def predicted_covariance(
    logs: Sequence[LogEquations],
    rows: Sequence[EquationRows],
    x: np.ndarray,
    identified: np.ndarray,
    known: np.ndarray,
) -> np.ndarray:
    """Covariance of a fit to come, from the stated noise, which smoothing takes to all times."""
    weighted = [np.linalg.solve(one.V, one.A[:, :, identified]) for one in rows]
    F = sum(
        np.einsum("tru,trw->uw", one.A[:, :, identified], w)
        for one, w in zip(rows, weighted, strict=True)
    )
    F = F + np.diag(1 / known[identified] ** 2)
    inverse = np.linalg.inv(F)
    covariance = inverse @ np.diag(1 / known[identified] ** 2) @ inverse
    for log, w in zip(logs, weighted, strict=True):
        gain = np.einsum("uw,trw->utr", inverse, w)
        covariance = covariance + log.spread(gain, x)
    return np.asarray(covariance)


# -- physical consistency --------------------------------------------------------------------


def pseudo_inertia(pi: np.ndarray) -> np.ndarray:
    """The pseudo-inertia of a platform's ten numbers: positive definite for real bodies, (4, 4).

    [S h; h^T m] with S the second moments, tr(I) / 2 E - I (Wensing, Kim and Slotine 2018).
    """
    m, h, (xx, yy, zz, xy, xz, yz) = pi[0], pi[1:4], pi[4:10]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J = np.empty((4, 4))
    J[:3, :3] = np.trace(inertia) / 2 * np.eye(3) - inertia
    J[:3, 3] = J[3, :3] = h
    J[3, 3] = m
    return J


def _allowed(unknowns: Unknowns, x: np.ndarray) -> bool:
    cones = _linear(unknowns)
    platform = pseudo_inertia(unknowns.pi(x))
    return bool((cones.C @ x + cones.d >= 0).all() and np.linalg.eigvalsh(platform)[0] > 0)


def _linear(unknowns: Unknowns) -> _Cones:
    """The rules of the file that are linear."""
    U = len(unknowns.all)
    rows: list[np.ndarray] = []
    ends: list[float] = []
    words: list[str] = []

    def add(entries: dict[int, float], constant: float, text: str) -> None:
        row = np.zeros(U)
        for i, factor in entries.items():
            row[i] = factor
        rows.append(row)
        ends.append(constant)
        words.append(text)

    low, high = unknowns.bounds
    for i, unknown in enumerate(unknowns.all):
        if np.isfinite(low[i]):
            add({i: 1.0}, -low[i], f"{unknown.name} at {low[i]:g}")
        if np.isfinite(high[i]):
            add({i: -1.0}, high[i], f"{unknown.name} at {high[i]:g}")
    for axial, transverse, a, t in unknowns.axial_rules():
        entries = ({axial: -1.0} if axial is not None else {}) | (
            {transverse: 2.0} if transverse is not None else {}
        )
        constant = (0.0 if axial is not None else -a) + (0.0 if transverse is not None else 2 * t)
        named = unknowns.all[axial if axial is not None else transverse].name  # type: ignore[index]
        add(entries, constant, f"{named}: axial at twice transverse")
    return _Cones(np.array(rows).reshape(-1, U), np.array(ends), words)


def _in_cones(
    unknowns: Unknowns, x: np.ndarray, identified: np.ndarray, normal: np.ndarray, right: np.ndarray
) -> np.ndarray:
    """The best step within the rules, by a semidefinite program: (fitted,).

    Of the platform's pseudo-inertia, linear about x, for whose numbers it is exact.
    """
    require("clarabel", "identify")
    import clarabel
    from scipy.sparse import csc_array

    U = len(unknowns.all)
    free = np.flatnonzero(identified)
    # Steps in units of the standard deviations that data give, so that all are of one size.
    scale = 1 / np.sqrt(np.diag(normal))
    own = free < U
    cones = _linear(unknowns)
    C = np.zeros((len(cones.d), len(free)))
    C[:, own] = cones.C[:, free[own]]
    slack = cones.C @ x[:U] + cones.d
    size = np.linalg.norm(C * scale, axis=1)
    used = size > 0
    pi, slope = unknowns.pi(x[:U])[:10], unknowns.slope(x[:U])[:10]
    P0 = pseudo_inertia(pi)
    balance = 1 / np.sqrt(np.maximum(np.diag(P0), 1e-300))
    each = np.zeros((len(free), 4, 4))
    for k in np.flatnonzero(own):
        column = slope[:, free[k]]
        # Linear in pi, so that a pseudo-inertia of a direction is one too.
        each[k] = pseudo_inertia(column)
    triangle = [(i, j) for j in range(4) for i in range(j + 1)]

    def flat(matrix: np.ndarray) -> np.ndarray:
        scaled = matrix * np.outer(balance, balance)
        return np.array([scaled[i, j] * (1 if i == j else np.sqrt(2)) for i, j in triangle])

    margin = BORDER * np.eye(4) / np.outer(balance, balance)
    blocks = [-(C * scale)[used] / size[used, None]]
    ends = [slack[used] / size[used]]
    kinds = [clarabel.NonnegativeConeT(int(used.sum()))]
    if any(each[k].any() for k in range(len(free))):
        blocks.append(-np.array([flat(e * s) for e, s in zip(each, scale, strict=True)]).T)
        ends.append(flat(P0 - margin))
        kinds.append(clarabel.PSDTriangleConeT(4))
    H = normal * np.outer(scale, scale)
    problem = (
        csc_array(np.triu((H + H.T) / 2)),
        right * scale,
        csc_array(np.concatenate(blocks)),
        np.concatenate(ends),
        kinds,
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.equilibrate_enable = False  # all is of one size already
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(*problem, settings).solve()
    if str(solution.status) not in ("Solved", "AlmostSolved"):
        raise UnsettledFitError(
            "the fit within the limits of the file does not converge "
            f"({solution.status}): take priors, or a log with larger motions"
        )
    return np.array(solution.x) * scale


def _held(
    unknowns: Unknowns, x: np.ndarray, covariance: np.ndarray, identified: np.ndarray
) -> list[str]:
    """The rules at whose borders numbers are, in words."""
    cones = _linear(unknowns)
    spread = np.zeros(len(x))
    own = np.flatnonzero(identified)
    inside = own < len(x)
    spread[own[inside]] = np.sqrt(np.diag(covariance))[inside]
    slack = cones.C @ x + cones.d
    near = slack <= 1e-6 * (np.abs(cones.C) @ spread)
    reasons = [word for word, at in zip(cones.words, near, strict=True) if at]
    platform = pseudo_inertia(unknowns.pi(x))
    size = np.diag(platform)
    balanced = platform / np.sqrt(np.outer(size, size))
    touches = any(one.path.startswith("platform") for one in unknowns.all)
    if touches and np.linalg.eigvalsh(balanced)[0] < 1e-6:
        reasons.append("platform: its mass lies in a plane or a line, as far as the rules allow")
    return reasons
