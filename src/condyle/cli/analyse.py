"""What a mechanism can do: maps, the largest bite, models beside each other, published numbers."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import condyle

from ..errors import InputError, brief
from ..files.atomic import file_stem
from .answer import Answer, answer, command_line, files_line, warn
from .command import command
from .inputs import can_draw, drawn, require_drawing
from .options import (
    FOLDER,
    TABLE,
    DistributionOptions,
    ModelOptions,
    MotionOptions,
    OutputOptions,
    output_folder,
)


@command(
    'map jaw.toml --over "X=-5:5:200 mm" --over "beta=-5:20:200 deg" --quantity ratio --out maps',
    "analysis.map.compute:workspace_map",
    without="quantities",
)
def map_(
    mechanism: str = "masticatory",
    *,
    over: list[str] | None = None,
    quantity: list[str] | None = None,
    stroke: list[str] | None = None,
    margin: float = 1e-3,
    distribution: str | None = None,
    preload: float = 0.0,
    unilateral: str = "keep",
    out: Annotated[Path, FOLDER] = Path("maps"),
    figures: bool = True,
    run: Path | None = None,
    backend: str = "auto",
    **given: Any,
) -> Answer:
    """Workspace map: reach, and efforts, loads, speeds, stiffness and frequencies at rest.

    Over one, two or three independent coordinates: what limits the reach, singularities, volume of
    the reach, free space around home.

    Args:
        over: Coordinate to sweep, "X=-5:5:200 mm": from, to, number of points; repeat for two or
            three. Default: the first two, widely.
        quantity: Quantity to map: <names>; repeat for more, or separate by commas. Default:
            ratio.
        load: Static load on the platform, "Fz=-50 N,My=2 N m".
        margin: Smallest singularity ratio allowed in ball and box.
        figures: Draw the maps.
        run: Results (.nc) whose motion is drawn on the maps.
    """
    figures = can_draw(figures)
    from ..report.map_text import size_text

    solution = condyle.open_solution(run) if run is not None else None
    chosen_by = DistributionOptions(distribution, preload, unilateral=unilateral)
    model = ModelOptions(backend=backend).of(mechanism, chosen_by)
    machine = model.mechanism
    given |= {"stroke": stroke or (), "out": out / f"{file_stem(machine.name)}-map.nc"}
    grid = condyle.workspace_map(model, over, quantity or "ratio", **given)
    size = condyle.workspace_size(grid, margin, model)
    file = Path(grid.encoding["source"])
    files = [file]
    if figures:
        from ..report.figures.map_figures import map_plots

        files += drawn(map_plots(grid, model), file.with_suffix(""), solution)
    axes = {str(name): grid[name].values for name in grid["status"].dims}
    data = {
        "mechanism": machine.name,
        "axes": {n: {"low": v[0], "high": v[-1], "count": len(v)} for n, v in axes.items()},
        "quantities": [name for text in quantity or ["ratio"] for name in text.split(",")],
        **size.data,
        "files": files,
    }
    then = command_line("view", map=file) if len(axes) > 1 else ""
    return Answer(f"{size_text(size)}\n\n{files_line(files)}", data, then)


@command(
    "bite human-jaw --point right_molar --over opening=0:40:9",
    "analysis.bite:largest_bite",
    without="direction",
)
def bite(
    mechanism: str = "human-jaw",
    *,
    direction: list[str] | None = None,
    out: Annotated[Path | None, TABLE] = None,
    **given: Any,
) -> Answer:
    """Args:
    point: Platform point that bites, by name or as x,y,z in {M} (m); several, separated by ";",
        share the bite.
    direction: Direction of the force on the platform in {S}, "0,0,-1" (default: food pushes a
        jaw down); repeat it for an envelope.
    out: Also write a table (.csv or .parquet), a pose and direction per row.
    """
    directions = [_vector(text) for text in direction or ()] or (0.0, 0.0, -1.0)
    found = condyle.largest_bite(mechanism, direction=directions, **given)
    return answer(found, files=[], save=out)


def _vector(text: str) -> list[float]:
    with suppress(ValueError):
        x, y, z = (float(number) for number in text.split(","))
        return [x, y, z]
    raise InputError(f'direction: expected three numbers, such as "0,0,-1", got {brief(text)}')


@command("literature", "analysis.literature:literature")
def literature() -> Answer:
    return answer(condyle.literature())


@command("compare jaw.toml --motion path.csv --load bite.csv", "analysis.comparison:compare")
def compare(
    mechanism: str = "masticatory",
    *,
    motion: MotionOptions,
    distribution: DistributionOptions,
    tradeoff: bool = False,
    out: Annotated[Path, FOLDER] = Path("results"),
    figures: bool = True,
    report: bool = False,
) -> Answer:
    """Args:
    tradeoff: Sweep --contact-weight instead of comparing models: the curve between least effort
        and least contact force.
    figures: Draw Figures 5 to 9 of the paper.
    """
    require_drawing(False, report)
    figures = can_draw(figures)
    from ..motion import motion_and_load
    from ..results.report_table import with_tables

    machine = condyle.load_mechanism(mechanism)
    following = motion.arguments()
    load_point = following.pop("load_point")
    path, acting = motion_and_load(machine, **following)
    result: Any
    if tradeoff:
        named = distribution.distribution not in (None, "weighted")
        if named or distribution.contact_weight:
            raise InputError(
                "--tradeoff sweeps the weights of --distribution weighted itself: leave "
                "--distribution and --contact-weight out"
            )
        result = condyle.tradeoff(machine, path, acting, load_point, preload=distribution.preload)
    else:
        chosen = distribution.chosen()
        result = condyle.compare(machine, path, acting, load_point, distribution=chosen)
    warn([*path.warnings, *acting.warnings, *result.warnings])
    files = result.save(output_folder(out))
    solution, stem = with_tables(result.solution, result.report_tables), file_stem(machine.name)
    files.append(netcdf := out / f"{stem}-{'tradeoff' if tradeoff else 'compare'}.nc")
    solution.condyle.save(netcdf)
    if figures:
        from ..report.figures import save, save_figures
        from ..report.figures.tradeoff_figure import tradeoff_figure

        if tradeoff:
            files += save(tradeoff_figure(result), out, "tradeoff")
        else:
            files += save_figures(solution, result, out)
    if report:
        page = netcdf.with_suffix(".html") if tradeoff else out / f"{stem}.html"
        inputs = [file for file in (motion.motion, motion.load) if file is not None]
        files.append(condyle.write_report(solution, page, files=inputs))
    then = command_line("run", mechanism, motion, distribution, OutputOptions(out, report=True))
    if tradeoff:
        then = command_line("report", netcdf)
    elif report:  # the page is there already
        then = command_line("view", solution=netcdf)
    return Answer(f"{result}\n{files_line(files)}", result.data | {"files": files}, then)
