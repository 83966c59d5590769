"""What decides whether a file's numbers are those of a mechanism, as checks of a question.

Ranges of single numbers are those of the tables' fields. What is too near a limit for rounding, or
was not found by Newton, is left in doubt: for `mechanism.set` to decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import casadi as ca

from ..kinematics.chain import FAMILIES, Constants
from ..kinematics.chain.family import LEFT_OUT
from ..mechanism.chain import CHAINS
from ..mechanism.coordinates import COORDINATES
from ..mechanism.home import HOME_ERROR, MAX_CONDITION
from ..mechanism.quantities import LARGEST, SHORTEST, Unit
from ..mechanism.surface import of_form
from ..mechanism.surface.base import named
from ..mechanism.surface.parallel import CONVERGED
from ..mechanism.surface.wall import Wall, WallConstants
from ..status import Status
from .builder import Builder
from .numbers import INERTIA, lane_numbers, shared_numbers

NEAR = 1e-12  # relative distance from a limit within which rounding decides
TURNED = 0.8  # cosine of a turn of the normal beyond which another touching point may be nearer
TRIANGLE = 1e-9  # slack of `Inertia`'s triangle inequality, relative


def judge(
    b: Builder,
    walls: Sequence[Wall],
    constants: Sequence[WallConstants],
    values: Mapping[str, ca.SX],
) -> None:
    """Add the checks. Args: placed: what the contacts lead to;  values: shared numbers."""
    groups = range(len(b.structure.chains))
    sound = [*_shared_ranges(b, walls), *_of_contacts(b, walls, constants)]
    lanes = [_product(_of_chain(b, group)) for group in groups]
    _check(b, _product(sound) * b.least(lanes) - 0.5, 0.0, Status.refused)
    margins = [*_inertia(b.parameter("inertia")), *_homes(constants, b, values)]
    families = zip(*(_margins(b, group) for group in groups), strict=True)
    for margin in (*margins, *(b.least(list(terms)) for terms in families)):
        _check(b, margin, NEAR, Status.refused)
    for one in constants:
        if one.rest is not None and one.turned is not None:
            _check(b, CONVERGED**2 - one.rest, 0.0, None)
            _check(b, one.turned - TURNED, 0.0, None)
    if constants:
        holds, fails = _condition(b, values)
        _check(b, -fails, 0.0, Status.singular)
        _check(b, holds, 0.0, None)


def _check(b: Builder, value: ca.SX, tolerance: float, below: Status | None) -> None:
    b.check(value, tolerance, None if below is None else int(below))


def _product(truths: Iterable[ca.SX]) -> ca.SX:
    """1 where all are true, else 0."""
    found = ca.SX(1)
    for truth in truths:
        found = found * truth
    return found


# -- one number by itself ------------------------------------------------------------------


def within(x: ca.SX, unit: Unit) -> Iterator[ca.SX]:
    """Whether numbers, (n,), are in the range of their field: truth values."""
    entries = ca.vertsplit(x)
    for e in entries:
        size = ca.fabs(e)
        yield size <= min(unit.most, 1e300)  # NaN and infinity are refused
        if unit.gt is not None:  # 0
            yield e >= max(unit.least, 5e-324)
        elif unit.least:
            yield 1 - ca.logic_not(e == 0) * (size < unit.least)
        if unit.ge is not None:
            yield e >= unit.ge
        if unit.le is not None:
            yield e <= unit.le
    if unit.direction:
        largest = ca.fabs(entries[0])
        for e in entries[1:]:
            largest = ca.fmax(largest, ca.fabs(e))
        yield largest >= 1 / LARGEST


def _shared_ranges(b: Builder, walls: Sequence[Wall]) -> Iterator[ca.SX]:
    before: dict[str, int] = {}
    for number in shared_numbers(b.structure, tuple(walls)):
        start = before.get(number.name, 0)
        before[number.name] = end = start + number.field.size
        if number.path:
            yield from within(b.parameter(number.name)[start:end], number.field.unit)
    for i, rows in enumerate(b.structure.ligaments):
        if rows:
            stiffness = b.parameter(f"ligament_stiffness_{i}")
            yield from _rising(stiffness[0::2], stiffness[1::2])


def _rising(strains: ca.SX, forces: ca.SX) -> Iterator[ca.SX]:
    """Whether rows of a ligament are."""
    yield from (x == 0 for x in (strains[0], forces[0]))
    for k in range(1, strains.numel()):
        yield strains[k] - strains[k - 1] >= SHORTEST
        yield forces[k] >= forces[k - 1]


def _of_chain(b: Builder, group: int) -> Iterator[ca.SX]:
    """What every number of a chain, and each body's together, have to be."""
    kind = b.structure.families[group]
    own = {path: b.lane(group, path) for path in b.layout.lanes[group]}
    for path, field in lane_numbers(b.structure, group).items():
        x = own[path]
        if path.endswith(".stiffness"):
            yield 1 - (1 - _product(within(x, field.unit))) * (x != LEFT_OUT)
        else:
            yield from within(x, field.unit)
        if path.endswith(".axial"):
            transverse = own[path.replace("axial", "transverse")]
            yield x <= 2 * transverse * (1 + 1e-12)
    if "crank.com" in own:
        yield own["crank.mass"] * own["crank.com"] ** 2 <= own["crank.inertia"] * (1 + 1e-12)
    for start, end in CHAINS[kind].links.values():
        line = own[end] - own[start]
        yield ca.dot(line, line) > 0


