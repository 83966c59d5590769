"""condyle export: code and models for other programs."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

from . import options
from .answer import Answer
from .command import COMPUTE, command, group
from .inputs import warn

export = group("export", COMPUTE, "Code and models for controllers and other programs.")


@command(COMPUTE, example="condyle export c masticatory --out masticatory-c", of=export, name="c")
def c(
    mechanism: options.Mechanism,
    out: Path,
    question: list[str] | None = None,
    coordinates: Annotated[str | None, options.option("", "--from")] = None,
    landmark: options.Landmark = None,
    precision: str = "double",
    constants: str = "inside",
    prefix: str | None = None,
    lanes: int = 8,
    formulation: options.Formulation = "virtual_power",
    route: options.Route = "core",
) -> Answer:
    """C99 source and header for a controller.

    No heap, no globals, no input or output, bounded time. Included: an example, recorded test
    vectors, a Makefile whose `make check` compares with them, and a page of measured facts.

    Options:
        coordinates: Coordinates given to closure, such as X,Y,Z,alpha.
        out: Folder for source, header, example and tests.
        question: What to export; repeat for more: inverse, contact (with contact forces), bounded
            (within limits), forward (accelerations), motion, closure, pose and observer (from
            encoders), and controllers: computed_torque, impedance, joint_pd, bite_force. Default:
            inverse, contact, forward, motion, pose, computed_torque, and closure with --from or
            --landmark.
        landmark: Platform point whose path is given to closure.
        precision: double, or float for single-precision processors.
        constants: inside: compiled in; struct: in a structure that the program fills at run time.
        prefix: Prefix of all names in C. Default: the mechanism's name.
        lanes: Width of GCC's vector types: 2, 4 or 8 doubles; 0: none.
    """
    import condyle

    made = condyle.export_c(
        mechanism,
        out,
        question=question,
        coordinates=coordinates or (),
        landmark=landmark,
        precision=precision,
        constants=constants,
        prefix=prefix,
        lanes=lanes,
        formulation=formulation,
        route=route,
    )
    warn(made.notes)
    known = made.data
    lines = [f'"{known["mechanism"]}" in C: {", ".join(known["functions"])}']
    lines += [f"  {name} is {ours}" for name, ours in known["names"].items()]
    lines += [f"Wrote {', '.join(path.name for path in made)} to {out}"]
    then = f"make -C {shlex.quote(str(out))} check"
    return Answer("\n".join(lines), known | {"files": list(made)}, then)
