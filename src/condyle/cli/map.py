"""condyle map: what a mechanism can do over its coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from ..extras import require
from . import completion, options
from .answer import Answer, command_line, files_line
from .command import COMPUTE, command
from .inputs import chosen_model, file_stem

if TYPE_CHECKING:
    import xarray as xr

    from ..model.model import Model

SUFFIXES = {"auto": "", "netcdf": ".nc", "zarr": ".zarr"}


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
    if format not in SUFFIXES:
        raise InputError(f'no format "{format}"; expected {", ".join(completion.FORMATS)}')
    import condyle

    from ..report.map_text import size_text

    solution = condyle.open_solution(run) if run is not None else None
    machine = condyle.load_mechanism(mechanism)
    model = chosen_model(machine, "virtual_power", "core", backend, distribution, preload, 0.0)
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
        out=out / f"{file_stem(machine.name)}-map{SUFFIXES[format]}",
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
    from ..analysis.map.lines import slices_of
    from ..report.figures import save
    from ..report.figures.map_figures import drawn, map_figure

    slices, path = list(slices_of(found, model)), None
    if solution is not None:
        path = solution["pose"].sel(coordinate=list(found["status"].dims)).values
    files = []
    for name in drawn(found):
        figure = map_figure(found, name, slices, path)
        files += save(figure, file.parent, f"{file.stem}-{'reach' if name == 'cause' else name}")
    return files
