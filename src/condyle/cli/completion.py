"""What the shell offers when Tab is pressed. Light: nothing here imports the mathematics.

The names of registries stand here once more, because the registries take half a second to load;
a test holds them against each other.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import typer

from ..analysis.studies import OTHERS as FILES
from ..analysis.studies import studies

DISTRIBUTIONS = {  # name -> objective, and constraints
    "minimum_norm": "sum of squared efforts; no limits",
    "bounded": "the same within limits, unilateral contacts in compression",
    "weighted": "sum of squares of effort over its limit, within limits",
    "cubic": "sum of cubes of effort over its limit, for muscles, which only pull",
    "minimax": "largest effort over its limit, then weighted",
    "emg": "muscles as active as their EMG says; the residual wrench is the unbalanced part",
    "emg_assisted": "least deviation from that which balances, within limits",
}
# Option -> names of its registry.
NAMES = {
    "formulation": "virtual_power momentum lagrange hessian newton_euler",
    "route": "core direct",
    "backend": "auto compiled numpy cuda",
    "kind": "plant inverse controller bounded pose joints",
    "contacts": "kept compliant",
    "style": "screen journal journal-wide",
    "question": "inverse contact bounded forward derivatives motion closure pose observer kalman "
    "state joints computed_torque impedance joint_pd bite_force hybrid",
    "units": "m,rad m,deg mm,rad mm,deg cm,rad cm,deg",
    "quantity": "reachable pose bounds joint ratio condition transmission effort contact_force "
    "load_limit lift_load speed stiffness deflection frequency",
    "figure": "accuracy activation contact_force contact_track effort effort_speed forces jacobian "
    "joint load marker modes motion movement path pressure reaction share singularity",
    "precision": "double float",
    "size": "fast small",
    "constants": "inside struct",
    "outputs": "bound",
    "scheduler": "processes threads",
    "inputs": "gravity base gravity,base",
    "smooth": "auto",
}


def offered(option: str) -> Callable[..., list[str]] | None:
    """The function that completes an option's value, by the option's name; None without one."""
    if listed(option):
        return lambda incomplete: [n for n in listed(option) if n.startswith(incomplete)]
    return OTHERS.get(option)


def listed(option: str) -> list[str]:
    """The names of an option's registry."""
    if option == "distribution":
        return list(distributions())
    if option in ("study", "of"):
        return [*(FILES if option == "of" else ()), *studies()]
    return bundled() if option == "from_" else NAMES.get(option, "").split()


def distributions() -> dict[str, str]:
    """Name -> objective, those of a program's own too: it has loaded the mathematics."""
    own = getattr(sys.modules.get("condyle.distribution"), "OBJECTIVES", {})
    return {**{name: objective.summary for name, objective in own.items()}, **DISTRIBUTIONS}


def choices_text(option: str) -> str:
    """The values of an option as its help lists them."""
    if option == "distribution":
        return "; ".join(f"{name}: {what}" for name, what in distributions().items())
    return ", ".join(bundled() if option == "mechanism" else listed(option))


def mechanisms(incomplete: str) -> list[str]:
    """Bundled mechanisms, and files that end in .toml and folders where the word leads."""
    place = incomplete[: incomplete.rfind("/") + 1]
    try:
        beside = sorted(Path(place).iterdir())
    except OSError:
        beside = []
    paths = [f"{place}{path.name}{'/' * path.is_dir()}" for path in beside if _fits(path)]
    return [name for name in (*bundled(), *paths) if name.startswith(incomplete)]


def points(context: typer.Context, incomplete: str) -> list[str]:
    """Points of the platform, from the mechanism named before on the line."""
    # Words stay in `args` while the option that is being completed has no value.
    words = [*context.args, context.params.get("mechanism") or "masticatory"]
    try:
        tables = tomllib.loads(_text(next(w for w in words if w in bundled() or ".toml" in w)))
        names = list(tables["platform"]["points"])
    except (OSError, ValueError, KeyError, TypeError, StopIteration):
        return []
    return [name for name in names if name.startswith(incomplete)]


def bundled() -> list[str]:
    """Names of the bundled mechanisms."""
    return sorted(path.name[:-5] for path in _BUNDLED.iterdir() if path.name.endswith(".toml"))


OTHERS: dict[str, Callable[..., list[str]]] = {
    "mechanism": mechanisms,
    **dict.fromkeys(("load_point", "landmark", "point"), points),
}
_BUNDLED = files("condyle") / "mechanism" / "bundled"


def _fits(path: Path) -> bool:
    return not path.name.startswith(".") and (path.suffix == ".toml" or path.is_dir())


def _text(mechanism: str) -> str:
    if mechanism in bundled():
        return (_BUNDLED / f"{mechanism}.toml").read_text(encoding="utf-8")
    return Path(mechanism).read_text(encoding="utf-8-sig")
