"""MuJoCo through its C interface: the shared library and headers of the `mujoco` wheel."""

from __future__ import annotations

import importlib.util
from importlib.metadata import distribution
from pathlib import Path

from .compiled import CompiledPeer
from .mechanism import Mechanism
from .mjcf import mjcf


class _MujocoC(CompiledPeer):
    packages = ("mujoco", "cmeel-eigen")
    couplers: str

    def _options(self) -> list[str]:
        spec = importlib.util.find_spec("mujoco")
        assert spec is not None and spec.submodule_search_locations
        wheel = Path(spec.submodule_search_locations[0])
        library = max(wheel.glob("libmujoco.so*"))
        eigen = distribution("cmeel-eigen").locate_file("cmeel.prefix/include/eigen3")
        include = [f"-isystem{path}" for path in (wheel / "include", eigen)]
        return [*include, str(library), f"-Wl,-rpath,{wheel}"]

    def _model(self, mechanism: Mechanism) -> str:
        return mjcf(mechanism, self.couplers)


class MujocoTree(_MujocoC):
    """The four calls that Newton-Euler on the whole cut tree needs."""

    title = "MuJoCo C, cut tree"
    source = "mujoco_tree.cpp"
    couplers = "tree"


class MujocoFree(_MujocoC):
    """The same calls on six free couplers, the rest by hand."""

    title = "MuJoCo C, free couplers"
    source = "mujoco_free.cpp"
    couplers = "free"
