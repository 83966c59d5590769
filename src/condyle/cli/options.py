"""Options that several commands share, and what they are for.

A command takes a group as one parameter; `command` makes an option of each of its fields.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..files.atomic import LOGS, TABLES, check_writable, make_folder
from .docstrings import parts

if TYPE_CHECKING:
    from ..model.distributing import Distribution
    from ..model.model import Model

# Option -> its least and its greatest number.
RANGES: dict[str, tuple[float, float | None]] = {
    **dict.fromkeys(
        ("max_error", "max_gap", "max_residual", "seed", "tolerance", "trim"), (0, None)
    ),
    **dict.fromkeys(("prove", "threads", "workers"), (1, None)),
    "fps": (1, 60),
    "margin": (0, 1),
    "port": (1, 65535),
    "seconds": (0.01, 600),
    "speed": (1e-6, 1e6),
    "width": (160, 1920),
}

# Option -> how to get a first file for it.
STARTERS = {
    "scenario": "condyle simulate --new FILE.toml writes one.",
    "study": "condyle new NAME --study KIND writes one; condyle new --list shows the kinds.",
    "mechanism": "It is a file or a bundled mechanism; condyle new --list shows these.",
    "solution": "condyle run writes one into results/.",
}


def written(*endings: str) -> Any:
    """An option for a file to write: before anything is computed it is known that it can be."""

    def checked(context: typer.Context, option: typer.CallbackParam, path: Path | None) -> Any:
        if path is not None and not context.resilient_parsing:  # as while a word is completed
            try:
                check_writable(path, endings)
            except InputError as error:
                raise InputError(f"{option.opts[0]} {error}") from None
        return path

    return typer.Option(callback=checked)


def output_folder(path: Path) -> Path:
    """`make_folder`, whose error names the option."""
    try:
        return make_folder(path)
    except InputError as error:
        raise InputError(f"--out {error}") from None


def _can_be_folder(context: typer.Context, path: Path | None) -> Any:
    if path is not None and not context.resilient_parsing:  # as while a word is completed
        above = next((part for part in (path, *path.parents) if part.exists()), Path())
        if not above.is_dir():
            output_folder(path)
    return path


FOLDER = typer.Option(callback=_can_be_folder)  # to write to: no file stands there
TABLE, LOG, TOML = written(*TABLES), written(*LOGS), written(".toml")
PAGE = written(".html", ".htm")


class Shared:
    """Options that commands take one by one.

    Args:
        mechanism: Mechanism file (TOML), or the name of a bundled mechanism: <names>.
        load_point: Platform point at which the load acts, by name or as x,y,z in {M} (m); several,
            separated by ";", bear equal parts. Default: the load's own point, else right_molar,
            else the only point.
        solution: Results (.nc) of a run.
        measured: Markers and EMG measured during the motion (.csv or .parquet), shown with the
            results; condyle motion from-c3d --measured writes them.
        flag: Keep samples that cannot be computed, empty, with a status, instead of failing.
        max_error: Maximum relative error, such as 1e-8: a sample whose bound exceeds it is an
            error; the bounds are written too, as column bound.
        reactions: Also compute forces and moments in every joint.
        mat: Also write the results for MATLAB (.mat).
        prefix: Prefix of all names in C. Default: the mechanism's name.
        quiet: Print only what was asked for, and errors.
        as_json: Print one JSON object, and nothing else.
        strict: Treat warnings as errors.
    """


class Group:
    """Options that go together; a dataclass."""

    def arguments(self) -> dict[str, Any]:
        """All of them, as the library's functions take them."""
        return {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]

    def given(self) -> dict[str, Any]:
        """Options that differ from their defaults, to be said again."""
        usual = type(self)().arguments()
        return {name: one for name, one in self.arguments().items() if one != usual[name]}


