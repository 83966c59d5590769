"""condyle export: a mechanism as something else."""

from __future__ import annotations

import shlex
from pathlib import Path

from . import options
from .answer import Answer
from .command import COMPUTE, command, group
from .inputs import output_folder, warn

export = group("export", COMPUTE, "A mechanism for controllers and other programs.")


@command(COMPUTE, example="condyle export c masticatory --out masticatory-c", of=export, name="c")
def c(
    mechanism: options.Mechanism,
    out: Path,
    question: list[str] | None = None,
    coordinates: str | None = None,
    landmark: str | None = None,
    precision: str = "double",
    constants: str = "inside",
    prefix: str | None = None,
    lanes: int = 8,
    formulation: str = "virtual_power",
    route: str = "core",
) -> Answer:
    """C99 source and header for a controller.

    No heap, no globals, no input or output, bounded time. With it come an example, recorded test
    vectors, a Makefile whose `make check` compares with them, and a page of measured facts.

    Options:
        coordinates: Coordinates that closure starts from, as in X,Y,Z,alpha.
        out: Folder for source, header, example and tests.
        question: What to export; repeat for more: inverse, contact (with contact forces), bounded
            (within limits), forward (accelerations), motion, closure, pose and observer (from
            encoders), and controllers: computed_torque, impedance, joint_pd, bite_force. Default:
            inverse, contact, forward, motion, pose, computed_torque, and closure with --from or
            --landmark.
        landmark: Platform point whose path closure starts from.
        precision: double, or float for processors that compute in it alone.
        constants: inside, or struct: in a structure that a program fills at run time.
        prefix: What all names in C begin with. Default: the mechanism's name.
        lanes: Width of GCC's vector types: 2, 4 or 8 doubles; 0: none.
    """
    import condyle

    from ..export import Wish, in_order, usual
    from ..export import export as exported_of
    from ..export.c_package import write_facts, write_package

    machine = condyle.load_mechanism(mechanism)
    given = (one.strip() for one in coordinates.split(",")) if coordinates else ()
    names = in_order(tuple(given))
    closing = ("closure",) if coordinates or landmark else ()
    made = exported_of(
        machine,
        question or (*usual(machine), *closing),
        formulation=formulation,
        route=route,
        precision=precision,
        prefix=prefix,
        constants=constants,
        lanes=lanes,
        coordinates=names,
        landmark=landmark,
    )
    files = write_package(made, machine, Wish(names, landmark), output_folder(out))
    facts = write_facts(made, out)
    files["facts"] = facts.path
    warn(facts.warnings)
    mapped = {name: ours for name, ours in made.names.items() if name != ours}
    lines = [f'"{machine.name}" in C: {", ".join(f.name for f in made.functions)}']
    lines += [f"  {name} is {ours}" for name, ours in mapped.items()]
    lines += [f"Wrote {', '.join(path.name for path in files.values())} to {out}"]
    data = {
        "prefix": made.prefix,
        "functions": [f.name for f in made.functions],
        "names": mapped,
        "symbols": list(made.symbols),
        "facts": facts.data,
        "files": list(files.values()),
    }
    return Answer("\n".join(lines), data, f"make -C {shlex.quote(str(out))} check")
