"""A table with its equation is all that a surface needs, from outside the package too."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from support.pages import module_of
from support.surfaces import close

import condyle
from condyle.errors import InputError, MechanismError
from condyle.export import export
from condyle.export.mjcf import export_mjcf
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.surface import SURFACES, Expression
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.structure import structure_of
from condyle.report.scene.patches import contact_patch

PLANE = '{ kind = "plane", slope = [-1.1, 0], offset = 13.215 }'
T = np.linspace(0.0, 1.0, 9)
SIZES = {"X": 3e-3, "Y": 1e-3, "alpha": 0.01, "beta": 0.05}
MOTION = condyle.Motion.from_arrays(
    T, {name: size * np.sin(2 * np.pi * T) for name, size in SIZES.items()}
)


@pytest.fixture(autouse=True)
def Wave() -> Iterator[Any]:
    yield module_of("surfaces.md", "Wave").Wave
    del SURFACES["wave"]


@pytest.fixture
def text(reference: Mechanism) -> str:
    """A file in millimetres whose left ball is on a wave."""
    x, _, z = (1e3 * value for value in reference.contacts[0].point)
    offset = z + 1.1 * x - 0.1 * math.sin(2 * math.pi * x / 100)
    wave = f'{{ kind = "wave", offset = {offset!r}, slope = -1.1 }}'
    file = Path(condyle.__file__).parent / "mechanism" / "bundled" / "masticatory.toml"
    return file.read_text().replace(PLANE, wave, 1)


def test_it_is_read_checked_described_and_written(
    Wave: Any, text: str, condyle_command: Any
) -> None:
    Path("waved.toml").write_text(text)
    machine = condyle.load_mechanism("waved.toml")
    assert machine.get("contact.left_condyle.surface.pitch") == 0.1
    assert isinstance(machine.contacts[0].surface, Wave) and parse(dumps(machine)) == machine
    assert condyle_command("check", "waved.toml").status == 0
    page = condyle_command("schema").out
    table = json.loads(page)["$defs"]["Wave"]["properties"]
    assert table["height"]["description"] == "of a crest over the plane" and "side" in table
    for wrong, hint in (('"wawe"', 'Did you mean "wave"'), ('"wave", hight = 1', '"height"')):
        with pytest.raises(MechanismError, match=hint):
            parse(text.replace('"wave"', wrong))
    with pytest.raises(InputError, match="expected the entry to be called 'wave'"):
        SURFACES["ripple"] = Wave


def test_efforts_are_those_of_the_same_equation(text: str, tmp_path: Path) -> None:
    """With and without a ball; a saved solution has the surface."""
    machine = parse(text)
    offset = machine.contacts[0].surface.offset
    same = Expression(lambda p: p[2] + 1.1 * p[0] - offset - 1e-4 * ca.sin(2 * ca.pi * p[0] / 0.1))
    in_python = machine.set("contact.left_condyle.surface", same)
    options = {"side": "below", "ball_radius": 4e-3, "one_sided": True}
    ball = {f"contact.left_condyle.{key}": value for key, value in options.items()}
    for changes in ({}, ball):
        own, wanted = (
            Model(m.set(changes, keep="home"), backend="numpy").solve(MOTION)
            for m in (machine, in_python)
        )
        close(own["effort"].values, wanted["effort"].values, 1e-11)
        own.condyle.save(tmp_path / "wave.nc")
        again = condyle.open_solution(tmp_path / "wave.nc").condyle.mechanism
        assert again == own.condyle.mechanism
    assert again.contacts[0].offset_surface.form == "parallel wave"
    for m in (machine, again):  # a name cannot stand for an equation that is not of this package
        assert Question.about(structure_of(m), "inverse").key is None


def test_its_numbers_vary_and_home_is_kept(text: str) -> None:
    """The offset follows; derivatives are those of rebuilt mechanisms."""
    machine = parse(text)
    path = "contact.left_condyle.surface.height"
    higher = machine.set(path, 2e-4, keep="home")
    assert higher.contacts[0].surface.offset != machine.contacts[0].surface.offset
    q = np.array([1e-3, 0, 0.01, 0.1])
    heights = [1e-4, 2e-4]
    model = Model(machine, backend="numpy")
    found = model.variants({path: heights}, keep="home").inverse_dynamics(q, 0 * q, 0 * q).effort
    for one, height in zip(found, heights, strict=True):
        wanted = Model(machine.set(path, height, keep="home"), backend="numpy").inverse_dynamics(
            q, 0 * q, 0 * q
        )
        close(one, wanted.effort, 1e-11)


def test_it_is_drawn_and_exported(text: str, tmp_path: Path) -> None:
    machine = parse(text)
    contact = machine.contacts[0]
    vertices = contact_patch(contact, np.array([contact.point]), 0.1).vertices
    off = [float(contact.surface.phi(p)) for p in vertices]
    assert len(off) > 100 and np.abs(off).max() < 1e-9
    header = export(machine, ("joints",), constants="struct").header
    assert "pitch" in header
    export_mjcf(machine, tmp_path / "wave.xml")
    assert "left_condyle" in (tmp_path / "wave.xml").read_text()
