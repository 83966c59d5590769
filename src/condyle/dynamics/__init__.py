"""Sections 4 and 5: one formulation a file, and the two routes that use them."""

from typing import Literal, get_args

from ..errors import InputError, did_you_mean
from .formulation import Formulation
from .hessian import Hessian
from .lagrange import Lagrange
from .momentum import Momentum
from .newton_euler import NewtonEuler
from .virtual_power import VirtualPower

FORMULATIONS: dict[str, Formulation] = {
    f.name: f for f in (VirtualPower(), Momentum(), Lagrange(), Hessian(), NewtonEuler())
}
# For editors and type checkers; a formulation from elsewhere is registered in FORMULATIONS alone.
FormulationName = Literal["virtual_power", "momentum", "lagrange", "hessian", "newton_euler"]
Route = Literal["core", "direct"]
ROUTES = get_args(Route)


def formulation(name: str) -> Formulation:
    """The formulation of that name.

    Raises: InputError: if there is none.
    """
    if name not in FORMULATIONS:
        raise InputError(f'no formulation "{name}".{did_you_mean(name, FORMULATIONS)}')
    return FORMULATIONS[name]


__all__ = ["FORMULATIONS", "ROUTES", "Formulation", "FormulationName", "Route", "formulation"]
