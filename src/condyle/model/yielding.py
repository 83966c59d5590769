"""Contacts that yield: poses at which every gap is what its force makes of it, quasi-statically.

The unknowns are the levels phi = c of the k surfaces. At given levels the pose follows from what is
prescribed, and from that the forces; the residual is

    r = gap(c) + sign(lambda) d(|lambda|),

with d the law of the contact. Newton's slopes are exact, d lambda / d c by the implicit function
theorem with the efforts' active set, but for two small terms: how the curvatures change, and how
rates do. Rates are those of gaps that stay. Contacts without compliance keep level 0, and so do
unilateral ones that would have to pull: they are flagged, as without compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..backends.kernel import sample_rows
from ..kinematics.chain.muscle import muscles
from ..kinematics.constraints import indices
from ..motion.followed_closure import MOTION, FollowedClosure
from ..questions.bound import CERTIFIED
from ..status import Status
from .contact_patches import contact_patches, surfaces_at
from .distributing import Distributor
from .implicit import balanced, directional_rows, solved
from .system import System

Array = np.ndarray
Arrays = dict[str, Array]
Evaluate = Callable[[Arrays, Array, Mapping[str, Array]], tuple[Arrays, Array]]
MOST, EXACT = 30, 12  # steps; after the latter forces alone lead, as where active sets alternate
CLOSED = 1e-13  # metres: largest residual
STEPS, SETTLED = 20, 1e-14  # of poses at given levels; the last of them, in metres and radians


@dataclass(frozen=True)
class LevelPoses:
    """Poses at given levels: pose and its rates by name, (N, 6) each, and d X / d c, (N, 6, k)."""

    motion: Arrays
    by_level: Array


Place = Callable[[Array, Array, Array], LevelPoses]  # of levels (N, k), poses nearby, which samples


def place_by_coordinates(closure: FollowedClosure, s: Array, s1: Array, s2: Array) -> Place:
    """Poses where phi = c and prescribed coordinates, or a landmark's path, are s, (N, 6 - k)."""

    def place(level: Array, pose: Array, rows: Array) -> LevelPoses:
        k, still = level.shape[1], np.zeros_like(pose)
        goal = np.hstack([level, s[rows]])
        pose = pose.copy()
        for _ in range(STEPS):
            values, K, _ = closure.conditions(pose, still)
            step = np.linalg.solve(K, (goal - values)[..., None])[..., 0]
            pose += step
            if not np.abs(step).max(initial=0.0) > SETTLED:
                break
        _, K, _ = closure.conditions(pose, still)
        inverse = np.linalg.inv(K)
        rate = (inverse[..., k:] @ s1[rows, :, None])[..., 0]
        bias = closure.conditions(pose, rate)[2]
        pull = np.hstack([np.zeros_like(level), s2[rows]]) - bias
        acceleration = (inverse @ pull[..., None])[..., 0]
        motion = dict(zip(MOTION, (pose, rate, acceleration), strict=True))
        return LevelPoses(motion, inverse[..., :k])

    return place


@dataclass(frozen=True)
class Yielding:
    """Finds where contacts yield to, for one mechanism.

    evaluate: efforts and contact forces at poses, with statuses, as of `Robust.evaluate_at`.
    exact:    steps with the slopes of those forces; then, or where efforts are given, without.
    """

    system: System
    distributor: Distributor
    evaluate: Evaluate
    exact: int = EXACT

    @np.errstate(all="ignore")
    def solve(
        self, place: Place, pose: Array, inputs: Mapping[str, Array]
    ) -> tuple[Arrays, Array, Array]:
        """Poses and rates by name, (N, 6) each, indentations, (N, k) [m], and where they were
        found, (N,).

        Args: pose: on the surfaces, (N, 6); NaN where there is none;  inputs: the load by port.
        """
        mechanism, count = self.system.mechanism, len(pose)
        k = len(mechanism.contacts)
        motion = {name: np.full((count, 6), np.nan) for name in MOTION}
        level, depth = np.zeros((count, k)), np.full((count, k), np.nan)
        pose, known = pose.copy(), np.zeros(count, dtype=bool)
        rows = np.flatnonzero(np.isfinite(pose).all(axis=1))
        for step in range(MOST if rows.size else 0):
            at = place(level[rows], pose[rows], rows)
            given = sample_rows(inputs, rows, count)
            values, status = self.evaluate(at.motion, np.ones(len(rows), dtype=bool), given)
            there, force = at.motion["pose"], values["contact_force"].T
            surfaces = surfaces_at(mechanism, there)
            gap = surfaces["gap"].T
            patch = contact_patches(mechanism, there, force)
            give = np.where(np.isinf(patch.stiffness), 0.0, patch.indentation)
            residual = gap + np.sign(force) * give
            lawful = np.isfinite(residual).all(axis=1)
            # Samples without efforts stay where they are, and their status says why.
            done = (np.abs(residual).max(axis=1) <= CLOSED) | (status != Status.ok)
            for name in MOTION:
                motion[name][rows[done]] = at.motion[name][done]
            depth[rows[done]], known[rows[done]] = give[done], True
            left = lawful & ~done
            if not left.any():
                break
            flexible = np.where(patch.stiffness > 0, 1 / patch.stiffness, 0.0)[left]
            slope = np.zeros((int(left.sum()), k, k))
            if step < self.exact:
                slope += flexible[..., None] * self._force_slopes(at, values, given, left)
            diagonal = np.arange(k)
            slope[:, diagonal, diagonal] += 1 / surfaces["steepness"].T[left]
            rows, wanted = rows[left], -residual[left, :, None]
            level[rows] += solved(slope, wanted)[0][..., 0]
            pose[rows] = there[left]
        return motion, depth, known

    def _force_slopes(
        self, at: LevelPoses, values: Arrays, given: Mapping[str, Array], rows: Array
    ) -> Array:
        """d lambda / d level, (N, k, k), of some samples; 0 where efforts have no derivatives, so
        that forces alone lead there, one after the other."""
        system, own = self.system, self.distributor
        count, k = int(rows.sum()), len(system.structure.contacts)
        if muscles(system.mechanism.chains) or system.structure.walls or own.unsolved_friction:
            return np.zeros((count, k, k))
        ind = indices(system.independent)
        pose, rate, acceleration = (at.motion[name][rows] for name in MOTION)
        ports = {"pose": pose, "q": pose[:, ind], "q1": rate[:, ind], "q2": acceleration[:, ind]}
        load = ("force", "moment", "point", *system.structure.given)
        ports |= {name: given[name][rows] for name in load}
        ports |= {name: values[name].T[rows] for name in ("effort", "contact_force")}
        ports["level"] = surfaces_at(system.mechanism, pose)["level"].T
        error = np.full(count, CERTIFIED)
        held = balanced(system.by_numpy, ports, own, error, question="yielding")
        columns = []
        for i, moved in enumerate(np.moveaxis(at.by_level[rows][:, ind], 2, 0)):
            unit = np.zeros_like(ports["level"])
            unit[:, i] = 1.0
            changes = directional_rows(held, {"level": unit, "q": moved})
            columns.append(held.applied("contact_force", changes[..., None]))
        return np.concatenate(columns, axis=2)
