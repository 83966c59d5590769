"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Mechanism = Annotated[
    str, typer.Argument(help="Mechanism file (TOML), or the name of a bundled mechanism.")
]
Formulation = Annotated[
    str,
    typer.Option(
        help="How the equations are derived: virtual_power, momentum, lagrange, hessian, "
        "newton_euler."
    ),
]
Route = Annotated[
    str, typer.Option(help="core (through six coordinates) or direct (the independent ones).")
]
LoadPoint = Annotated[
    str | None,
    typer.Option(help="Platform point the load acts at. Default: right_molar if there is one."),
]
Motion = Annotated[
    Path | None,
    typer.Option(help="Motion to follow (CSV). Default: the bundled chewing path (synthetic)."),
]
Load = Annotated[
    Path | None,
    typer.Option(
        help="Load on the platform (CSV). Default: the bundled bite force (synthetic) with the "
        "bundled motion, else none."
    ),
]
Units = Annotated[
    str, typer.Option(help="Units of the motion's lengths and angles: m,rad or mm,deg ...")
]
Landmark = Annotated[
    str | None,
    typer.Option(help="Platform point whose path x, y, z is given. Default: incisor."),
]
Smooth = Annotated[
    str | None,
    typer.Option(help="Smooth a measured motion: cut-off in Hz, or auto (10 Hz)."),
]
Rate = Annotated[
    float | None,
    typer.Option(help="Samples a second of the results. Default: those of the motion."),
]
Reactions = Annotated[
    bool, typer.Option("--reactions", help="Forces and moments in every joint too.")
]
Backend = Annotated[
    str,
    typer.Option(help="compiled, interpreted, or auto (compiled where there is a C compiler)."),
]
Threads = Annotated[
    int | None,
    typer.Option(min=1, help="At most so many threads. Default: all processors. Same results."),
]
Flag = Annotated[
    bool,
    typer.Option("--flag", help="Keep samples that cannot be computed: empty, with a status."),
]
Strict = Annotated[bool, typer.Option("--strict", help="A contact outside its bounds is an error.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON.")]
