"""Whether bounds hold: errors against an independent text in 60 digits, over `bound`.

    python -m benchmarks.accuracy --states 500 --machines 50 --seed 1

Bundled and random mechanisms, families mixed where they share a unit, 0 to 5 contacts on all
surfaces, friction from 0 to 4. Half of the states are next to the end of what is reached along
their direction, at a distance of 1e-2 to 1e-9 of the way: at a limit or a singularity. Errors are
of the largest entry, or of the largest term where entries cancel: gravity, load, accelerations
(efforts in forward dynamics) and rates, each alone. A state takes a second or two.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from condyle.mechanism.files import parse
from condyle.mechanism.library import bundled_mechanisms, bundled_text
from condyle.model.model import Model

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from oracles.digits import Machine
from oracles.random_mechanism import SURFACES, random_mechanism, toml_text

Array = np.ndarray
Rng = np.random.Generator
FAMILIES = (("RSS",), ("PSS",), ("SPS",), ("PSS", "SPS", "cable"), ("cable", "SPS"))
UNIT = 2.0**-53
HELD = 1e-12  # of the largest contact force: one that friction holds at 0


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
        """Its median is under 1e3."""
        return self.bound / max(self.error, UNIT)


def bundled() -> Iterator[tuple[str, dict[str, Any]]]:
    """The bundled mechanisms as raw dictionaries."""
    for name in bundled_mechanisms():
        yield name, tomllib.loads(bundled_text(name))


def drawn(rng: Rng, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Random mechanisms: every number of contacts with every set of families in turn."""
    for i in range(count):
        families, k = FAMILIES[i % len(FAMILIES)], (i // len(FAMILIES) + i) % 6
        surfaces = list(rng.permutation(SURFACES))
        n = int(rng.integers(max(6 - k, 3), 9))
        raw = random_mechanism(rng, families, n, k, surfaces, ball_radius=3.0 * (i % 2))
        for contact in raw.get("contact", [])[: i % 3]:
            contact["friction"] = {"coefficient": float(rng.uniform(0, 4)) if i % 4 else 0.3}
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
    way = rng.normal(0, 0.3, size) * scale
    still = np.zeros(size)
    low, high = np.zeros(count), np.ones(count)

    def there(part: Array) -> Array:
        return model.inverse_dynamics(way * part[:, None], still, still).status == 0

    for _ in range(4):
        high = np.where(there(high), 2 * high, high)
    for _ in range(45):
        middle = (low + high) / 2
        ok = there(middle)
        low, high = np.where(ok, middle, low), np.where(ok, high, middle)
    part = 10 ** rng.uniform(-3, 0, count) * np.minimum(low, 1)
    near = slice(count // 2)
    part[near] = low[near] * (1 - 10 ** rng.uniform(-9, -2, count // 2))
    swift, strong = (10 ** rng.uniform(-2, 1, (count, 1)) for _ in range(2))
    return States(
        way * part[:, None],
        rng.normal(0, 1, size) * scale * swift,
        rng.normal(0, 10, size) * scale,
        rng.normal(0, 1, (count, n)) * strong,
        rng.normal(0, 10, (count, 6)) * np.repeat([1, model.characteristic_length], 3),
        rng.normal(0, model.characteristic_length, (count, 3)),
    )


def checked(rng: Rng, name: str, raw: dict[str, Any], count: int, backend: str) -> Iterator[Row]:
    """Every answer of one mechanism."""
    model = Model(parse(toml_text(raw)), backend=backend, distribution="minimum_norm")
    machine = Machine(raw, model.independent)
    s = states(rng, model, count)
    inverse = model.inverse_dynamics(s.q, s.v, s.a, s.wrench, s.point, outputs=("pose",))
    forward = model.forward_dynamics(s.q, s.v, s.effort, s.wrench, s.point, outputs=("pose",))
    for i in range(count):
        q, v, a, effort, w, at = (x[i] for x in vars(s).values())
        none = 0 * w
        if inverse.status[i] == 0:
            near, force = inverse.pose[i], _held(inverse.contact_force[i])
            cases = ((v, a, w), (0 * v, 0 * a, none), (0 * v, 0 * a, w), (v, 0 * a, none))
            cases += ((0 * v, a, none),)
            found = [machine.inverse(near, q, x, y, z, at, force) for x, y, z in cases]
            error = _error(inverse.effort[i], [tau for tau, _ in found])
            yield Row("inverse", name, error, float(inverse.bound[i]))
        if forward.status[i] == 0:
            near, force = forward.pose[i], _held(forward.contact_force[i])
            cases = ((v, effort, w), (0 * v, 0 * effort, none), (0 * v, 0 * effort, w))
            cases += ((v, 0 * effort, none), (0 * v, effort, none))
            found = [machine.forward(near, q, x, y, z, at, force) for x, y, z in cases]
            error = _error(forward.acceleration[i], [x for x, _ in found])
            yield Row("forward", name, error, float(forward.bound[i]))


def _held(force: Array) -> Array:
    """Contact forces; those that friction holds at 0 are that exactly."""
    return np.where(np.abs(force) > HELD * np.abs(force).max(initial=0.0), force, 0.0)


def _error(got: Array, found: Sequence[Sequence[Any]]) -> float:
    """Of the largest entry or term: all of it, then gravity alone, and with one more each."""
    exact, gravity, *others = found
    off = max(abs(x - y) for x, y in zip(map(float, got), exact, strict=True))
    size = max(abs(x) for row in (exact, gravity) for x in row)
    for row in others:
        size = max(size, *(abs(x - g) for x, g in zip(row, gravity, strict=True)))
    return float(off / size)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--states", type=int, default=500)
    parser.add_argument("--machines", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--backend", default="numpy")
    given = parser.parse_args()
    rng = np.random.default_rng(given.seed)
    rows: list[Row] = []
    for name, raw in (*bundled(), *drawn(rng, given.machines)):
        new = list(checked(rng, name, raw, given.states, given.backend))
        rows += new
        for question in ("inverse", "forward"):
            _print(f"{name}: {question}", [row for row in new if row.question == question])
    for question in ("inverse", "forward"):
        _print(f"all: {question}", [row for row in rows if row.question == question])


def _print(title: str, rows: Sequence[Row]) -> None:
    if rows:
        worst, slack = max(row.ratio for row in rows), np.median([row.slack for row in rows])
        over = sum(row.ratio > 1 for row in rows)
        text = f"{len(rows):6} states, error / bound at most {worst:8.2g}, {over} above 1, "
        print(f"{title:50} {text}median of bound / error {slack:8.2g}", flush=True)


if __name__ == "__main__":
    main()
