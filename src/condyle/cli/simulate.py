"""Forward in time."""

from __future__ import annotations

from pathlib import Path

import condyle

from ..atomic import write_text
from ..errors import InputError, shown
from .answer import Answer, command_line, files_line, warn
from .command import to_compute
from .inputs import look_at, require_drawing, written
from .options import OutputOptions

FEW = 8  # events that a screen shows


@to_compute(
    "simulate jaw.toml --scenario chew.toml --out results --report",
    "simulation.simulating:simulate",
)
def simulate(
    mechanism: str = "masticatory",
    *,
    output: OutputOptions,
    scenario: Path | None = None,
    stop_at_bounds: bool = False,
    check_gains: bool = False,
    new: Path | None = None,
    log: Path | None = None,
    log_noise: str | None = None,
    backend: str = "auto",
) -> Answer:
    """Simulation: motion over time under efforts or a controller.

    Contacts are exact constraints; food breaks, actuators saturate, encoders quantise. Results are
    those of condyle run, with commands, measurements and friction losses.

    Args:
        scenario: Scenario (TOML): start, efforts or controller, sensors, loads, duration. Default:
            computed torque along the bundled chewing path, or along a trial motion. condyle
            simulate --new FILE writes one to start from.
        check_gains: Only check whether the control loop is stable, at home and along its path; exit
            status 1 if it is not.
        new: Only write a scenario to start from, to this file.
        log: Also write what encoders and drives would have recorded, to this file (.csv or
            .parquet): the log that condyle identify reads.
        log_noise: Standard deviations of noise on that log, "encoder=1e-4,effort=0.001" (rad or m,
            N m or N).
    """
    if new is not None:
        return _new(new, mechanism)
    require_drawing(output.figures, output.report)
    from ..results.summary import summarize

    model = condyle.derive(mechanism, backend=backend)
    if check_gains:
        found = condyle.check_gains(model, scenario)
        warn(found.warnings)
        then = command_line("simulate", mechanism, scenario=scenario)
        data = {"mechanism": model.mechanism.name} | found.data()
        return Answer(str(found), data, then, "result", failed=not data["stable"])
    solution = condyle.simulate(model, scenario, stop_at_bounds=stop_at_bounds)
    warn(solution.condyle.warnings)
    files = written(solution, output, [scenario, mechanism])
    if log is not None:
        encoder, effort = (_noise(log_noise).get(name, 0.0) for name in ("encoder", "effort"))
        condyle.write_log(solution, log, encoder_noise=encoder, effort_noise=effort)
        files.append(log)
    events, summary = solution.condyle.events, summarize(solution)
    lines = [f"  t = {e['time']:.4f} s: {e['kind']} {e['owner']}".rstrip() for e in events[:FEW]]
    if len(events) > FEW:
        lines.append(f"  and {len(events) - FEW} more (solution.condyle.events)")
    listed = "\n".join(["events:", *lines]) if lines else "events: none"
    text = f"{summary}\n{listed}\n\n{files_line(files)}"
    return Answer(text, summary.data | {"events": events, "files": files}, look_at(files, output))


def _new(path: Path, mechanism: str) -> Answer:
    from ..simulation.first_scenario import STARTER

    if path.exists():
        raise InputError(f"{path} exists already; choose another name")
    write_text(path, STARTER)
    then = command_line("simulate", mechanism, scenario=path)
    return Answer(f"Wrote {path}", {"files": [path]}, then)


def _noise(text: str | None) -> dict[str, float]:
    """Standard deviations by name, from "encoder=1e-4,effort=0.001"."""
    found = {}
    for part in text.split(",") if text else ():
        name, _, size = part.partition("=")
        try:
            found[name.strip()] = float(size)
        except ValueError:
            found[""] = 0.0
    if not found.keys() <= {"encoder", "effort"}:
        raise InputError(f'--log-noise: expected "encoder=1e-4,effort=0.001", got {shown(text)}')
    return found
