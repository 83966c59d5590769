"""Whether bounds hold: errors against an independent text, over `bound`.

    python -m benchmarks.accuracy --states 500 --machines 50 --seed 1

Bundled and random mechanisms, families mixed where they share a unit, 0 to 5 contacts on all
surfaces, friction from 0 to 4, of 0.1 m or 100 m. Half of the states are next to the end of what is
reached along their direction, at a distance of 1e-2 to 1e-9 of the way: at a limit or a
singularity. Errors are of the largest entry, or of the largest term where entries cancel: gravity,
load, accelerations (efforts in forward dynamics) and rates, each alone; of contact forces likewise.
The text runs in numbers of 64 bits, a tenth of a second for forty states, and in 60 digits for some
of the states: rows "long" say what the former is off, over the bound.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from condyle.mechanism.files import parse
from condyle.mechanism.library import bundled_mechanisms, bundled_text
from condyle.model.model import Model

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mpmath import mpf
from oracles.digits import Machine
from oracles.long_digits import Machine as LongMachine
from oracles.random_mechanism import SURFACES, random_mechanism, toml_text

Array = np.ndarray
Rng = np.random.Generator
FAMILIES = (("RSS",), ("PSS",), ("SPS",), ("PSS", "SPS", "cable"), ("cable", "SPS"))
UNIT = 2.0**-53
RAYS = 8  # of a mechanism, along which its states lie
SECTIONS, PARTS = 8, 32  # of a ray: its end is found to 1e-11 of it
# A force that friction holds at 0, over the largest effort or force; or a tenth of its bound.
HELD = 1e-12


@dataclass(frozen=True)
class Row:
    """One answer: its question, its mechanism, its error and its bound."""

    question: str
    mechanism: str
    error: float
    bound: float

    @property
    def ratio(self) -> float:
        """Never above 1."""
        return self.error / self.bound

    @property
    def slack(self) -> float:
        """Its median is under 300."""
        return self.bound / max(self.error, UNIT)


def bundled() -> Iterator[tuple[str, dict[str, Any]]]:
    """The bundled mechanisms as raw dictionaries, without ligaments: `exact` has none."""
    for name in bundled_mechanisms():
        yield name, {k: v for k, v in tomllib.loads(bundled_text(name)).items() if k != "ligament"}


def drawn(rng: Rng, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Random mechanisms: every number of contacts with every set of families in turn."""
    for i in range(count):
        families, k = FAMILIES[i % len(FAMILIES)], (i // len(FAMILIES) + i) % 6
        surfaces = list(rng.permutation(SURFACES))
        n = int(rng.integers(max(6 - k, 3), 9))
        raw = random_mechanism(rng, families, n, k, surfaces, ball_radius=3.0 * (i % 2))
        for contact in raw.get("contact", [])[: i % 3]:
            contact["friction"] = {"coefficient": float(rng.uniform(0, 4)) if i % 4 else 0.3}
        raw["length_unit"] = "m" if i % 7 == 4 else "mm"
        yield f"{i} {'/'.join(families)}, {n} chains, {k} contacts", raw


@dataclass(frozen=True)
class States:
    """Of one mechanism, one a row."""

    q: Array
    v: Array
    a: Array
    effort: Array
    wrench: Array
    point: Array


def states(rng: Rng, model: Model, count: int) -> States:
    """Half about home, half next to where the mechanism can be no more."""
    scale = np.array(
        [model.characteristic_length if n in "XYZ" else 1.0 for n in model.independent]
    )
    size, n = (count, len(scale)), len(model.mechanism.chains)
    rays = rng.normal(0, 0.3, (min(RAYS, count), len(scale))) * scale
    low, high = np.zeros(len(rays)), np.full(len(rays), 16.0)
    for _ in range(SECTIONS):  # each divides what is left by PARTS
        parts = low + np.linspace(0, 1, PARTS + 1)[1:, None] * (high - low)
        tried = (parts[..., None] * rays).reshape(-1, len(scale))
        lost = model.inverse_kinematics(tried).status.reshape(parts.shape) != 0
        lost[-1] = True
        first = np.argmax(lost, axis=0)
        edges = np.vstack([low, parts])
        low, high = (edges[first + i, np.arange(len(rays))] for i in (0, 1))
    own = rng.integers(len(rays), size=count)
    part = 10 ** rng.uniform(-3, 0, count) * np.minimum(low, 1)[own]
    near = slice(count // 2)
    part[near] = low[own[near]] * (1 - 10 ** rng.uniform(-9, -2, count // 2))
    swift, strong = (10 ** rng.uniform(-2, 1, (count, 1)) for _ in range(2))
    return States(
        rays[own] * part[:, None],
        rng.normal(0, 1, size) * scale * swift,
        rng.normal(0, 10, size) * scale,
        rng.normal(0, 1, (count, n)) * strong,
        rng.normal(0, 10, (count, 6)) * np.repeat([1, model.characteristic_length], 3),
        rng.normal(0, model.characteristic_length, (count, 3)),
    )


def checked(
    rng: Rng, name: str, raw: dict[str, Any], count: int, backend: str, exact: int = 1
) -> Iterator[Row]:
    """Every answer of one mechanism.

    Args: exact: states of each question that 60 digits repeat, rows "long": what they say of the
          text in 64 bits.
    """
    model = Model(parse(toml_text(raw)), backend=backend, distribution="minimum_norm")
    s = states(rng, model, count)
    inverse = model.inverse_dynamics(s.q, s.v, s.a, s.wrench, s.point, outputs=("pose",))
    forward = model.forward_dynamics(s.q, s.v, s.effort, s.wrench, s.point, outputs=("pose",))
    machines = LongMachine(raw, model.independent), Machine(raw, model.independent)
    pairs = (("inverse", inverse, s.a, "effort"), ("forward", forward, s.effort, "acceleration"))
    for question, found, given, result in pairs:
        force = found.contact_force
        near = np.zeros(force.shape, bool)
        if question == "inverse":
            size = np.abs(np.column_stack([force, found.effort])).max(axis=1)[:, None]
            near = np.abs(force) <= np.maximum(HELD, found.bound / 10)[:, None] * size
        # Chains and contacts that push are six at least: friction holds no more than the rest.
        most = s.effort.shape[1] + force.shape[1] - 6
        ok = found.status == 0
        left = exact
        errors = {part: np.full(count, np.inf) for part in (question, "contacts")}
        # A force within its bound of 0 may be held or push: the answer is right as either.
        for zeros in product((False, True), repeat=force.shape[1]):
            pattern_force = np.where(zeros, 0.0, force)
            again = ok & (near >= zeros).all(axis=1)
            again &= ((pattern_force == 0).sum(axis=1) <= most) | ~near.any(axis=1)
            for pattern in np.unique(pattern_force[again] != 0, axis=0):
                rows = np.flatnonzero(again & ((pattern_force != 0) == pattern).all(axis=1))
                ports = (found.pose, s.q, s.v, given, s.wrench, s.point, pattern_force)
                ports = tuple(x[rows] for x in ports)
                terms = _terms(machines[0], question, ports)
                # What friction holds at 0 has no size that its rounding could be relative to.
                pushed = np.where(terms[0][1] == 0, pattern_force[rows], force[rows])
                for part, got in ((question, getattr(found, result)[rows]), ("contacts", pushed)):
                    if got.size:
                        size, off = _error(got, [t[part != question] for t in terms])
                        errors[part][rows] = np.fmin(errors[part][rows], off / size)
                for i in np.flatnonzero(found.bound[rows] < 1)[:left]:
                    one, _ = getattr(machines[1], question)(*(x[i] for x in ports))
                    size, _ = _error(getattr(found, result)[rows], [t[0] for t in terms])
                    off = max(abs(_many(x) - y) for x, y in zip(terms[0][0][i], one, strict=True))
                    yield Row(
                        "long", name, float(off) / float(size[i]), float(found.bound[rows][i])
                    )
                left -= min(left, len(rows))
        for part, title in ((question, question), ("contacts", f"{question}, contacts")):
            for error, bound in zip(errors[part][ok], found.bound[ok], strict=True):
                # Without a bound below 1 the text may find it singular as well.
                if np.isfinite(error) or (bound < 1 and (part == question or force.size)):
                    yield Row(title, name, float(error), float(bound))


def _terms(machine: Any, question: str, ports: tuple[Array, ...]) -> list[tuple[Array, Array]]:
    """Results and contact forces, a row each: all, gravity alone, and with one more each."""
    near, q, v, given, w, at, force = (x.T for x in ports)
    cases = [(v, given, w), (0 * v, 0 * given, 0 * w), (0 * v, 0 * given, w)]
    cases += [(v, 0 * given, 0 * w), (0 * v, given, 0 * w)]
    found = []
    for x, y, z in cases:
        both = getattr(machine, question)(near, q, x, y, z, at, force)
        shape = (ports[0].shape[0],)
        found.append(
            tuple(
                np.array([np.broadcast_to(e, shape) for e in part]).reshape(len(part), *shape).T
                for part in both
            )
        )
    return found


def _many(x: Any) -> Any:
    """A number of 64 bits in 60 digits."""
    return mpf(float(x)) + mpf(float(x - np.longdouble(float(x))))


def _error(got: Array, terms: Sequence[Array]) -> tuple[Array, Array]:
    """The largest entry or term, all, gravity alone and one more each; and what `got` is off."""
    exact, gravity, *others = terms
    off = np.abs(got - exact).max(axis=1)
    size = np.maximum(np.abs(exact).max(axis=1), np.abs(gravity).max(axis=1))
    for row in others:
        size = np.maximum(size, np.abs(row - gravity).max(axis=1))
    return np.maximum(size, np.finfo(float).tiny), off


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--states", type=int, default=500)
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--backend", default="numpy")
    parser.add_argument("--exact", type=int, default=10, help="of them by 60 digits as well")
    parser.add_argument("--first", type=int, default=0, help="first random machine that counts")
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    rows: list[Row] = []
    random = list(drawn(rng, given.machines))[given.first :]
    for name, raw in (*(() if given.first else bundled()), *random):
        new = list(checked(rng, name, raw, given.states, given.backend, given.exact))
        rows += new
        _print_all(name, new)
    _print_all("all", rows)


def _print_all(title: str, rows: Sequence[Row]) -> None:
    for question in sorted({row.question for row in rows}):
        _print(f"{title}: {question}", [row for row in rows if row.question == question])


def _print(title: str, rows: Sequence[Row]) -> None:
    if rows:
        worst, slack = max(row.ratio for row in rows), np.median([row.slack for row in rows])
        over = sum(row.ratio > 1 for row in rows)
        text = f"{len(rows):6} states, error / bound at most {worst:8.2g}, {over} above 1, "
        print(f"{title:50} {text}median of bound / error {slack:8.2g}", flush=True)


if __name__ == "__main__":
    main()
