"""Contact surfaces: the data of each kind and its equation phi(p) = 0 in {S}."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import casadi as ca
from pydantic import ValidationInfo, ValidatorFunctionWrapHandler, WrapValidator

from ..kinds import Kinds
from .base import SurfaceTable, sides
from .coordinate import CoordinatePlane
from .expression import Expression, UnknownSurface
from .parallel import Parallel, ParallelQuadric, parallel
from .plane import Plane
from .profile import Profile
from .quadratic import Quadratic
from .quadric import Cylinder, Ellipsoid, Sphere


def _written_in_python(
    value: Any, from_file: ValidatorFunctionWrapHandler, info: ValidationInfo
) -> Any:
    if isinstance(value, Expression | UnknownSurface):
        return value
    notes = (info.context or {}).get("notes", False)
    if notes and isinstance(value, Mapping) and value.get("kind") == UnknownSurface.kind:
        return UnknownSurface(bool(value.get("closed")))
    return from_file(value)


# A new one is a file that registers its table here.
SURFACES = Kinds(
    "condyle.surfaces", Plane, Quadratic, Sphere, Cylinder, Ellipsoid, Profile, CoordinatePlane
)
Surface = Annotated[Any, SURFACES, WrapValidator(_written_in_python)]


def of_form(form: str) -> Any:
    """A surface that lends its phi(point, constants) to all surfaces of a form; it has no numbers.

    A form is a kind, "parallel ..." for the place of a ball's centre, or "expression ...".
    """
    if form == "parallel-quadric":
        return ParallelQuadric(None, 0.0)
    first, _, rest = form.partition(" ")
    if first == "parallel":
        return Parallel(of_form(rest), 0.0)
    if first == "expression":
        return Expression(ca.Function.deserialize(rest))
    return SURFACES[first].of_form(form)


def is_flat(form: str) -> bool:
    """Whether surfaces of a form are planes whose constants are slope and offset."""
    return form in SURFACES and SURFACES[form].flat


def table_of(form: str) -> type[SurfaceTable] | None:
    """The table whose equations a form has: that of its kind, or of its wall's."""
    return SURFACES.get(form.removeprefix("parallel ").partition(" ")[0])


__all__ = [
    "SURFACES",
    "CoordinatePlane",
    "Cylinder",
    "Ellipsoid",
    "Expression",
    "Parallel",
    "ParallelQuadric",
    "Plane",
    "Profile",
    "Quadratic",
    "Sphere",
    "Surface",
    "SurfaceTable",
    "UnknownSurface",
    "is_flat",
    "of_form",
    "parallel",
    "sides",
    "table_of",
]
