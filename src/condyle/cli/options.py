"""Options that several commands share, with help, range and what the shell offers for them.

A command takes a group as one parameter; `command` makes an option of each of its fields.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer

from . import completion
from .completion import one_of


def option(help: str = "", *names: str, **how: Any) -> Any:
    """An option: its help (or that of the command's docstring), names, and what typer takes."""
    return typer.Option(*names, help=help, **how)


Mechanism = Annotated[
    str,
    typer.Argument(
        help="Mechanism file (TOML), or the name of a bundled mechanism: "
        + ", ".join(completion.bundled())
        + ".",
        autocompletion=completion.mechanisms,
    ),
]
LoadPoint = Annotated[
    str | None,
    option(
        "Platform point at which the load acts. Default: the load's own point, else right_molar, "
        "else the only point.",
        autocompletion=completion.points,
    ),
]
Landmark = Annotated[str | None, option(autocompletion=completion.points)]
Formulation = Annotated[
    str,
    option(
        "How the equations of motion are derived: "
        + ", ".join(completion.FORMULATIONS)
        + ". All give the same efforts.",
        autocompletion=one_of(*completion.FORMULATIONS),
    ),
]
Route = Annotated[
    str,
    option(
        "How the contacts enter the equations: core (last; any contacts) or direct (first; flat "
        "contacts only). Both give the same efforts.",
        autocompletion=one_of(*completion.ROUTES),
    ),
]
Distribution = Annotated[
    str | None,
    option(
        "How redundancy is resolved: the objective that is minimised. "
        + "; ".join(f"{name}: {what}" for name, what in completion.DISTRIBUTIONS.items())
        + ". Default: cubic with muscles, bounded with cables, else minimum_norm. "
        "Where N m and N mix: weighted or minimax.",
        autocompletion=one_of(*completion.DISTRIBUTIONS),
    ),
]
Preload = Annotated[
    float,
    option(
        "Minimum compressive force on unilateral contacts, and force of either sign on others with "
        "friction (N), for objectives with limits."
    ),
]
Backend = Annotated[
    str,
    option(
        "How kernels run: compiled, numpy (the same numbers, slower), cuda (on NVIDIA's graphics "
        "processors), or auto: compiled where there is a C compiler.",
        autocompletion=one_of(*completion.BACKENDS),
    ),
]
Threads = Annotated[
    int | None,
    option("Maximum number of threads. Default: all processors. The same results.", min=1),
]
Measured = Annotated[
    Path | None,
    option(
        "Markers and EMG measured during the motion (.csv or .parquet), shown with the results; "
        "condyle motion from-c3d --measured writes them."
    ),
]
Flag = Annotated[
    bool, option("Keep samples that cannot be computed, empty, with a status, instead of failing.")
]
MaxError = Annotated[
    float | None,
    option(
        "Maximum relative error, such as 1e-8: a sample whose bound exceeds it is an error; the "
        "bounds are written too, as column bound.",
        min=0.0,
    ),
]
Reactions = Annotated[bool, option("Also compute forces and moments in every joint.")]
Mat = Annotated[bool, option("Also write the results for MATLAB (.mat).")]
Figures = Annotated[bool, option("Also draw figures.")]
Report = Annotated[bool, option("Also write the page of condyle report.")]
# Every command has these.
Quiet = Annotated[bool, option("Print only what was asked for, and errors.", "--quiet", "-q")]
Json = Annotated[bool, option("Print one JSON object, and nothing else.", "--json")]
Strict = Annotated[bool, option("Treat warnings as errors.", "--strict")]


class Group:
    """Options that go together; a dataclass."""

    def arguments(self) -> dict[str, Any]:
        """All of them, as the library's functions take them."""
        return {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]

    def given(self) -> dict[str, Any]:
        """Those that differ from their defaults, to be said again."""
        usual = type(self)().arguments()
        return {name: one for name, one in self.arguments().items() if one != usual[name]}


@dataclass(frozen=True)
class MotionOptions(Group):
    """The motion and the load on the platform."""

    motion: Annotated[
        Path | None,
        option(
            "Motion (CSV or Parquet): t (s) and pose coordinates such as X, Y (m), alpha, beta "
            "(rad), or the path x, y, z (m) of a landmark; if any, gravity gx, gy, gz (m/s^2) and "
            "the base's motion base_ax ... base_dwz. Default: the bundled chewing path where "
            "it fits the mechanism, else a trial motion about home (both synthetic)."
        ),
    ] = None
    load: Annotated[
        Path | None,
        option(
            "Load on the platform (CSV or Parquet): t (s), and any of Fx, Fy, Fz (N), Mx, My, Mz "
            "(N m). Default: with the bundled motion the bundled bite force (synthetic), else none."
        ),
    ] = None
    load_point: LoadPoint = None
    units: Annotated[
        str | None,
        option(
            "Units of time (s, ms, us, min), length (m, cm, mm, um) and angle (rad, deg, mrad) in "
            "the motion file, such as ms,mm,deg. A header such as x (mm) also states its unit.",
            autocompletion=one_of(*completion.UNITS),
        ),
    ] = None
    landmark: Annotated[
        str | None,
        option(
            "Platform point whose path x, y, z the motion file has. Default: incisor if there is "
            "one, else the only point.",
            autocompletion=completion.points,
        ),
    ] = None
    smooth: Annotated[
        str | None,
        option(
            "Low-pass cut-off frequency for a measured motion (Hz); auto: 10 Hz.",
            autocompletion=one_of("auto"),
        ),
    ] = None
    rate: Annotated[
        float | None, option("Sampling rate of the results (Hz). Default: that of the motion.")
    ] = None
    trim: Annotated[
        float,
        option(
            "Time to cut off at both ends of the motion (s), where smoothing is least accurate: "
            "0.2 with --smooth auto.",
            min=0.0,
        ),
    ] = 0.0
    fit: Annotated[
        bool,
        option(
            "Move measured whole poses (t, X, Y, Z, alpha, beta, gamma) onto the contacts, each to "
            "the pose nearest at the contact points and landmarks. Default: keep the independent "
            "coordinates and recompute the others."
        ),
    ] = False


@dataclass(frozen=True)
class ModelOptions(Group):
    """How the equations are derived and run."""

    formulation: Formulation = "virtual_power"
    route: Route = "core"
    backend: Backend = "auto"
    threads: Threads = None


@dataclass(frozen=True)
class DistributionOptions(Group):
    """How redundancy is resolved."""

    distribution: Distribution = None
    preload: Preload = 0.0
    contact_weight: Annotated[
        float,
        option(
            "Weight W of contact forces, for weighted: adds W (force/N_ref)^2 of every contact to "
            "the objective, from least effort (0) to least contact force. N_ref is the largest "
            "effort limit of the chains [N], of torques over the characteristic length."
        ),
    ] = 0.0
    emg_weight: Annotated[
        float,
        option(
            "For emg_assisted: weight of a muscle's squared deviation from its EMG, against the "
            "squared activation of muscles without EMG."
        ),
    ] = 1.0

    def chosen(self) -> Any:
        """The `condyle.Distribution` of these."""
        import condyle

        name: Any = self.distribution
        return condyle.Distribution(name, self.preload, self.contact_weight, self.emg_weight)


@dataclass(frozen=True)
class OutputOptions(Group):
    """The files of a run."""

    out: Annotated[Path, option("Folder for the results.")] = Path("results")
    figures: Figures = False
    report: Report = False
    mat: Mat = False