@dataclass(frozen=True)
class MotionOptions(Group):
    """The motion and the load on the platform.

    Args:
        motion: Motion (CSV or Parquet): t (s) and pose coordinates such as X, Y (m), alpha, beta
            (rad), or the path x, y, z (m) of a landmark; if any, gravity gx, gy, gz (m/s^2) and
            the base's motion base_ax ... base_dwz. Default: the bundled chewing path where it fits
            the mechanism, else a trial motion about home (both synthetic).
        load: Load on the platform (CSV or Parquet): t (s), and any of Fx, Fy, Fz (N), Mx, My, Mz
            (N m). Default: with the bundled motion the bundled bite force (synthetic), else none.
        units: Units of time (s, ms, us, min), length (m, cm, mm, um) and angle (rad, deg, mrad) in
            the motion file, such as ms,mm,deg. A header such as x (mm) also states its unit.
        landmark: Platform point whose path x, y, z the motion file has. Default: incisor if there
            is one, else the only point.
        smooth: Low-pass cut-off frequency for a measured motion (Hz); auto: 10 Hz.
        rate: Sampling rate of the results (Hz). Default: that of the motion.
        trim: Time to cut off at both ends of the motion (s), where smoothing is least accurate:
            0.2 with --smooth auto.
        fit: Move measured whole poses (t, X, Y, Z, alpha, beta, gamma) onto the contacts, each to
            the pose nearest at the contact points and landmarks. Default: keep the independent
            coordinates and recompute the others.
    """

    motion: Path | None = None
    load: Path | None = None
    load_point: str | None = None
    units: str | None = None
    landmark: str | None = None
    smooth: str | None = None
    rate: float | None = None
    trim: float = 0.0
    fit: bool = False


@dataclass(frozen=True)
class ModelOptions(Group):
    """How the equations are derived and run.

    Args:
        formulation: How the equations of motion are derived: <names>. All give the same
            efforts.
        route: How the contacts enter the equations: core (last; any contacts) or direct (first;
            flat contacts only). Both give the same efforts.
        backend: How kernels run: compiled, numpy (the same numbers, slower), cuda (on NVIDIA's
            graphics processors), or auto: compiled where there is a C compiler.
        threads: Maximum number of threads. Default: all processors. The same results.
    """

    formulation: str = "virtual_power"
    route: str = "core"
    backend: str = "auto"
    threads: int | None = None

    def of(self, mechanism: str, distribution: DistributionOptions | None = None) -> Model:
        """The model of a mechanism that the options ask for."""
        import condyle

        derivation = self.arguments()
        del derivation["threads"]
        chosen = None if distribution is None else distribution.chosen()
        return condyle.derive(mechanism, distribution=chosen, **derivation)


@dataclass(frozen=True)
class DistributionOptions(Group):
    """How redundancy is resolved.

    Args:
        distribution: How redundancy is resolved: the objective that is minimised. <names>.
            Default: cubic with muscles, bounded with cables, else minimum_norm. Where N m and N
            mix: weighted or minimax.
        preload: Minimum compressive force on unilateral contacts, and force of either sign on
            others with friction (N), for objectives with limits.
        contact_weight: Weight W of contact forces, for weighted: adds W (force/N_ref)^2 of every
            contact to the objective, from least effort (0) to least contact force. N_ref is the
            largest effort limit of the chains [N], of torques over the characteristic length.
        emg_weight: For emg_assisted: weight of a muscle's squared deviation from its EMG, against
            the squared activation of muscles without EMG.
        unilateral: Unilateral contacts that would have to pull, with minimum_norm: keep (they pull
            and are reported) or release (they bear nothing). Other objectives release them.
    """

    distribution: str | None = None
    preload: float = 0.0
    contact_weight: float = 0.0
    emg_weight: float = 1.0
    unilateral: str = "keep"

    def chosen(self) -> Distribution:
        """The `condyle.Distribution` of these."""
        import condyle

        name: Any = self.distribution
        unilateral: Any = self.unilateral
        return condyle.Distribution(
            name, self.preload, self.contact_weight, self.emg_weight, unilateral
        )


@dataclass(frozen=True)
class OutputOptions(Group):
    """The files of a run.

    Args:
        out: Folder for the results.
        figures: Also draw figures.
        report: Also write the page of condyle report.
    """

    out: Annotated[Path, FOLDER] = Path("results")
    figures: bool = False
    report: bool = False
    mat: bool = False


GROUPS = (MotionOptions, ModelOptions, DistributionOptions, OutputOptions)
HELP = {name: text for one in (Shared, *GROUPS) for name, text in parts(one)[1].items()}
