"""Contact surfaces: the data of each kind and its equation phi(p) = 0 in {S}."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, get_args

import casadi as ca
from pydantic import Field, ValidationInfo, ValidatorFunctionWrapHandler, WrapValidator

from .base import SurfaceTable, sides
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


_Kinds = Plane | Quadratic | Sphere | Cylinder | Ellipsoid | Profile
Surface = Annotated[
    Annotated[_Kinds, Field(discriminator="kind")], WrapValidator(_written_in_python)
]


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
    return {kind.model_fields["kind"].default: kind for kind in get_args(_Kinds)}[
        first
    ].model_construct()


__all__ = [
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
    "of_form",
    "parallel",
    "sides",
]
