"""Without a package of an optional part, every public function that needs it names the extra."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import xarray as xr

import condyle
from condyle.errors import MissingExtraError
from condyle.motion import read_table
from condyle.report.answer_page import write_page

JAW = "masticatory"
EXAMPLES = Path(__file__).parents[2] / "examples"
# Package -> its extra, and calls that need it, given a solution.
NEEDS: dict[str, tuple[str, list[Callable[[xr.Dataset], Any]]]] = {
    "plotly": (
        "report",
        [
            lambda found: condyle.write_report(found, "a.html"),
            lambda found: condyle.measure_session("session.toml", "a"),
        ],
    ),
    "matplotlib": (
        "figures",
        [
            lambda found: found.condyle.plot.effort(),
            lambda found: condyle.video(found, "a.gif"),
            lambda found: condyle.measure_session("session.toml", "a"),
            lambda found: write_page(SimpleNamespace(kind="fit"), "a.html"),  # type: ignore[arg-type]
        ],
    ),
    "viser": ("view", [lambda found: condyle.serve_view(JAW)]),
    "imageio_ffmpeg": ("video", [lambda found: condyle.video(found, "a.mp4")]),
    "mujoco": ("mujoco", [lambda found: condyle.new_mechanism("a", from_mjcf="a.xml")]),
    "clarabel": ("identify", [lambda found: condyle.design(EXAMPLES / "design.toml")]),
    "distributed": (
        "cluster",
        [lambda found: condyle.workspace_map(JAW, ["X=-1:1:3 mm"], scheduler="tcp://127.0.0.1:9")],
    ),
    "mpmath": ("prove", [lambda found: condyle.run(JAW, prove=2)]),
    "mcap": (
        "mcap",
        [
            lambda found: condyle.write_log(found.isel(time=slice(0, 1)), "a.mcap"),
            lambda found: condyle.LogWriter("a.mcap", ["t"]),
            lambda found: read_table("a.xml.mcap"),
        ],
    ),
    "jax": ("jax", [lambda found: condyle.derive(JAW).to_jax()]),
    "torch": ("torch", [lambda found: condyle.derive(JAW).to_torch()]),
    "cupy": ("cuda", [lambda found: condyle.derive(JAW, backend="cuda")]),
}


@pytest.mark.parametrize("package", NEEDS)
def test_a_missing_package_is_named_with_its_extra(
    package: str, torn: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.xml").write_text("<mujoco/>")
    for name in [one for one in sys.modules if one.startswith("condyle.view")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    extra, calls = NEEDS[package]
    for call in calls:
        with pytest.raises(MissingExtraError, match=rf'pip install "condyle\[{extra}\]"') as caught:
            call(torn)
        assert (caught.value.package, caught.value.extra) == (package, extra)
    assert [path.name for path in Path().iterdir()] == ["a.xml"]
