"""Integrators by name. `rk4` has fixed steps; the others choose their own."""

from typing import Any

from .base import Settings, Step, Stuck


class Choice:
    """An integrator, imported when it is used.

    fixed: whether it needs a step.
    """

    def __init__(self, module: str, name: str, fixed: bool) -> None:
        self._module, self._name, self.fixed = module, name, fixed

    def __call__(self, *arguments: Any) -> Any:
        from importlib import import_module

        return getattr(import_module(self._module, __package__), self._name)(*arguments)


INTEGRATORS = {
    "DOP853": Choice(".adaptive", "DOP853", False),
    "Radau": Choice(".adaptive", "Radau", False),
    "rk4": Choice(".rk4", "RK4", True),
}

__all__ = ["INTEGRATORS", "Settings", "Step", "Stuck"]
