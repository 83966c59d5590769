"""Dynamics: along a motion, of independent states, one per row of a file, and forward in time."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import condyle

from ..errors import InputError, UnsupportedError
from ..files.atomic import check_writable, write_text
from .answer import NO, NOT_JUDGED, Answer, answer, command_line, files_line
from .command import command
from .inputs import require_drawing, solved
from .options import (
    LOG,
    TABLE,
    TOML,
    DistributionOptions,
    ModelOptions,
    MotionOptions,
    OutputOptions,
    written,
)

if TYPE_CHECKING:
    from ..model.model import Contacts

FEW = 8  # events that a screen shows
STATUSES = {True: 0, False: NO, None: NOT_JUDGED}  # by whether a loop is stable


@command(
    "run jaw.toml --motion path.csv --units mm,deg --load bite.csv --report",
    "analysis.run_motion:run",
)
def run(
    mechanism: str = "masticatory",
    *,
    motion: MotionOptions,
    model: ModelOptions,
    distribution: DistributionOptions,
    output: OutputOptions,
    **given: Any,
) -> Answer:
    """Efforts and contact forces along a motion (inverse dynamics).

    Without arguments: the bundled chewing robot, a synthetic chewing path and bite force.
    """
    require_drawing(output.figures, output.report)
    from ..results.enclosures import Proof

    how = {**motion.arguments(), **model.arguments(), **given}
    solution = condyle.run(mechanism, distribution=distribution.chosen(), **how)
    inputs = (motion.motion, motion.load, given.get("measured"), given.get("vary"), mechanism)
    proofs = json.loads(solution.attrs.get("proof", "[]"))
    data = {"proof": proofs} if proofs else {}
    return solved(solution, output, inputs, [str(Proof(**one)) for one in proofs], data)


@command(
    "solve jaw.toml --states states.csv --out efforts.csv", "results.inverse_rows:solve_states"
)
def solve(
    mechanism: str,
    *,
    states: Path,
    out: Annotated[Path, TABLE],
    model: ModelOptions,
    distribution: DistributionOptions,
    mat: bool = False,
    **given: Any,
) -> Answer:
    """Args: out: File for the results (.csv or .parquet)."""
    given |= {"threads": model.threads, "mat": out.with_suffix(".mat") if mat else None}
    report = condyle.solve_states(model.of(mechanism, distribution), states, out, **given)
    return answer(report, command_line("view", mechanism))


@command(
    "forward jaw.toml --states states.csv --out accelerations.csv",
    "results.forward_rows:forward_states",
)
def forward(
    mechanism: str, *, states: Path, out: Annotated[Path, TABLE], model: ModelOptions, **given: Any
) -> Answer:
    """Args: out: File for the results (.csv or .parquet)."""
    given["threads"] = model.threads
    report = condyle.forward_states(model.of(mechanism), states, out, **given)
    return answer(report, command_line("view", mechanism))


@command(
    "derivatives jaw.toml --states states.csv --wrt platform.mass --out slopes.csv",
    "results.derivative_rows:derivative_states",
)
def derivatives(
    mechanism: str,
    *,
    states: Path,
    out: Annotated[Path, TABLE],
    model: ModelOptions,
    distribution: DistributionOptions,
    **given: Any,
) -> Answer:
    """Args: out: File for the derivatives (.csv or .parquet)."""
    report = condyle.derivative_states(model.of(mechanism, distribution), states, out, **given)
    return answer(report, command_line("view", mechanism))


@command("modes jaw.toml --at right_molar")
def modes(
    mechanism: str,
    *,
    states: Path | None = None,
    out: Annotated[Path | None, TABLE] = None,
    at: str | None = None,
    flag: bool = False,
    contacts: str = "kept",
    mode: int = 1,
    motion: Annotated[Path | None, written(".csv")] = None,
    picture: Annotated[Path | None, written(".png", ".svg", ".pdf")] = None,
    model: ModelOptions,
    distribution: DistributionOptions,
) -> Answer:
    """Natural frequencies, shapes and damping of a mechanism whose drives or rods give.

    At home, with the compliance of a point of the platform; or at the states of a file.

    Args:
        states: States (CSV or Parquet), one per row: independent coordinates and, if there is a
            load, Fx .. Mz.
        out: File for the frequencies at states (.csv or .parquet).
        at: Platform point whose compliance is stated, and at which loads of states act. Default:
            the origin of {M}.
        contacts: kept on their surfaces, or compliant: those with compliance yield.
        mode: Mode that --motion writes; 1 is the lowest.
        motion: Write a slow swing of a mode (.csv), to be run and viewed.
        picture: Draw frequencies, and the mechanism in each mode at home (.png, .svg or .pdf).
    """
    from ..results.vibrations import home_modes, mode_states, require_mode, write_mode

    require_drawing(picture is not None, False)
    made, how = model.of(mechanism, distribution), cast("Contacts", contacts)
    then = command_line("check", mechanism)
    require_mode(mode, len(made.independent))
    if states is None and out is None:
        home, files = home_modes(made, at, how), []
        if motion is not None:
            write_mode(made, mode, motion, how)
            files, then = [motion], command_line("run", mechanism, motion=motion)
        if picture is not None:
            from ..report.figures import save
            from ..report.figures.modes_figure import modes_figure

            drawn = modes_figure(made, home)
            files += save(drawn, picture.parent, picture.stem, [picture.suffix.removeprefix(".")])
        text = f"{home}\n{files_line(files)}" if files else f"{home}"
        return Answer(text, home.data | {"files": files}, then, "result")
    if states is None or out is None:
        raise InputError("modes: --states and --out go together: states in, frequencies out")
    if motion is not None or picture is not None:
        raise InputError("modes: --motion and --picture are of modes at home; leave out --states")
    return answer(mode_states(made, states, out, at, flag, contacts=how), then)


@command(
    "pose jaw.toml --joints encoders.csv --out poses.csv",
    "results.pose_rows:pose_states",
    without="every",
)
def pose(
    mechanism: str,
    *,
    joints: Path,
    out: Annotated[Path, TABLE],
    all_: bool = False,
    tolerance: float = 1e-6,
    **given: Any,
) -> Answer:
    """Args:
    out: File for the poses (.csv or .parquet).
    all_: List all assembly modes that a random search finds; it may miss some.
    seed: Seed of the search of --all. Default: 0.
    """
    report = condyle.pose_states(mechanism, joints, out, every=all_, tolerance=tolerance, **given)
    return answer(report, command_line("view", mechanism), report.data["files"])


@command(
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
    new: Annotated[Path | None, TOML] = None,
    log: Annotated[Path | None, LOG] = None,
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
        check_gains: Only check whether the control loop is stable for small deviations, at home,
            along its path and where it meets loads; exit status 1 if it is not, 3 if a part of it
            was not judged.
        new: Only write a scenario to start from, to this file.
        log: Also write what encoders and drives would have recorded, to this file (.csv, .parquet
            or .mcap): the log that condyle identify reads.
        log_noise: Standard deviations of noise on that log, "encoder=1e-4,effort=0.001" (rad or m,
            N m or N).
    """
    if new is not None:
        others = (scenario, log, log_noise, output != OutputOptions(), stop_at_bounds, check_gains)
        if any(others):
            raise UnsupportedError("--new only writes a scenario: leave the other options out")
        return _new(new, mechanism)
    if log_noise is not None and log is None:
        raise UnsupportedError("--log-noise requires --log, the file for the log")
    from ..motion.mcap_file import is_mcap, require_mcap
    from ..motion.written_values import values_of

    if log is not None and is_mcap(log):
        require_mcap()
    noise = values_of(log_noise or "", ["encoder", "effort"], "--log-noise")
    require_drawing(output.figures, output.report)
    model = condyle.derive(mechanism, backend=backend)  # type: ignore[arg-type]
    if check_gains:
        found = condyle.check_gains(model, scenario)
        then = command_line("simulate", mechanism, scenario=scenario)
        return replace(answer(found, then), status=STATUSES[found.stable])
    solution = condyle.simulate(model, scenario, stop_at_bounds=stop_at_bounds)
    if log is not None:
        check_writable(log)  # before the results: it may be what the scenario names
    events = solution.condyle.events
    lines = [_event_line(e) for e in events[:FEW]]
    if len(events) > FEW:
        lines.append(f"  and {len(events) - FEW} more (solution.condyle.events)")
    listed = ["events:", *lines] if lines else ["events: none"]

    def write() -> list[Path]:
        if log is None:
            return []
        sizes: dict[str, Any] = {f"{of}_noise": size for of, size in noise.items()}
        condyle.write_log(solution, log, **sizes)
        return [log]

    return solved(solution, output, [scenario, mechanism], listed, {"events": events}, write)


def _event_line(event: dict[str, Any]) -> str:
    from ..simulation.events import Event

    name = f"{event['kind']} {event['owner']}".rstrip()
    return f"  t = {event['time']:.4f} s: {name}{Event(**event).chatter}"


def _new(path: Path, mechanism: str) -> Answer:
    from ..simulation.first_scenario import STARTER

    if path.exists():
        raise InputError(f"{path} exists already; choose another name")
    write_text(path, STARTER)
    then = command_line("simulate", mechanism, scenario=path)
    return Answer(f"Wrote {path}", {"files": [path]}, then)
