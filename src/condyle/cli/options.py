"""Options that several commands share: what they are for, and what the shell offers for them."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from . import completion

HELP = {
    "formulation": f"How the equations are derived: {', '.join(completion.FORMULATIONS)}. "
    "All give the same numbers.",
    "route": "How the contacts enter the equations: core (afterwards; any contacts) or direct "
    "(at once; flat contacts only). Both give the same numbers.",
    "distribution": "Which of all efforts that balance are chosen, by what is least. "
    + "; ".join(f"{name}: {least}" for name, least in completion.DISTRIBUTIONS.items())
    + ". Default: bounded with cables, else minimum_norm. Where N m and N mix: weighted or "
    "minimax.",
    "preload": "Least push of one-sided contacts (N), where efforts are chosen within limits.",
    "contact_weight": "With weighted: adds W (force/N_ref)^2 of every contact to what is least, "
    "from least effort (0) to least load on the contacts. N_ref is the largest limit of the "
    "chains, as a force.",
    "load_point": "Platform point the load acts at. Default: that of the load, right_molar, or the "
    "only point.",
    "motion": "Motion to follow (CSV or Parquet): t (s) and pose coordinates such as X, Y (m), "
    "alpha, beta (rad), or the path x, y, z (m) of a landmark. Default: the bundled chewing "
    "path, or a trial motion about home for mechanisms that it does not fit (both synthetic).",
    "load": "Load on the platform (CSV or Parquet): t (s), some of Fx, Fy, Fz (N), Mx, My, Mz "
    "(N m). Default: the bundled load (synthetic) with the bundled motion, else none.",
    "measured": "What was measured beside the motion (.csv or .parquet), to be shown with the "
    "results: markers and EMG, as condyle motion from-c3d --measured writes them.",
    "units": "Units of the motion's times (s, ms, us, min), lengths (m, cm, mm, um) and angles "
    "(rad, deg, mrad), as in ms,mm,deg. A header such as x (mm) says so too.",
    "landmark": "Platform point whose path x, y, z is given. Default: incisor if there is one, "
    "else the only point.",
    "smooth": "Smooth a measured motion: what is quicker than so many Hz goes; auto is 10 Hz.",
    "rate": "Samples a second (Hz) of the results. Default: those of the motion.",
    "reactions": "Forces and moments in every joint too.",
    "mat": "Write results for MATLAB (.mat) too.",
    "backend": "compiled, numpy (the same numbers, slower), or auto: compiled where there is "
    "a C compiler.",
    "flag": "Keep samples that cannot be computed: empty, with a status.",
    "quantity": f"What to map, of {', '.join(completion.QUANTITIES)}; repeat for more, or "
    "separate by commas. Default: ratio.",
    "kind": f"What to export; repeat for more: {', '.join(completion.FMUS)}. Default: the first "
    "three.",
    "strict": "A contact outside its bounds is an error.",
    "threads": "At most so many threads. Default: all processors. Same results.",
    "trim": "Leave out so many seconds of the motion at either end, where smoothing is least "
    "certain: 0.2 with --smooth auto.",
}
NAMES = {"coordinates": "--from", "every": "--all"}  # of parameters that Python does not like so
# Parameter of a command -> the numbers that it takes.
RANGE: dict[str, dict[str, Any]] = {
    **{name: {"min": 0.0} for name in ("max_gap", "max_residual", "tolerance", "trim")},
    "margin": {"min": 0.0, "max": 1.0},
    "seconds": {"min": 0.01, "max": 600},
    "seed": {"min": 0},
    "threads": {"min": 1},
}
Mechanism = Annotated[
    str,
    typer.Argument(
        help="Mechanism file (TOML), or the name of a bundled mechanism: "
        + ", ".join(completion.bundled())
        + ".",
        autocompletion=completion.mechanisms,
    ),
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print only what was asked for, and errors.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, and nothing else.")]
