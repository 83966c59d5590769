"""condyle check: summary of a mechanism, or its problems."""

from __future__ import annotations

from . import options
from .answer import Answer, command_line
from .command import START, command
from .inputs import warn


@command(START, example="condyle check jaw.toml")
def check(mechanism: options.Mechanism, project: bool = False) -> Answer:
    """Summary of a mechanism, or every mistake in its file.

    Chains, contacts, degrees of freedom, sizes, masses, gravity, limits, distance from a
    singularity at home, and a warning for implausible numbers.

    Options:
        project: If contact points are off their surfaces, show the nearest home that is on them.
    """
    import condyle

    if project and (nearest := _projection(mechanism)) is not None:
        return nearest
    summary = condyle.check(mechanism)
    warn(summary.warnings)
    then = command_line("run", mechanism)
    return Answer(f"{summary}\n", summary.data, then, "result")


def _projection(mechanism: str) -> Answer | None:
    """The nearest home on the surfaces; None if the file's home is there already."""
    from ..kinematics.project import project_home
    from ..mechanism.files import from_data
    from ..mechanism.quantities import PER_METRE
    from ..mechanism.toml import read_tables, read_text

    tables = read_tables(read_text(mechanism), mechanism)
    projection = project_home(from_data(tables, mechanism, at_home=False))
    if not projection.needed:
        return None
    text = projection.text(PER_METRE[tables.get("length_unit", "m")])
    return Answer(
        f"{text}\n\nChange the points in the file to these, then check again.",
        projection.data(),
        command_line("check", mechanism, project=True),
        "result",
    )
