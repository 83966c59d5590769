"""The robust path, for samples that a kernel cannot vouch for: by numpy, from the same graphs.

Contacts are followed from home, efforts come from singular values of A itself, contact forces from
the pseudo-inverse, and singular values from LAPACK.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from ..backends.kernel import Arrays
from ..backends.numpy_kernel import NumpyKernel
from ..dynamics.minimum_norm import minimum_norm
from ..graph.program import Numbers
from ..kinematics.rotation import GIMBAL_LOCK
from ..kinematics.singularities import SINGULAR, ratio
from ..motion.followed_closure import FollowedClosure
from ..questions import Question
from ..questions.bound import CERTIFIED, TINY, bound, forward_bound
from ..questions.numbers import characteristic
from ..questions.structure import Structure
from ..status import Status, judge
from .distributing import Distributor
from .jamming import balanced, solved


class Robust:
    """Samples of one mechanism and formulation, one array operation after the other."""

    def __init__(
        self,
        structure: Structure,
        numbers: Numbers,
        independent: tuple[str, ...],
        distributor: Distributor,
    ) -> None:
        """Args: distributor: of least norm, for the patterns of friction."""
        self._structure, self._numbers = structure, numbers
        self._independent = independent
        self._distributor = distributor
        angles = [name not in ("X", "Y", "Z") for name in independent]
        self._kernels: dict[tuple[Any, ...], NumpyKernel] = {}
        self._scale = np.where(angles, characteristic(structure, numbers).item(), 1.0)

    def _kernel(self, *key: Any) -> NumpyKernel:
        """The kernel of a question and its details; made once."""
        if key not in self._kernels:
            question = Question.about(self._structure, *key)
            self._kernels[key] = NumpyKernel(question.variants(), self._numbers)
        return self._kernels[key]

    @cached_property
    def _followed(self) -> FollowedClosure:
        return FollowedClosure.of(self._structure, self._numbers, tuple(self._independent))

    def evaluate(self, inputs: Mapping[str, np.ndarray]) -> tuple[Arrays, np.ndarray]:
        """All results of inverse dynamics by name, samples last, and their statuses."""
        values, closed = self.motion({name: inputs[name] for name in ("q", "q1", "q2")})
        poses = {name: a.T for name, a in values.items()}
        return self.evaluate_at(poses, closed == Status.ok, inputs)

    def evaluate_at(
        self, poses: Arrays, reached: np.ndarray, inputs: Mapping[str, np.ndarray]
    ) -> tuple[Arrays, np.ndarray]:
        """The same at poses with their rates, (N, 6) each, that may be off the surfaces.

        Args: reached: where there is such a pose, (N,).
        """
        values = {name: a.T for name, a in poses.items()}
        load = {n: inputs[n] for n in ("force", "moment", "point", *self._structure.given)}
        with np.errstate(all="ignore"):
            values |= self.configuration(poses)
            system = self._kernel("system").run(poses | load).values
            s = {name: np.moveaxis(a, -1, 0) for name, a in system.items()}
            values["joint_rate"], values["joint_acceleration"] = (
                s[name].T for name in ("joint_rate", "joint_acceleration")
            )
            # A (N, m, n) by entry and lane; b (N, parts, m).
            A, right = s["A"], np.concatenate([s["b"], s["b_gravity"]], axis=1)
            tau = minimum_norm(A.transpose(0, 2, 1), self._scale, right.transpose(0, 2, 1))
            share, gravity = np.split(tau, 2, axis=2)
            effort = share.sum(axis=2)
            values["share"], values["gravity"] = (a.transpose(2, 1, 0) for a in (share, gravity))
            values["effort"] = effort.T
            values["contact_force"] = self._contact_forces(s, effort).T
            values["slip"], values["drag"] = system["slip"], system["drag"]
            status = self._judged(reached, values, effort)
            values["bound"] = _bound(s, effort)
            if self._structure.friction:
                parts, n, N = values["share"].shape
                values["share"] = np.full((parts + 2, n, N), np.nan)
                still = np.zeros((2, n, N))  # nothing rubs at rest
                values["gravity"] = np.concatenate([values["gravity"], still])
                if (good := np.flatnonzero(status == Status.ok)).size:
                    better = self._distributor.solve({n: a[..., good] for n, a in system.items()})
                    status[good] = better.pop("status")
                    for name in ("shortfall", "residual_wrench"):
                        better.pop(name)
                    for name, a in better.items():
                        values[name][..., good] = a
                    values["bound"] = np.fmax(CERTIFIED, _bound(s, values["effort"].T))
        return values, status

    def forward(self, inputs: Mapping[str, np.ndarray]) -> tuple[Arrays, np.ndarray]:
        """All results of forward dynamics by name, samples last, and their statuses."""
        q, q1 = inputs["q"], inputs["q1"]
        values, closed = self.motion({"q": q, "q1": q1, "q2": np.zeros_like(q)})
        poses, reached = {name: a.T for name, a in values.items()}, closed == Status.ok
        load = "effort", "force", "moment", "point"
        others = {name: inputs[name] for name in (*load, *self._structure.given)}
        with np.errstate(all="ignore"):
            configuration = self.configuration(poses)
            system = self._kernel("forward_system").run(poses | others).values
            s = {name: np.moveaxis(a, -1, 0) for name, a in system.items()}
            solution = balanced(s, self._structure.friction)
            every, w = np.stack([solved(s["S"], one)[0] for one in solution.w]), solution.w[0]
            q2 = every[0]
            moved = poses["pose_acceleration"] + (s["M_J"] @ q2[..., None])[..., 0]
            turned = s["bias"] + (s["J"].transpose(0, 2, 1) @ w[..., None])[..., 0]
            least, most = configuration["J_A_extremes"]
            assembled = reached & (configuration["discriminant"] >= 0).all(axis=0)
            regular = solution.regular & (ratio(least, most) >= SINGULAR)
            finite = np.isfinite(system["F"]).all(axis=0)
            locked = np.abs(system["cos_beta"]) < GIMBAL_LOCK
            finite &= np.isfinite(q2).all(axis=1) | (solution.count == 0) | locked
            status = judge(assembled, regular, finite)
            status[(status == Status.ok) & (solution.count == 0)] = Status.jammed
            status[(status == Status.ok) & (solution.count > 1)] = Status.ambiguous
            status[(status == Status.ok) & locked] = Status.gimbal_lock
            accurate = _forward_bound(s, w, solution.force[0])
            twist_rate = s["twist_rate"] + (s["along"] @ w[..., None])[..., 0]
        return {
            "acceleration": q2.T,
            "bound": accurate,
            "contact_force": solution.force[0].T,
            "all_accelerations": np.moveaxis(every, 1, -1),
            "all_contact_forces": np.moveaxis(solution.force, 1, -1),
            "pose": poses["pose"].T,
            "pose_rate": poses["pose_rate"].T,
            "pose_acceleration": moved.T,
            "joint": configuration["joint"],
            "joint_rate": system["joint_rate"],
            "joint_acceleration": turned.T,
            "slip": system["slip"],
            "drag": system["drag"],
            "twist_rate": twist_rate.T,
        }, status

    def forward_statuses(self, inputs: Mapping[str, np.ndarray]) -> np.ndarray:
        """Statuses of forward dynamics, by numpy, (N,)."""
        answer = self._kernel("forward").run(inputs)
        answer.mend(inputs, self.forward)
        return answer.status

    def coriolis(self, unconstrained: bool, ports: Mapping[str, np.ndarray]) -> np.ndarray:
        """Result of the question of that name, samples last."""
        return self._kernel("coriolis", unconstrained).run(ports).values["coriolis"]

    def motion(self, inputs: Mapping[str, np.ndarray]) -> tuple[Arrays, np.ndarray]:
        """X_EE and its rates by name, (6, N) each, and statuses: whether contacts can be met."""
        answer = self._kernel("motion").run(inputs)
        answer.mend(
            inputs, lambda few: self._followed.solve(few["q"], few["q1"], few["q2"]).answer()
        )
        return answer.values, answer.status

    def configuration(self, inputs: Mapping[str, np.ndarray]) -> Arrays:
        """The configuration's results at poses by name, samples last; always by LAPACK."""
        values = self._kernel("configuration").run({"pose": inputs["pose"]}).values
        return values | {"J_W_sigma": _singular_values(values["J_W"])}

    def survey(self, wanted: tuple[str, ...], q: np.ndarray) -> Arrays:
        """Results of that question, and `met`, by name, samples last."""
        moved, status = self.motion({"q": q, "q1": 0 * q, "q2": 0 * q})
        asked = (*wanted, *(() if "rows" in wanted else ("rows",)))
        values = self._kernel("survey", asked, True).run({"pose": moved["pose"].T}).values
        return values | {"J_W_sigma": _singular_values(values["rows"]), "met": status == Status.ok}

    def _contact_forces(self, s: Arrays, effort: np.ndarray) -> np.ndarray:
        """lambda along the unit normals, (N, k), from what the efforts leave over."""
        G = s["normal"].transpose(0, 2, 1)
        left = s["Q"] - (s["J"] @ effort[..., None])[..., 0]
        mu = np.full(G.shape[:1] + G.shape[2:], np.nan)
        good = np.isfinite(left).all(axis=1) & np.isfinite(G).all(axis=(1, 2))
        mu[good] = (np.linalg.pinv(G[good]) @ left[good][..., None])[..., 0]
        return mu

    def _judged(self, reached: np.ndarray, values: Arrays, effort: np.ndarray) -> np.ndarray:
        least, most = values["J_A_extremes"]
        sigma = values["J_W_sigma"]
        regular = np.minimum(ratio(least, most), ratio(sigma[-1], sigma[0])) >= SINGULAR
        assembled = reached & (values["discriminant"] >= 0).all(axis=0)
        return judge(assembled, regular, np.isfinite(effort).all(axis=1))


