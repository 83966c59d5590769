"""condyle map: what a mechanism can do over its coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ..atomic import file_stem
from . import options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import can_draw, model_of

if TYPE_CHECKING:
    import xarray as xr

    from ..model.model import Model


@command(
    COMPUTE,
    example='condyle map jaw.toml --over "X=-5:5:200 mm" --over "beta=-5:20:200 deg" '
    "--quantity ratio --out maps",
    name="map",
)
def map_(
    mechanism: options.Mechanism = "masticatory",
    over: list[str] | None = None,
    hold: str = "",
    quantity: list[str] | None = None,
    load: str = "",
    load_point: options.LoadPoint = None,
    direction: str | None = None,
    stiffness: float | None = None,
    stroke: list[str] | None = None,
    margin: Annotated[float, options.option(min=0.0, max=1.0)] = 1e-3,
    distribution: options.Distribution = None,
    preload: options.Preload = 0.0,
    out: Path = Path("maps"),
    figures: bool = True,
    run: Path | None = None,
    backend: options.Backend = "auto",
    threads: options.Threads = None,
    workers: Annotated[
        int | None,
        options.option("Number of workers of --scheduler. Default: all processors.", min=1),
    ] = None,
    scheduler: str | None = None,
) -> Answer:
    """Workspace map: reach, and efforts, loads, speeds and stiffness at rest.

    Over one, two or three independent coordinates: what limits the reach, singularities, volume of
    the reach, free space around home.

    Options:
        over: Coordinate to sweep, "X=-5:5:200 mm": from, to, number of points; repeat for two or
            three. Default: the first two, widely.
        hold: Values of the other coordinates, "Y=1 mm,alpha=2 deg". Default: 0, which is home.
        quantity: Quantity to map: reachable, pose, bounds, joint, ratio, condition, transmission,
            effort, contact_force, load_limit, speed, stiffness; repeat for more, or separate by
            commas. Default: ratio.
        load: Static load on the platform, "Fz=-50 N,My=2 N m".
        direction: Direction in {S} of the further load of load_limit: 0,0,-1.
        stiffness: Stiffness of every actuator (N m/rad or N/m), for the quantity stiffness.
        stroke: Range of joint coordinates that counts as reach, "leg_*=-200:300 mm".
        out: Folder for the results.
        figures: Draw the maps.
        run: Results (.nc) whose motion is drawn on the maps.
        scheduler: Where blocks are computed, as for sweep: processes, threads, or the address of a
            Dask scheduler. Default: this process. The same numbers.
        margin: Smallest singularity ratio allowed in ball and box.
    """
    figures = can_draw(figures)
    import condyle

    from ..report.map_text import size_text

    solution = condyle.open_solution(run) if run is not None else None
    chosen_by = options.DistributionOptions(distribution, preload)
    model = model_of(mechanism, options.ModelOptions(backend=backend), chosen_by)
    machine = model.mechanism
    found = condyle.workspace_map(
        model,
        over,
        quantity or "ratio",
        hold,
        load,
        load_point,
        direction,
        stiffness,
        stroke or (),
        out=out / f"{file_stem(machine.name)}-map.nc",
        threads=threads,
        workers=workers,
        scheduler=scheduler,
    )
    size = condyle.workspace_size(found, margin, model)
    file = Path(found.encoding["source"])
    files = [file, *(_draw(found, model, file, solution) if figures else [])]
    axes = {str(name): found[name].values for name in found["status"].dims}
    data = {
        "mechanism": machine.name,
        "axes": {n: {"low": v[0], "high": v[-1], "count": len(v)} for n, v in axes.items()},
        "quantities": [name for one in quantity or ["ratio"] for name in one.split(",")],
        **size.data,
        "files": files,
    }
    then = command_line("view", map=file) if len(axes) > 1 else command_line("check", mechanism)
    return Answer(f"{size_text(size)}\n\n{files_line(files)}", data, then)


def _draw(found: xr.Dataset, model: Model, file: Path, solution: xr.Dataset | None) -> list[Path]:
    from ..report.figures import save
    from ..report.figures.map_figures import map_plots

    plots, files = map_plots(found, model), []
    for name in plots:
        files += save(getattr(plots, name)(solution), file.parent, f"{file.stem}-{name}")
    return files
