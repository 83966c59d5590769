"""condyle export fmu: a mechanism for Simulink, Modelica and their kin."""

from __future__ import annotations

from pathlib import Path

from . import completion, options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .export import export
from .inputs import file_stem, output_folder, warn


@command(COMPUTE, example="condyle export fmu masticatory --out fmu", of=export, name="fmu")
def fmu(
    mechanism: options.Mechanism,
    out: Path,
    kind: list[str] | None = None,
    fmi: int = 3,
) -> Answer:
    """Functional mock-up units (FMI 2.0 or 3.0), for model exchange and co-simulation.

    The plant (efforts in, motion out), the inverse model, within limits as `bounded`, and a
    computed-torque controller. They hold their sources, and a binary for this machine where there
    is a C compiler.

    Options:
        out: Folder for the files.
        fmi: Version of the standard: 2 or 3.
    """
    import condyle

    from ..export.fmu import write_fmu

    machine = condyle.load_mechanism(mechanism)
    folder, files, bare = output_folder(out), [], False
    kinds = list(dict.fromkeys(kind or completion.FMUS[:3]))
    for one in kinds:
        path = folder / f"{file_stem(machine.name)}-{file_stem(one)}.fmu"
        bare |= not write_fmu(machine, one, fmi, path)
        files.append(path)
    if bare:
        warn(["no binary for this machine: the files hold sources alone, to be compiled elsewhere"])
    if {"inverse", "controller"} & set(kinds) and any(c.kind == "cable" for c in machine.chains):
        warn(["efforts in FMUs are of least norm, without limits: a cable may be asked to push"])
    data = {"mechanism": machine.name, "fmi": fmi, "binary": not bare, "files": files}
    return Answer(files_line(files), data, command_line("check", mechanism))