# -- numbers together ----------------------------------------------------------------------


def _inertia(entries: ca.SX) -> Iterator[ca.SX]:
    """Positive where a tensor is positive definite and no moment exceeds the others' sum."""
    J = ca.SX.zeros(3, 3)
    for n, (i, j) in enumerate(INERTIA):
        J[i, j] = J[j, i] = entries[n]
    trace = ca.trace(J)
    yield from _minors(J / trace)
    # The largest moment is at most half of all; only one can be more.
    half = (1 + TRIANGLE) / (2 + TRIANGLE)
    yield ca.det(half * ca.SX.eye(3) - J / trace)


def _minors(A: ca.SX) -> Iterator[ca.SX]:
    yield A[0, 0]
    yield A[0, 0] * A[1, 1] - A[0, 1] ** 2
    yield ca.det(A)


def _margins(b: Builder, group: int) -> list[ca.SX]:
    """Positive where a chain's axis is near enough the perpendicular, and home has a branch."""
    family = FAMILIES[b.structure.families[group]]
    own = {path.replace(".", "_"): b.lane(group, path) for path in family.numbers}
    return list(family.margins(Constants(**own)))


def _of_contacts(
    b: Builder, walls: Sequence[Wall], constants: Sequence[WallConstants]
) -> Iterator[ca.SX]:
    """What the numbers of surfaces have to be, also where home is kept."""
    for i, (wall, constant) in enumerate(zip(walls, constants, strict=True)):
        surface = wall.surface
        given = named(b.parameter(f"contact_surface_{i}"), dict(wall.sizes))
        for f in (given, constant.numbers) if wall.home_kept else (given,):
            yield from surface.sound(f)
            for name, x in vars(f).items() if f is constant.numbers else ():
                yield from within(x, surface.numbers[name].unit)
            if wall.push < 0 and (room := surface.room(f)) is not None:
                yield b.parameter(f"contact_ball_{i}") < room


def _homes(
    constants: Sequence[WallConstants], b: Builder, values: Mapping[str, ca.SX]
) -> Iterator[ca.SX]:
    """Positive where the points are on their surfaces at home, and balls fit."""
    for i, constant in enumerate(constants):
        phi, gradient = _at_home(b, i, values)
        yield (HOME_ERROR - ca.fabs(phi) / ca.norm_2(gradient)) / HOME_ERROR
        if constant.fits is not None:
            yield constant.fits


def _at_home(b: Builder, i: int, values: Mapping[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
    """phi and its gradient."""
    form, _ = b.structure.contacts[i]
    surface = of_form(form)
    point, constants = values[f"contact_point_{i}"], values[f"contact_surface_{i}"]
    return surface.phi(point, constants), surface.gradient(point, constants)


def _condition(b: Builder, values: Mapping[str, ca.SX]) -> tuple[ca.SX, ca.SX]:
    """Positive where the dependent columns' condition number is below its limit for sure; and where
    it is not.

    It is between |A| |adj A| / |det A| of Frobenius norms over k, and that.
    """
    rows = []
    for i in range(len(b.structure.contacts)):
        _, gradient = _at_home(b, i, values)
        turning = ca.cross(values[f"contact_point_{i}"], gradient) / values["length"]
        rows.append(ca.vertcat(gradient, turning).T)
    columns = [COORDINATES.index(name) for name in b.structure.dependent]
    A = ca.vertcat(*rows)[:, columns]
    k = len(rows)
    size = ca.norm_fro(A) * ca.norm_fro(ca.adj(A))
    limit = MAX_CONDITION * ca.fabs(ca.det(A))
    return limit * (1 - NEAR) - size, size / k - limit * (1 + NEAR)
