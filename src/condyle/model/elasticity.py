"""Stiffness under load, compliance and modes of a mechanism whose parts give."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..questions.bound import SAFETY
from ..questions.numbers import GIVE, Layout
from ..status import Status
from .arguments import Arguments, Lead
from .contact_patches import surfaces_at
from .inverse_dynamics import InverseDynamics
from .model_result import ModelResult
from .poses import Poses
from .screws import eigenscrews
from .system import System
from .yielding import Yielding, place_by_coordinates
from .yielding_stiffness import condensed, require_all_giving

Array = np.ndarray
ALIKE = 1e-12  # relative difference from its transpose within which a matrix is symmetric
LARGEST = 1e100  # N/m and the like, of which squares are numbers
YIELDING = "elastic_yielding"
STEADY = 1e-13  # smallest eigenvalue over the largest, below which K counts as not definite


@dataclass(frozen=True)
class Equilibrium:
    """N loaded poses at rest, and the matrices there; NaN where the status is not 0.

    ports:   of the question `elastic`;  bound: of the relative error of K, (N,).
    K, elastic, M, D: (N, m, m);  twist: (N, 6, m).
    rigid:   which chains do not give, (N, n) or (n,);  rates: of joints by q', (N, n, m).
    inner:   whether every chain, and contacts that yield, are stable by themselves, (N,).
    load_map, contacts: of contacts that yield, see `CondensedStiffness`; else twist, and none.
    """

    ports: dict[str, Array]
    status: Array
    K: Array
    elastic: Array
    M: Array
    D: Array
    twist: Array
    rates: Array
    rigid: Array
    inner: Array
    bound: Array
    load_map: Array
    contacts: Array | float = 0.0

    @cached_property
    def parts(self) -> list[tuple[Array, Array]]:
        """Samples that are known, by number, and a basis Z, (m, r), of the rates that their rigid
        chains allow: all samples at once where no chain is rigid."""
        N, m = self.K.shape[:2]
        known = np.isfinite(self.K).all(axis=(1, 2)) & np.isfinite(self.M).all(axis=(1, 2))
        rows = np.flatnonzero(known)
        if not self.rigid.any():
            return [(rows, np.eye(m))] if rows.size else []
        parts = []
        rigid = np.broadcast_to(self.rigid, (N, self.rigid.shape[-1]))
        for i in rows.tolist():
            _, size, axes = np.linalg.svd(self.rates[i, rigid[i]])
            rank = int((size > size.max(initial=0.0) * m * np.finfo(float).eps).sum())
            parts.append((np.array([i]), axes[rank:].T))
        return parts

    @cached_property
    def modes(self) -> tuple[Array, Array]:
        """Squares of circular frequencies, rising, (N, m), and shapes as rows, (N, m, m).

        Infinite, and without a shape, where rigid chains hold.
        """
        square, shape = np.full(self.K.shape[:2], np.nan), np.full_like(self.K, np.nan)
        for rows, Z in self.parts:
            r = Z.shape[1]
            square[rows, r:] = np.inf
            K, M = (Z.T @ a[rows] @ Z for a in (self.K, self.M))
            root = np.linalg.inv(np.linalg.cholesky(M))
            A = root @ K @ root.transpose(0, 2, 1)
            turned = A.transpose(0, 2, 1)
            values, vectors = np.linalg.eigh((A + turned) / 2)
            size = np.abs(A).max(axis=(1, 2), initial=0.0)
            alike = np.abs(A - turned).max(axis=(1, 2), initial=0.0) <= ALIKE * size
            for i in np.flatnonzero(~alike).tolist():  # a load without a potential
                found, own = np.linalg.eig(A[i])
                order = np.argsort(found.real, kind="stable")
                values[i] = found.real[order]
                vectors[i] = (own.real / np.linalg.norm(own.real, axis=0))[:, order]
            square[rows, :r] = values
            shape[rows, :r] = (Z @ root.transpose(0, 2, 1) @ vectors).transpose(0, 2, 1)
        return square, shape


@dataclass(eq=False)
class Elasticity:
    """What a model says of small deflections and vibrations; see `Model`."""

    system: System
    arguments: Arguments
    poses: Poses
    inverse: Callable[[], InverseDynamics]

    def stiffness(
        self, q: Any, effort: Any, wrench: Any, at: Any, compliant: bool = False
    ) -> ModelResult:
        """As `Model.stiffness`."""
        lead, here = self.equilibrium(q, effort, wrench, at, compliant)
        scale = self._scale(here)
        K, (stable, inverse) = here.K, _inverted(here, scale)
        compliance = here.twist @ inverse @ here.load_map.transpose(0, 2, 1) + here.contacts
        if here.rigid.any():
            held = here.rates * np.broadcast_to(here.rigid, here.rates.shape[:2])[..., None]
            stiff = held.transpose(0, 2, 1) @ held
            K = K + np.where(stiff != 0, np.copysign(np.inf, stiff), 0.0)
        status = np.where((here.status == Status.ok) & ~stable, Status.unstable, here.status)
        length = self.system.lengths(self.system.labels(len(K)))
        turn, screw = eigenscrews(compliance, length)
        result = ModelResult(
            K=K,
            compliance=compliance,
            geometric=here.K - here.elastic,
            **_principal("translation", compliance[:, :3, :3]),
            **_principal("rotation", compliance[:, 3:, 3:]),
            eigenscrew_compliance=turn,
            eigenscrew=screw,
            bound=here.bound,
            status=status.astype(np.uint8),
        )
        return result.shaped(lead)

    def modes(
        self, q: Any, effort: Any, wrench: Any, at: Any, compliant: bool = False
    ) -> ModelResult:
        """As `Model.modes`."""
        lead, here = self.equilibrium(q, effort, wrench, at, compliant)
        stable = _inverted(here, self._scale(here))[0]
        square, shape = here.modes
        with np.errstate(invalid="ignore", divide="ignore"):
            frequency = np.sign(square) * np.sqrt(np.abs(square)) / (2 * np.pi)
            loss = np.einsum("nji,nik,njk->nj", shape, here.D, shape)
            damping = np.where(square > 0, loss / (2 * np.sqrt(square)), np.nan)
            size = np.abs(square)
            most = np.where(np.isfinite(size), size, 0.0).max(axis=1, initial=0.0)
            least = size.min(axis=1, initial=np.inf)
        status = np.where((here.status == Status.ok) & ~stable, Status.unstable, here.status)
        result = ModelResult(
            frequency=frequency,
            shape=shape,
            damping=damping,
            eigenvalue=_damped(here),
            displacement=shape @ here.twist.transpose(0, 2, 1),
            bound=here.bound * most / least,
            status=status.astype(np.uint8),
        )
        return result.shaped(lead)

    def equilibrium(
        self, q: Any, effort: Any, wrench: Any, at: Any, compliant: bool = False
    ) -> tuple[Lead, Equilibrium]:
        """Matrices at loaded poses, and the leading shape of what is given.

        Args: compliant: whether contacts yield.
        """
        system = self.system
        system.require_giving()
        own = (self.arguments.q, *((self.arguments.effort,) if effort is not None else ()))
        given = (q, *(() if effort is None else (effort,)))
        lead, ports = self.arguments.samples(own, given, wrench, at)
        count = math.prod(lead)
        ports = {n: np.broadcast_to(a, (count, a.shape[1])) for n, a in ports.items()}
        labels = system.labels(count)
        rigid = _rigid(system, labels)
        if compliant:
            inverse = self.inverse().yielding()
            require_all_giving(system, rigid)
            ports, status, error = self._yielded(inverse, ports, effort is None)
            question = YIELDING
        else:
            ports, status, error = self._held(ports, effort is None)
            question = "elastic"
        values = system.kernel(question).run(ports | labels).values
        bad = status != Status.ok
        size = np.abs(values["K"]).max(axis=(0, 1), initial=0.0)
        status = np.where(~bad & ~(size < LARGEST), Status.overflow, status)
        bad = status != Status.ok
        for value in values.values():
            value[..., bad] = np.nan
        first = {name: np.moveaxis(value, -1, 0) for name, value in values.items()}
        unit = self._unit(system.lengths(labels))
        inner, data = first["inner"] > 0, first["data_error"].sum(axis=1)
        contacts: dict[str, Array] = {}
        if compliant:
            part = condensed(system.mechanism, ports["pose"], first, len(system.independent))
            first |= vars(part)
            contacts = {"contacts": part.contacts}
            inner &= part.stable
        else:
            first["rates"], first["load_map"] = first["A"].transpose(0, 2, 1), first["twist"]
        size = [
            np.abs(a * unit).max(axis=(1, 2), initial=0.0) for a in (first["terms"], first["K"])
        ]
        with np.errstate(invalid="ignore", divide="ignore"):
            lost = np.fmax(1.0, size[0] / size[1])
        own_names = ("K", "elastic", "M", "D", "twist", "rates", "load_map")
        equilibrium = Equilibrium(
            ports,
            status,
            rigid=rigid,
            inner=inner,
            bound=lost * (SAFETY * data + error),
            **{name: first[name] for name in own_names},
            **contacts,
        )
        return lead, equilibrium

    def _held(self, ports: dict[str, Array], choose: bool) -> tuple[dict[str, Array], Array, Array]:
        """Ports of the question: with poses, and efforts that hold them if those are chosen."""
        q, wrench = ports["q"], np.hstack([ports["force"], ports["moment"]])
        if choose:
            held = self.inverse().solve((q, 0 * q, 0 * q), wrench, ports["point"], ("pose",), None)
            pose, error = held.pose, held.bound
            ports["effort"] = np.where((held.status == Status.ok)[:, None], held.effort, 0.0)
        else:
            held = self.poses.inverse_kinematics(q, None, None)
            pose, error = held.pose, np.zeros(len(q))
        good = (held.status == Status.ok)[:, None]
        return ports | {"pose": np.where(good, pose, 0.0)}, held.status, error

    def _yielded(
        self, inverse: InverseDynamics, ports: dict[str, Array], choose: bool
    ) -> tuple[dict[str, Array], Array, Array]:
        """As `_held`, where contacts have yielded to the forces that efforts leave to them."""
        system, q = self.system, ports["q"]
        still, error = np.zeros_like(q), np.zeros(len(q))
        if choose:
            wrench = np.hstack([ports["force"], ports["moment"]])
            found = inverse.solve((q, still, still), wrench, ports["point"], ("pose",), None)
            pose, status, error = found.pose, found.status, found.bound
            ports = ports | {"effort": np.where(status[:, None] == Status.ok, found.effort, 0.0)}
        else:
            found = self.poses.inverse_kinematics(q, None, None)
            kept = np.where((found.status == Status.ok)[:, None], found.pose, np.nan)
            place = place_by_coordinates(
                system.closure(system.independent, None).followed, q, still, still
            )
            solver = Yielding(system, inverse.distributor, self._pressed, exact=0)
            poses, _, known = solver.solve(place, kept, ports)
            pose, reached = poses["pose"], self._pressed(poses, known, ports)[1]
            status = np.where(found.status == Status.ok, reached, found.status)
        pose = np.where((status == Status.ok)[:, None], pose, 0.0)
        return ports | self._levels(pose), status, error

    def _levels(self, pose: Array) -> dict[str, Array]:
        """Ports of poses off the surfaces."""
        return {"pose": pose, "level": surfaces_at(self.system.mechanism, pose)["level"].T}

    def _pressed(
        self, poses: dict[str, Array], reached: Array, inputs: Mapping[str, Array]
    ) -> tuple[dict[str, Array], Array]:
        """Contact forces (k, N) under given efforts, and the status of poses."""
        pose = np.where(reached[:, None], poses["pose"], 0.0)
        values = self.system.kernel(YIELDING).run({**inputs, **self._levels(pose)}).values
        there = reached & np.isfinite(values["K"]).all(axis=(0, 1))
        return values, np.where(there, Status.ok, Status.unreachable)

    def _unit(self, length: Any) -> Array:
        """Factors of a stiffness, (N, m, m) or (m, m), that make its entries N/m."""
        angles = np.array([name not in ("X", "Y", "Z") for name in self.system.independent])
        unit = np.where(angles, 1.0 / np.reshape(length, (-1, 1)), 1.0)
        return unit[:, :, None] * unit[:, None, :]

    def _scale(self, here: Equilibrium) -> Array:
        return self._unit(self.system.lengths(self.system.labels(len(here.K))))


def _rigid(system: System, labels: dict[str, Array]) -> Array:
    """Chains that do not give, in the order of the file, (n,), or (N, n) of several mechanisms."""
    numbers, layout = system.numbers, Layout.of(system.structure)
    rigid, start = np.zeros((len(numbers), len(numbers.order)), dtype=bool), 0
    for slots, own in zip(layout.lanes, numbers.lanes, strict=True):
        at = slots["give"][0]
        parts = [own[:, at + GIVE.index(name)] for name in ("stiffness", "short_range", "soft")]
        places = list(numbers.order[start : start + own.shape[2]])
        rigid[:, places] = ~np.any(parts, axis=0)
        start += own.shape[2]
    variant = next(iter(labels.values()), None)
    return rigid[0] if variant is None else rigid[variant]


def _inverted(here: Equilibrium, scale: Array) -> tuple[Array, Array]:
    """Where K is positive definite, (N,), and its inverse; NaN where it is singular.

    Rates that rigid chains hold are not counted, and the inverse has nothing along them.
    """
    inverse, stable = np.full_like(here.K, np.nan), np.zeros(len(here.K), dtype=bool)
    scale = np.broadcast_to(scale, here.K.shape)
    for rows, Z in here.parts:
        K, scaled = (Z.T @ a @ Z for a in (here.K[rows], (here.K * scale)[rows]))
        size = np.linalg.eigvalsh((scaled + scaled.transpose(0, 2, 1)) / 2)
        most = STEADY * np.abs(size).max(axis=1, initial=0.0)
        stable[rows] = here.inner[rows] & (size > most[:, None]).all(axis=1)
        regular = (np.abs(size) > most[:, None]).all(axis=1)
        inverse[rows[regular]] = Z @ np.linalg.inv(K[regular]) @ Z.T
    return stable, inverse


def _principal(name: str, block: Array) -> dict[str, Array]:
    """Principal compliances, falling, (N, 3), and their axes in {S}, as rows."""
    sizes, axes = np.full(block.shape[:2], np.nan), np.full(block.shape, np.nan)
    good = np.isfinite(block).all(axis=(1, 2))
    if good.any():
        symmetric = (block[good] + block[good].transpose(0, 2, 1)) / 2
        values, vectors = np.linalg.eigh(symmetric)
        sizes[good], axes[good] = values[:, ::-1], vectors[:, :, ::-1].transpose(0, 2, 1)
    return {name: sizes, f"{name}_axis": axes}


def _damped(here: Equilibrium) -> Array:
    """Roots s of damped motions x e^(s t), (N, 2 m) [1/s], in the order of their size; NaN where
    rigid chains hold."""
    N, m = here.K.shape[:2]
    all_roots = np.full((N, 2 * m), np.nan, dtype=complex)
    for rows, Z in here.parts:
        K, M, D = (Z.T @ a[rows] @ Z for a in (here.K, here.M, here.D))
        r = Z.shape[1]
        A = np.zeros((len(rows), 2 * r, 2 * r))
        A[:, :r, r:] = np.eye(r)
        A[:, r:, :r], A[:, r:, r:] = -np.linalg.solve(M, K), -np.linalg.solve(M, D)
        roots = np.linalg.eigvals(A)
        order = np.lexsort((roots.imag, np.abs(roots)), axis=1)
        all_roots[rows, : 2 * r] = np.take_along_axis(roots, order, axis=1)
    return all_roots
