"""condyle map: what a mechanism can do over its coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ..extras import require
from . import completion, options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import chosen_model, file_stem, output_folder

if TYPE_CHECKING:
    import xarray as xr

    from ..analysis.map.axes import Grid
    from ..analysis.map.block import Asked

LARGE = 200_000_000  # bytes above which auto streams to Zarr


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
    load_point: str | None = None,
    direction: str | None = None,
    stiffness: float | None = None,
    stroke: list[str] | None = None,
    margin: float = 1e-3,
    distribution: str | None = None,
    preload: float = 0.0,
    out: Path = Path("maps"),
    format: str = "auto",
    figures: bool = True,
    run: Path | None = None,
    backend: str = "auto",
    threads: int | None = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="With --scheduler: so many. Default: all processors.")
    ] = None,
    scheduler: str | None = None,
) -> Answer:
    """Where a mechanism can go, and what it can do there at rest.

    Over one, two or three independent coordinates: reach and what forbids it, singularities,
    efforts, loads, speeds, stiffness; how large the reach is, and how much room is around home.

    Options:
        over: Coordinate to go over, "X=-5:5:200 mm": from, to, how many; one to three. Default: the
            first two, widely.
        hold: The others, "Y=1 mm,alpha=2 deg". Default: 0, which is home.
        load: On the platform at rest, "Fz=-50 N,My=2 N m".
        direction: Of the further load for load_limit, in {S}: 0,0,-1.
        stiffness: Of every actuator (N m/rad or N/m), for that quantity.
        stroke: Range of joint coordinates that counts as reach, "leg_*=-200:300 mm".
        out: Folder for the results.
        format: netcdf; zarr (a folder, streamed: for more than memory holds); or auto, by size.
        figures: Draw the pictures too.
        run: Results (.nc) whose motion is drawn on top.
        scheduler: Who computes, as for sweep: processes, threads, dask, or the address of a Dask
            scheduler. Default: this process. Same numbers.
        margin: Least singularity ratio in ball and box.
    """
    if figures:
        require("matplotlib", "figures")
    if format not in completion.FORMATS:
        raise InputError(f'no format "{format}"; expected {", ".join(completion.FORMATS)}')
    import condyle

    from ..analysis.map.axes import grid_of
    from ..analysis.map.compute import asked_of, mapped, size_of
    from ..analysis.map.extent import numbers_of
    from ..analysis.map.map_files import save_map
    from ..analysis.map.map_quantities import chosen
    from ..analysis.workers import check_scheduler
    from ..report.map_text import numbers_text

    machine = condyle.load_mechanism(mechanism)
    grid = grid_of(machine, over or default_over(machine), hold)
    names = tuple(part.strip() for one in quantity or ["ratio"] for part in one.split(","))
    model = chosen_model(machine, "virtual_power", "core", backend, distribution, preload, 0.0)
    asked = asked_of(model, load, load_point, direction, stiffness, stroke or (), threads)
    quantities = chosen(names, asked)
    if scheduler is not None:
        check_scheduler(workers, scheduler)
    path = _run_path(run, grid) if run is not None else None
    streamed = format == "zarr" or (format == "auto" and size_of(asked, grid, quantities) > LARGE)
    if streamed:
        require("zarr", "maps")
    stem = output_folder(out) / f"{file_stem(machine.name)}-map"
    file = stem.with_suffix(".zarr" if streamed else ".nc")
    dataset = mapped(asked, grid, quantities, file if streamed else None, workers, scheduler)
    if not streamed:
        save_map(dataset, file)
    numbers = numbers_of(asked, grid, margin)
    files = [file]
    if figures:
        files += _draw(asked, grid, dataset, stem, path)
    data = {
        "mechanism": machine.name,
        "axes": {a.name: {"low": a.low, "high": a.high, "count": a.count} for a in grid.axes},
        "quantities": list(names),
        **numbers.data,
        "files": files,
    }
    text = f"{numbers_text(numbers)}\n\n{files_line(files)}"
    turned = len(grid.axes) > 1
    then = command_line("view", map=file) if turned else command_line("check", mechanism)
    return Answer(text, data, then)


def default_over(machine: Any) -> list[str]:
    """The first two coordinates, a characteristic length or a radian about home."""
    from ..mechanism.home import characteristic_length, independent_coordinates

    length, names = characteristic_length(machine), independent_coordinates(machine)
    spans = {name: (length / 2 if name in "XYZ" else 0.5) for name in names[:2]}
    return [f"{name}={-span!r}:{span!r}:100" for name, span in spans.items()]


def _run_path(run: Path, grid: Grid) -> Any:
    """The motion of a run along the axes, (N, d)."""
    import condyle

    pose = condyle.open_solution(run)["pose"]
    return pose.sel(coordinate=[axis.name for axis in grid.axes]).values


def _draw(asked: Asked, grid: Grid, dataset: xr.Dataset, stem: Path, path: Any) -> list[Path]:
    from ..analysis.map.lines import slices_of
    from ..report.figures import save
    from ..report.figures.map_figures import drawn, map_figure

    slices = list(slices_of(asked.reach, grid))
    files = []
    for name in drawn(dataset):
        figure = map_figure(dataset, name, slices, path)
        files += save(figure, stem.parent, f"{stem.name}-{'reach' if name == 'cause' else name}")
    return files
