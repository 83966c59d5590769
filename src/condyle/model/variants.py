"""Variants of a mechanism: numbers of its file as columns, every variant on every state.

    batch = model.variants({"platform.mass": masses, "chain.masseter_left.base": bases})
    batch.status, batch.reason(3)
    found = batch.inverse_dynamics(q, v, a, wrench)      found.effort, (V, ..., n)

Variants keep the coordinates of the mechanism that they come from, and the kernels of its model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..errors import CondyleError, InputError, brief
from ..graph.program import Numbers
from ..kinematics.chain.muscle import muscles
from ..kinematics.singularities import Singularity
from ..mechanism.kept_home import Keep
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import parsed, written
from ..mechanism.table import Table
from ..motion import Load, Motion
from ..motion.arrays import as_doubles
from ..motion.gravity_and_base import each
from ..motion.points import load_place
from ..questions.file_numbers import numbers_of
from ..questions.structure import Structure, structure_of
from ..questions.variant_numbers import VariantNumbers, variant_numbers
from ..status import Status
from .arguments import GIVEN, ORIGIN, POINT, WRENCH, Argument, given_of
from .contact_patches import compliant
from .distributing import Distributor
from .model import Contacts, Model, inverse_for_motion
from .model_result import ModelResult
from .overlapping import balls
from .system import VariantSource

if TYPE_CHECKING:
    import xarray as xr

    from ..simulation.simulating import ScenarioLike

Array = np.ndarray
MANY = 64  # variants whose numbers are worth a compiler
FAR = 1e5  # of any number: beyond it files may be refused
LOSSY = ("rotor_inertia", "viscous", "coulomb")
FREQUENCY = "frequency"
CACHED = 64  # mechanisms and distributors
FILLS: dict[str, Any] = {"f": np.nan, "b": False}


@dataclass(frozen=True)
class VariantGroup:
    """Variants of one structure, by their numbers, and what answers for them together."""

    variants: Variants
    rows: np.ndarray
    model: Model

    def inverse_dynamics(
        self,
        motion: Motion,
        wrench: Array,
        at: str | None,
        outputs: Sequence[str],
        threads: int | None = None,
        contacts: Contacts = "kept",
    ) -> ModelResult:
        """Inverse dynamics along a motion, flat: the N samples of one variant after the other.

        Args: wrench: (N, 6), at a point of the platform, by name;
              outputs: frequencies at rest among them, if they are asked for.
        """
        if contacts != "kept":
            return self._each(motion, wrench, at, outputs, threads, contacts)
        V, N, model = len(self.rows), len(motion.t), self.model
        poses = self.variants.model.poses if motion.kind == "pose" else model.poses
        states, _ = poses.of_motion(motion)
        if len(states[0]) == N:
            states = tuple(np.tile(a, (V, 1)) for a in states)  # type: ignore[assignment]
        point = ORIGIN
        if at is not None:
            point = np.repeat(self.variants.points(at)[self.rows], N, axis=0)
        self.variants.check_given(motion.given)
        given = each(motion.given, lambda a: np.tile(a, (V, 1)))
        load, names = np.tile(wrench, (V, 1)), [name for name in outputs if name != FREQUENCY]
        result = model._inverse.solve(states, load, point, names, threads, given)
        if FREQUENCY in outputs:
            _add_frequency(result, model.modes(states[0], None, load, point))
        return result

    def _each(
        self,
        motion: Motion,
        wrench: Array,
        at: str | None,
        outputs: Sequence[str],
        threads: int | None,
        contacts: Contacts,
    ) -> ModelResult:
        """The same, variant by variant, whose contacts yield by themselves."""
        self.variants.check_given(motion.given)
        parts, N = [], len(motion.t)
        names = [name for name in outputs if name != FREQUENCY]
        for k, i in enumerate(self.rows.tolist()):
            model = self.variants.alone(i)
            inverse, states, _ = inverse_for_motion(model, motion, contacts)
            point = ORIGIN if at is None else self.variants.points(at)[i]
            found = inverse.solve(states, wrench, point, names, threads, motion.given)
            if FREQUENCY in outputs:
                modes = model.modes(states[0], None, wrench, point, contacts=contacts)
                _add_frequency(found, modes)
            parts.append((np.arange(k * N, (k + 1) * N), found))
        return _scattered(parts, len(parts) * N)


class Variants:
    """V variants of a model's mechanism, each checked as a file is; see `Model.variants`.

    table:  path -> values, (V, ...), SI.
    status: (V,), of `Status`: ok, refused, or singular where the contacts do not determine the
            dependent coordinates at home.

    Results have the leading shape (V, ...): every variant on every state. NaN, with the variant's
    own status, where a variant is no mechanism.
    """

    def __init__(self, model: Model, table: Mapping[str, ArrayLike], keep: Keep = "home") -> None:
        self.model: Model = model
        self.keep: Keep = keep
        self.base: Mechanism = _with_coordinates(model.mechanism, model.dependent)
        self.table: dict[str, Array] = _columns(self.base, table)
        self.count: int = len(next(iter(self.table.values())))
        self.status: Array = np.zeros(self.count, dtype=np.uint8)
        self._reasons: dict[int, str] = {}
        self._mechanism = lru_cache(CACHED)(self._made)
        limited = any("limit" in path for path in self.table)
        # Limits of muscles, and what walls can bear, follow from other numbers.
        limited |= bool(muscles(model.mechanism.chains) or model.mechanism.enabled_walls)
        weighed = bool(model.distribution.contact_weight)
        self._own_limits = (limited or weighed) and (model.chooses_efforts)
        # Whether what samples are measured by is each variant's own.
        self.measured_apart: bool = limited or any("bounds" in path for path in self.table)
        self.measured_apart |= compliant(model.mechanism)  # patches follow from every surface
        self.groups: list[VariantGroup] = list(self._grouped())

    def __len__(self) -> int:
        return self.count

    def __repr__(self) -> str:
        bad = int(np.count_nonzero(self.status))
        refused = f", {bad} of them refused" if bad else ""
        return f'{self.count} variants of "{self.base.name}"{refused}:\n  {", ".join(self.table)}'

    # -- each by itself ----------------------------------------------------------------------

    def changes(self, i: int) -> dict[str, Any]:
        """What `mechanism.set` is given for a variant."""
        return {path: self._entries(path, a[i].tolist()) for path, a in self.table.items()}

    def _entries(self, path: str, value: Any) -> Any:
        here = self.base.get(path)
        if isinstance(here, Table):
            return dict(zip(here.entries(), value, strict=True))
        return tuple(value) if isinstance(value, list) else value

    def mechanism(self, i: int) -> Mechanism:
        """A variant as a mechanism.

        Raises: MechanismError: as of `mechanism.set`.
        """
        found = self._mechanism(i)
        if isinstance(found, CondyleError):
            raise found
        return found

    def reason(self, i: int) -> str:
        """Why a variant is no mechanism; empty where it is one."""
        found = self._mechanism(i)
        if isinstance(found, CondyleError):
            return "; ".join(getattr(found, "problems", ())) or str(found)
        return ""

    def alone(self, i: int) -> Model:
        """The model of one variant, which shares kernels.

        Raises: as of `mechanism`.
        """
        self.mechanism(i)
        group = next(group for group in self.groups if i in group.rows)
        system = group.model.system.single(int(np.searchsorted(group.rows, i)))
        return self.model._with(system, self.model._requested)

    def _made(self, i: int) -> Mechanism | CondyleError:
        try:
            made = self.base._set(self.changes(i), self.keep)
            self.model._requested.checked(made)
        except CondyleError as error:
            return error
        return made

    def _grouped(self) -> Iterator[VariantGroup]:
        """Variants of one structure together, and what answers for them."""
        system = self.model.system
        structure = self._structure(replace(system.structure, zeros=frozenset()))
        judged = self._judged(structure)
        left, own = np.arange(self.count), dict[Structure, list[tuple[int, Numbers]]]()
        if judged is not None:
            far = np.zeros(self.count, dtype=bool)
            for values in self.table.values():
                far |= ~(np.abs(values.reshape(self.count, -1)) < FAR).all(axis=1)
            far[judged.doubt] = True
            left = np.flatnonzero(far)
            self.status[~far] = judged.status[~far]
            if (rows := np.flatnonzero(~far & (judged.status == Status.ok))).size:
                many = judged.numbers if len(rows) == self.count else judged.numbers.rows(rows)
                yield VariantGroup(self, rows, self._together(structure, rows, many))
        for i in left.tolist():
            made = self._mechanism(i)
            if isinstance(made, CondyleError):
                problems = getattr(made, "problems", [""])
                held = all(item.startswith(("contact: ", "dependent: ")) for item in problems)
                self.status[i] = Status.singular if held else Status.refused
                continue
            structure = structure_of(made, system.formulation, system.route)
            own.setdefault(structure, []).append((i, numbers_of(structure, made)))
        for structure, members in own.items():
            rows = np.array([i for i, _ in members])
            numbers = Numbers.joined([item for _, item in members])
            yield VariantGroup(self, rows, self._together(structure, rows, numbers))

    def _structure(self, structure: Structure) -> Structure:
        """The structure of all variants, whatever of losses, stiffnesses and slopes varies."""
        keys = [parsed(path) for path in self.table]
        if any(k[0] == "chain" and str(k[-1]) in LOSSY for k in keys):
            structure = replace(structure, losses=True)
        if any(k[0] == "chain" and k[-1] == "stiffness" for k in keys):
            structure = replace(structure, gives=True)
        if any(k[0] == "contact" and "slope" in k for k in keys):
            structure = replace(structure, parallel=False)
        return structure

    def _judged(self, structure: Structure) -> VariantNumbers | None:
        """Numbers and statuses in one batch; None where a path has no number of the kernel."""
        own = {p: a for p, a in self.table.items() if parsed(p)[:2] != ("platform", "points")}
        backend = "numpy" if self.count < MANY else self.model.backend.requested
        try:
            if not own:
                return None
            result = variant_numbers(self.base, structure, own, self.keep, backend)
        except InputError:
            return None
        good = np.flatnonzero(result.status == Status.ok)
        for ball in balls(structure, result.numbers.parameters[good], self.base.contacts):
            tight = ball.overlaps(np.zeros((len(good), 6)), np.arange(len(good)))
            result.status[good[tight]] = Status.refused
        return result

    def _together(self, structure: Structure, rows: np.ndarray, numbers: Numbers) -> Model:
        system = self.model.system

        def points(name: str) -> np.ndarray:
            return self.points(name)[rows]

        def mechanism(i: int) -> Mechanism:
            return self.mechanism(int(rows[i]))

        @lru_cache(CACHED)
        def distributor(i: int) -> Distributor:
            return Distributor(mechanism(i), model.distribution, system.backend)

        model = self.model._with(
            system.with_variants(structure, numbers, VariantSource(mechanism, points)),
            self.model._requested,
            distributor if self._own_limits else None,
        )
        return model

    def points(self, name: str) -> Array:
        """A point of the platform in every variant, (V, 3) [m] in {M}: by its name, or as of
        `condyle.motion.load_place`."""
        if (known := self.base.platform.points).keys().isdisjoint([name]):
            each = [
                self.points(one) if one in known else load_place(one, known)
                for one in map(str.strip, name.split(";"))
            ]
            return np.tile(np.zeros(3), (self.count, 1)) + sum(each) / len(each)
        positions = np.tile(np.array(self.base.platform.points[name], dtype=float), (self.count, 1))
        for path, values in self.table.items():
            keys = parsed(path)
            if keys[:3] == ("platform", "points", name):
                positions[:, keys[3] if keys[3:] else slice(None)] = values  # type: ignore[index]
        return positions

    def check_given(self, given: Collection[str]) -> None:
        """Raises InputError where gravity is given beside that of the variants."""
        if "gravity" in given and (own := [p for p in self.table if parsed(p)[0] == "gravity"]):
            raise InputError(
                f"{own[0]}: varies, and gravity is given sample by sample (gx, gy, gz of a motion, "
                "or gravity=...), so that it has no effect: leave out one of them"
            )

    # -- all together ------------------------------------------------------------------------

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Any = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        outputs: Any = (),
        threads: int | None = None,
    ) -> ModelResult:
        """Efforts of every variant on every state; as of `Model.inverse_dynamics`."""
        own = self.model._arguments
        state = self._state((own.q, own.v, own.a), (q, v, a))
        return self._dynamics(
            "_inverse", state, wrench, at, outputs, threads, given_of(gravity, base)
        )

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        effort: ArrayLike,
        wrench: ArrayLike | None = None,
        at: Any = None,
        *,
        gravity: ArrayLike | None = None,
        base: ArrayLike | None = None,
        outputs: Any = (),
        threads: int | None = None,
    ) -> ModelResult:
        """Accelerations of every variant in every state; as of `Model.forward_dynamics`."""
        own = self.model._arguments
        state = self._state((own.q, own.v, own.effort), (q, v, effort))
        return self._dynamics(
            "_forward", state, wrench, at, outputs, threads, given_of(gravity, base)
        )

    def solve(
        self,
        motion: Motion,
        load: Load | None = None,
        *,
        keep: Sequence[str] = ("effort",),
        load_point: str | None = None,
        threads: int | None = None,
    ) -> xr.Dataset:
        """Inverse dynamics of every variant along a motion: an `xarray.Dataset` with `variant`.

        Args:   motion, load, load_point: as of `Model.solve`;  keep: variables of a solution.
        Raises: InputError: for an unknown variable, or what does not fit the mechanism.
        """
        from ..results.variant_solutions import solve

        return solve(self, motion, load, keep, load_point, threads)

    def simulate(
        self, scenario: ScenarioLike | None = None, *, threads: int | None = None
    ) -> list[Any]:
        """A simulation of every variant, those alike in lockstep: a list of datasets, None where a
        variant is no mechanism. As of `condyle.simulate`."""
        from ..simulation.simulating import of_variants

        return of_variants(self, scenario, threads)

    def _state(self, arguments: Sequence[Argument], given: Sequence[Any]) -> list[Array]:
        return [x.array(a) for x, a in zip(arguments, given, strict=True)]

    def _dynamics(
        self,
        kind: str,
        state: Sequence[Array],
        wrench: Any,
        at: Any,
        outputs: Any,
        threads: Any,
        given: Mapping[str, Any],
    ) -> ModelResult:
        w = None if wrench is None else WRENCH.array(wrench)
        given = {name: GIVEN[name].array(a) for name, a in given.items()}
        self.check_given(given)
        shapes = [a.shape[:-1] for a in (*state, *(() if w is None else (w,)), *given.values())]
        point = None if at is None or isinstance(at, str) else POINT.array(at)
        shapes += [] if point is None else [point.shape[:-1]]
        try:
            lead = np.broadcast_shapes(*shapes)
        except ValueError:
            raise InputError(
                f"the leading shapes do not go together: {', '.join(map(str, shapes))}"
            ) from None
        parts = []
        for group in self.groups:
            rows, model, count = group.rows, group.model, len(group.rows)
            each = [np.broadcast_to(a, (count, *lead, a.shape[-1])) for a in state]
            if isinstance(at, str):
                model._arguments.point(at)  # has to be there
                own = self.points(at)[rows].reshape(count, *(1 for _ in lead), 3)
            else:
                own = ORIGIN if point is None else point
            found = getattr(model, kind).solve(each, w, own, outputs, threads, given)
            parts.append((rows, found))
        return self._merged(parts, lead)

    def _merged(self, parts: Sequence[tuple[np.ndarray, Any]], lead: tuple[int, ...]) -> Any:
        """Results of all variants from those of some, each."""
        if len(parts) == 1 and len(parts[0][0]) == self.count:
            return parts[0][1]
        if not parts:
            status = np.broadcast_to(
                self.status.reshape(-1, *(1 for _ in lead)), (self.count, *lead)
            )
            return ModelResult(status=status.copy())
        found = _scattered([(rows, result) for rows, result in parts], self.count)
        bad = np.flatnonzero(self.status)
        found.status[bad] = self.status[bad].reshape(-1, *(1 for _ in lead))
        return found


def _add_frequency(found: ModelResult, modes: ModelResult) -> None:
    found.frequency = modes.frequency
    found.status = np.where(found.status == Status.ok, modes.status, found.status)


@lru_cache(8)
def _with_coordinates(mechanism: Mechanism, dependent: tuple[str, ...]) -> Mechanism:
    """The mechanism as if its dependent coordinates stood in its file."""
    if not mechanism.contacts or mechanism.dependent is not None:
        return mechanism
    return mechanism._set({"dependent": dependent}, "all")


def _scattered(parts: list[tuple[np.ndarray, Any]], count: int) -> Any:
    """Results of some variants each, where they stand among all; NaN elsewhere."""
    first = parts[0][1]
    if isinstance(first, ModelResult):
        return type(first)(
            **{
                name: _scattered([(rows, getattr(value, name)) for rows, value in parts], count)
                for name in vars(first)
            }
        )
    if isinstance(first, Singularity):
        own = {
            f.name: _scattered([(rows, getattr(value, f.name)) for rows, value in parts], count)
            for f in fields(first)
        }
        return replace(first, **own)
    shape = np.max([value.shape[1:] for _, value in parts], axis=0).tolist()
    out = np.full((count, *shape), FILLS.get(first.dtype.kind, 0), dtype=first.dtype)
    for rows, value in parts:
        part: Any = (rows, *(slice(n) for n in value.shape[1:]))
        out[part] = value
    return out


def _columns(mechanism: Mechanism, table: Mapping[str, ArrayLike]) -> dict[str, Array]:
    """Path -> values, (V, ...), one of a chain where a path had all of them.

    Raises: InputError: for anything but paths with numbers, as many each.
    """
    try:
        given = {
            str(path): as_doubles(values, f"variants: {path}") for path, values in table.items()
        }
    except AttributeError:
        raise InputError(
            "variants: expected a table of paths with numbers, (V, ...) each, such as "
            f'{{"platform.mass": [0.2, 0.3]}}; got {brief(table)}'
        ) from None
    columns: dict[str, Array] = {}
    for path, values in given.items():
        keys = parsed(path)
        names = {"chain": mechanism.chain_names, "contact": mechanism.contact_names}
        if keys[1:2] == ("*",) and keys[0] in names:
            all_of = names[str(keys[0])]
            if values.ndim < 2 or values.shape[1] != len(all_of):
                raise InputError(
                    f"{path}: expected numbers of every {keys[0]}, (V, {len(all_of)}, ...); got "
                    f"shape {values.shape}"
                )
            for i, name in enumerate(all_of):
                columns[written((keys[0], name, *keys[2:]))] = values[:, i]
            continue
        here = mechanism.get(path)
        size = len(here.entries()) if isinstance(here, Table) else np.shape(here)
        wanted = (size,) if isinstance(size, int) else size
        if values.ndim < 1 or (here is not None and values.shape[1:] != wanted):
            shape = ", ".join(["V", *map(str, wanted)])
            raise InputError(f"{path}: expected numbers of shape ({shape}); got {values.shape}")
        columns[path] = values
    counts = {len(values) for values in columns.values()}
    if len(counts) != 1 or 0 in counts:
        raise InputError(
            "variants: expected as many values of every path, at least one; got "
            f"{', '.join(f'{path} {len(values)}' for path, values in columns.items()) or 'no path'}"
        )
    return columns
