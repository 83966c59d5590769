"""condyle export fmu: a mechanism for Simulink, Modelica and their kin."""

from __future__ import annotations

from pathlib import Path

from . import completion, options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .export import export
from .inputs import warn


@command(COMPUTE, example="condyle export fmu masticatory --out fmu", of=export, name="fmu")
def fmu(
    mechanism: options.Mechanism,
    out: Path,
    kind: list[str] | None = None,
    fmi: int = 3,
) -> Answer:
    """Functional mock-up units (FMI 2.0 or 3.0), for model exchange and co-simulation.

    The plant (efforts in, motion out), the inverse model, within limits as `bounded`, and a
    computed-torque controller. They contain their sources, and a binary for this machine if there
    is a C compiler.

    Options:
        kind: Unit to export; repeat for more: plant, inverse, controller, bounded. Default: the
            first three.
        out: Folder for the files.
        fmi: Version of the standard: 2 or 3.
    """
    import condyle

    made = condyle.export_fmu(mechanism, out, kind=kind or completion.FMUS[:3], fmi=fmi)
    warn(made.notes)
    data = made.data | {"files": list(made)}
    return Answer(files_line(made), data, command_line("check", mechanism))