def _bound(s: Arrays, effort: np.ndarray) -> np.ndarray:
    """The bound of minimum-norm efforts, (N,), as `questions.bound` has it.

    Args: s: results of `system`, samples first;  effort: (N, n).
    """
    lengths = np.linalg.norm(s["A"], axis=2)
    volume = np.prod(_singular_values((s["A"] / lengths[..., None]).T), axis=0)
    lost = np.linalg.norm(s["uncancelled"] / lengths, axis=1)
    lost = np.fmax(1.0, lost / (np.linalg.norm(effort, axis=1) + TINY))
    return bound(s["data_error"].T, lost, volume)


def _forward_bound(s: Arrays, w: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The bound of accelerations, (N,).

    Args: s: results of `forward_system`, samples first;  w: (N, m);  force: (N, k).
    """
    N, T = (s[name].transpose(0, 2, 1) for name in ("normal", "friction"))
    A = np.concatenate([s["H"], T * np.copysign(1.0, force)[:, None] - N], axis=2)
    columns = np.linalg.norm(A, axis=1)
    A = A / columns[:, None]
    rows = np.linalg.norm(A, axis=2)
    sigma = _singular_values(np.moveaxis(A / rows[..., None], 0, -1))
    size = np.linalg.norm(columns * np.concatenate([w, force], axis=1), axis=1)
    lost = np.fmax(1.0, np.linalg.norm(s["F"] / rows, axis=1) / (size + TINY))
    long = np.fmax(1.0, np.linalg.norm(s["S"], axis=2, keepdims=True))
    opened = np.abs(np.linalg.det(s["S"] / long))
    return forward_bound(s["data_error"].sum(axis=1), lost / opened, sigma[-1] / sigma[0])


def _singular_values(rows: np.ndarray) -> np.ndarray:
    """Singular values of matrices, samples last, (m, N); NaN where there is no matrix."""
    A = np.moveaxis(rows, -1, 0)
    good = np.isfinite(A).all(axis=(1, 2))
    sigma = np.full((min(A.shape[1:]), len(A)), np.nan)
    sigma[:, good] = np.linalg.svd(A[good], compute_uv=False).T
    return sigma
