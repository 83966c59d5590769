"""What the shell offers when Tab is pressed. Light: nothing here imports the mathematics.

The names of registries stand here once more, because the registries take half a second to load;
a test holds them against each other.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import typer

from ..analysis.studies import OTHERS, studies

FORMULATIONS = ("virtual_power", "momentum", "lagrange", "hessian", "newton_euler")
ROUTES = ("core", "direct")
DISTRIBUTIONS = {  # name -> objective, and constraints
    "minimum_norm": "sum of squared efforts; no limits",
    "bounded": "the same within limits, unilateral contacts in compression",
    "weighted": "sum of squares of effort over its limit, within limits",
    "cubic": "sum of cubes of effort over its limit, for muscles, which only pull",
    "minimax": "largest effort over its limit, then weighted",
    "emg": "muscles as active as their EMG says; what does not balance is the residual",
    "emg_assisted": "least deviation from that which balances, within limits",
}
BACKENDS = ("auto", "compiled", "numpy", "cuda")
FMUS = ("plant", "inverse", "controller", "bounded", "pose", "joints")
STYLES = ("screen", "journal", "journal-wide")
EXPORTS = (
    *("inverse", "contact", "bounded", "forward", "derivatives"),
    *("motion", "closure", "pose", "observer", "kalman", "state", "joints"),
    *("computed_torque", "impedance", "joint_pd", "bite_force", "hybrid"),
)
UNITS = ("m,rad", "m,deg", "mm,rad", "mm,deg", "cm,rad", "cm,deg")
QUANTITIES = (
    *("reachable", "pose", "bounds", "joint", "ratio", "condition"),
    *("transmission", "effort", "contact_force", "load_limit", "speed", "stiffness"),
)
FIGURES = (
    *(
        "accuracy",
        "activation",
        "contact_force",
        "contact_track",
        "effort",
        "effort_speed",
        "forces",
        "jacobian",
    ),
    *("joint", "load", "marker", "motion", "path", "reaction", "share", "singularity"),
)


def one_of(*names: str) -> Callable[[str], list[str]]:
    """Completes to one of some names."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names if name.startswith(incomplete)]

    return complete


def mechanisms(incomplete: str) -> list[str]:
    """Bundled mechanisms, and files that end in .toml and folders where the word leads."""
    place = incomplete[: incomplete.rfind("/") + 1]
    try:
        beside = sorted(Path(place).iterdir())
    except OSError:
        beside = []
    paths = [f"{place}{path.name}{'/' * path.is_dir()}" for path in beside if _fits(path)]
    return [name for name in (*bundled(), *paths) if name.startswith(incomplete)]


def study_names(incomplete: str) -> list[str]:
    """Kinds of study files, those of other packages too."""
    return one_of(*studies())(incomplete)


def schema_names(incomplete: str) -> list[str]:
    """Kinds of files that have a schema."""
    return one_of(*OTHERS, *studies())(incomplete)


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


# Parameter of a single command -> what is offered for it.
OFFERED: dict[str, Callable[..., list[str]]] = {
    "figure": one_of(*FIGURES),
    "style": one_of(*STYLES),
    "question": one_of(*EXPORTS),
    "quantity": one_of(*QUANTITIES),
    "kind": one_of(*FMUS),
    "precision": one_of("double", "float"),
    "constants": one_of("inside", "struct"),
}
_BUNDLED = files("condyle") / "mechanism" / "bundled"


def _fits(path: Path) -> bool:
    return not path.name.startswith(".") and (path.suffix == ".toml" or path.is_dir())


def _text(mechanism: str) -> str:
    if mechanism in bundled():
        return (_BUNDLED / f"{mechanism}.toml").read_text(encoding="utf-8")
    return Path(mechanism).read_text(encoding="utf-8-sig")
