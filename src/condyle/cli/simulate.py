"""condyle simulate: forward in time."""

from __future__ import annotations

from pathlib import Path

from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import file_stem, output_folder, require_drawing, warn

FEW = 8  # events that a screen shows


@command(COMPUTE, example="condyle simulate jaw.toml --scenario chew.toml --out results --report")
def simulate(
    mechanism: options.Mechanism = "masticatory",
    scenario: Path | None = None,
    out: Path = Path("results"),
    stop_at_bounds: bool = False,
    check_gains: bool = False,
    new: Path | None = None,
    report: bool = False,
    backend: str = "auto",
) -> Answer:
    """Forward in time, under efforts or a controller.

    The contacts are kept exactly; food breaks, efforts saturate, encoders count. Results are those
    of condyle run, with what was commanded, measured and lost besides.

    Options:
        scenario: What happens (TOML): start, efforts or controller, sensors, loads, duration.
            Default: computed torque along the bundled chewing path, or a trial motion. condyle
            simulate --new FILE writes one to start from.
        out: Folder for the results.
        stop_at_bounds: End where a contact leaves its surface.
        check_gains: Only say whether the controller's loop is stable, at home and along its path.
        new: Write a first scenario there, and stop.
        report: Write the page of condyle report too.
    """
    if new is not None:
        return _new(new, mechanism)
    require_drawing(False, report)
    import condyle

    from ..results.summary import summarize
    from ..simulation import simulate as run
    from ..simulation.bind import bind
    from ..simulation.first_scenario import default_scenario
    from ..simulation.gains import check_gains as check
    from ..simulation.simulating import as_scenario

    machine = condyle.load_mechanism(mechanism)
    told = default_scenario() if scenario is None else as_scenario(scenario)
    source = "the default scenario" if scenario is None else str(scenario)
    model = condyle.derive(machine, backend=backend)
    if check_gains:
        found = check(bind(model, told, source=source))
        warn(found.warnings)
        then = command_line("simulate", mechanism, scenario=scenario)
        return Answer(str(found), {"mechanism": machine.name} | found.data(), then, "result")
    solution = run(model, told, stop_at_bounds=stop_at_bounds, source=source)
    folder, stem = output_folder(out), file_stem(machine.name)
    files = [folder / f"{stem}.nc", folder / f"{stem}.csv"]
    solution.condyle.save(*files)
    if report:
        from ..report.page import write_report

        inputs = [scenario] if scenario is not None else []
        inputs += [Path(mechanism)] if Path(mechanism).is_file() else []
        files.append(write_report(solution, folder / f"{stem}.html", files=inputs))
    warn(solution.condyle.warnings)
    events = solution.condyle.events
    summary = summarize(solution)
    lines = [f"  t = {e['time']:.4f} s: {e['kind']} {e['owner']}".rstrip() for e in events[:FEW]]
    if len(events) > FEW:
        lines.append(f"  and {len(events) - FEW} more (solution.condyle.events)")
    told_of = "\n".join(["events:", *lines]) if lines else "events: none"
    return Answer(
        f"{summary}\n{told_of}\n\n{files_line(files)}",
        summary.data | {"events": events, "files": files},
        command_line("view", solution=files[0]) if report else command_line("report", files[0]),
    )


def _new(path: Path, mechanism: str) -> Answer:
    from ..atomic import write_text
    from ..errors import InputError
    from ..simulation.first_scenario import STARTER

    if path.exists():
        raise InputError(f"{path} exists already; choose another name")
    write_text(path, STARTER)
    then = command_line("simulate", mechanism, scenario=path)
    return Answer(f"Wrote {path}", {"files": [path]}, then)
