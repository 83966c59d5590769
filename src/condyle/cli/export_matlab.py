"""condyle export matlab: MEX functions."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .export import export


@command(
    COMPUTE, example="condyle export matlab masticatory --out matlab", of=export, name="matlab"
)
def matlab(
    mechanism: options.Mechanism,
    out: Path,
) -> Answer:
    """Functions for MATLAB and Octave (MEX): C, help texts, build.m and an example.

    Options:
        out: Folder for the files.
    """
    import condyle

    made = condyle.export_matlab(mechanism, out)
    data = made.data | {"files": list(made)}
    return Answer(files_line(made), data, command_line("check", mechanism))
