"""From MuJoCo's world to a mechanism file: there and back, a foreign platform, and clear noes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.rotations import bryant
from pydantic import BaseModel
from support.mujoco_player import Player

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.export import mjcf_graph
from condyle.export.mjcf_import import from_mjcf

TEMPLATE = Path(__file__).with_name("stewart.xml")
LENGTH = 0.5  # of a leg's two capsules


def same(a: Any, b: Any, place: str = "") -> None:
    """Two mechanisms agree in every number, but for the bounds, which MuJoCo does not have."""
    if isinstance(a, BaseModel):
        for key in type(a).model_fields:
            if key not in ("bounds", "axis", "smoothing_speed"):
                same(getattr(a, key), getattr(b, key), f"{place}.{key}")
    elif isinstance(a, dict) or hasattr(a, "items"):
        assert a.keys() == b.keys(), place
        for key in a:
            same(a[key], b[key], f"{place}.{key}")
    elif isinstance(a, tuple):
        assert len(a) == len(b), place
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            same(x, y, f"{place}[{i}]")
    elif isinstance(a, float):
        assert a == pytest.approx(b, rel=1e-9, abs=1e-11), place
    else:
        assert a == b, place


@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide", "masticatory", "human-jaw"])
def test_there_and_back(name: str, tmp_path: Path) -> None:
    """Every family, and losses of an actuator; and surfaces without an equivalent are refused."""
    mechanism = condyle.load_mechanism(name)
    if name == "masticatory":
        losses = {"rotor_inertia": 1e-4, "viscous": 0.004, "coulomb": 0.03}
        changes = {"torque_limit": (-1.0, 3.0), **losses}.items()
        mechanism = mechanism.set({f"chain.masseter_left.actuator.{k}": v for k, v in changes})
        condyle.export_mjcf("masticatory-curved", tmp_path / "curved.xml")
        with pytest.raises(UnsupportedError, match="take the mechanism's own file"):
            from_mjcf(tmp_path / "curved.xml", name)
    condyle.export_mjcf(mechanism, tmp_path / "m.xml")
    found = from_mjcf(tmp_path / "m.xml", name)
    same(mechanism.replace(vocabulary=None), found.mechanism)  # MJCF has no place for it
    assert not found.notes
    for ours, theirs in zip(mechanism.chains, found.mechanism.chains, strict=True):
        if ours.kind in ("RSS", "PSS"):  # a shaft comes back square to its crank
            axes = [np.array(c.axis) / np.linalg.norm(c.axis) for c in (ours, theirs)]
            np.testing.assert_allclose(*axes, rtol=0, atol=1e-2)


def stewart(folder: Path, carried: bool = True, **changes: str) -> Path:
    """A foreign platform; `carried`: by a ball joint on its first leg."""
    angles = np.radians([5, 55, 125, 175, 245, 295])
    tops = np.radians([-10, 70, 110, 190, 230, 310])
    base = np.column_stack([0.5 * np.cos(angles), 0.5 * np.sin(angles), 0.05 + 0 * angles])
    top = np.column_stack([0.25 * np.cos(tops), 0.25 * np.sin(tops), 0.75 + 0 * tops])
    plate = (
        '<geom type="box" size="0.2 0.15 0.03" density="800" pos="0.01 0 0.02"/>'
        '<site name="tool" pos="0 0 0.1"/>'
    )
    platform = f'<body name="plate" pos="0 0 0.85"><freejoint/>{plate}</body>'
    legs, connects, drives = "", "", ""
    for i, (b, t) in enumerate(zip(base, top, strict=True)):
        x, y, z = (t - b) / np.linalg.norm(t - b)
        tilt = np.degrees([np.arctan2(-y, z), np.arcsin(x), 0.0])  # Rx Ry take Z onto the leg
        assert np.allclose(bryant(np.radians(tilt)) @ [0, 0, 1], [x, y, z])
        ends = _text([0, 0, np.linalg.norm(t - b)])
        hung = ""
        if i == 0 and carried:
            R = bryant(np.radians(tilt)).T
            turned = _text(np.degrees(_bryant(R)))
            at = R @ (np.array([0, 0, 0.75]) - b)
            hung = (
                f'<body name="plate" pos="{_text(at)}" euler="{turned}">'
                f'<joint type="ball" pos="{_text(t - [0, 0, 0.75])}"/>{plate}</body>'
            )
        legs += f"""<body pos="{_text(b)}" euler="{_text(tilt)}" childclass="leg">
          <joint name="u{i}" axis="1 0 0"/><geom size="0.01" fromto="0 0 0 0 0 0.02"/>
          <body name="tube{i}"><joint axis="0 1 0" name="v{i}"/>
            <geom size="0.02" fromto="0 0 0.1 0 0 {LENGTH}"/>
            <body name="bar{i}"><joint name="leg{i}" class="drive"/>
              <geom size="0.012" fromto="0 0 0.3 0 0 0.7"/>
              <site name="end{i}" pos="{ends}"/>{hung}
            </body></body></body>"""
        if not hung:
            connects += f'<connect body1="bar{i}" body2="plate" anchor="{ends}"/>'
        drives += f'<position name="servo{i}" joint="leg{i}" class="drive"/>'
    text, own = TEMPLATE.read_text(), {"LEGS": legs, "PLATFORM": "" if carried else platform}
    for key, value in (own | {"CONNECTS": connects, "DRIVES": drives} | changes).items():
        text = text.replace(key, value)
    (folder / "stewart.xml").write_text(text)
    return folder / "stewart.xml"


def _text(values: Any) -> str:
    return " ".join(repr(float(v)) for v in values)


def _bryant(R: np.ndarray) -> np.ndarray:
    b = np.arcsin(R[0, 2])
    return np.array([np.arctan2(-R[1, 2], R[2, 2]), b, np.arctan2(-R[0, 1], R[0, 0])])


@pytest.mark.parametrize("carried", [False, True])
def test_a_foreign_stewart_platform(tmp_path: Path, carried: bool) -> None:
    """Its numbers follow from the drawing: bases, joints, limits, and weights at rest."""
    path = stewart(tmp_path, carried)
    m = from_mjcf(path, "six").mechanism
    assert [c.kind for c in m.chains] == ["SPS"] * 6 and not m.contacts
    assert m.chain_names == tuple(f"leg{i}" for i in range(6))
    com, turned = np.array([0.01, 0, 0.87]), np.radians(5)
    base = np.array([0.5 * np.cos(turned), 0.5 * np.sin(turned), 0.15])
    assert m.chains[0].base == pytest.approx(base - com)
    actuator = m.chains[2].actuator
    assert actuator.force_limit == (-400.0, 500.0) and actuator.reflected_inertia == 0.5
    assert (actuator.viscous, actuator.coulomb) == (3.0, 2.0)
    assert m.platform.points["tool"] == pytest.approx(np.array([0, 0, 0.95]) - com)
    player, zero = Player(path.read_text(), "plate"), np.zeros(6)
    player.equations()
    free = player.free()
    efforts = condyle.derive(m, backend="numpy").inverse_dynamics(zero, zero, zero).effort
    needed = free.T @ player.needed()
    at = [player.model.joint(f"leg{i}").dofadr[0] for i in range(6)]
    assert free.shape[1] == 6
    assert np.abs(free[at].T @ efforts - needed).max() <= 2e-3 * abs(needed).max()


def test_what_is_left_out_is_named(tmp_path: Path) -> None:
    path = stewart(tmp_path, carried=False)
    lossy = '<joint damping="0.1" armature="0.02"/>'
    text = path.read_text().replace('<joint damping="0"/>', lossy)
    text = text.replace('<joint name="u0"', '<joint name="u0" stiffness="5" range="-40 40"')
    path.write_text(text)
    notes = from_mjcf(path, "six").notes
    passive = ", ".join(f"u{i}, v{i}" for i in range(5))
    for said in (
        f"damping of joints that no actuator drives: left out, at {passive} and ",
        f"armature of joints that no actuator drives: left out, at {passive} and ",
        "springs of joints: left out, at u0",
        "ranges of joints: left out, at u0",
        "laws of actuators that are no plain motors: left out, at servo0, servo1,",
    ):
        assert any(note.startswith(said) for note in notes), (said, notes)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"CONNECTS": '<weld body1="bar1" body2="bar2"/>'}, "kind weld"),
        ({"CONNECTS": '<connect site1="end1" site2="tool"/>'}, "open at home, by"),
        ({"CONNECTS": ""}, "no body is held by 3"),
        ({"<mujoco": "<robot"}, "cannot read it"),
        (
            {'<joint axis="0 1 0" name="v1"/>': ""},
            r'"leg1".* hinge slide ball; expected ball slide',
        ),
    ],
)
def test_a_clear_no(tmp_path: Path, changes: dict[str, str], said: str) -> None:
    """Another chain is named with its joints."""
    path = stewart(tmp_path, "leg1" not in said, **changes)
    with pytest.raises((InputError, UnsupportedError), match=said):
        from_mjcf(path, "x")


def test_the_command(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    stewart(tmp_path)
    outcome = condyle_command("new", "six", "--from-mjcf", "stewart.xml")
    assert outcome.status == 0 and "symmetric" not in outcome.err, outcome.err
    assert condyle.load_mechanism(tmp_path / "six.toml").name == "six"
    refused = condyle_command("new", "six", "--from-mjcf", "missing.xml", "--force")
    assert refused.status == 2 and "missing.xml" in refused.err


def test_a_few_lines_that_stand_for_a_thousand_million_bodies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MuJoCo reads in a process of its own, with limits of time and memory."""
    path, body = tmp_path / "bomb.xml", '<geom size="1"/>'
    for _ in range(3):
        body = f'<replicate count="1000" offset="1 0 0">{body}</replicate>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    monkeypatch.setattr(mjcf_graph, "SECONDS", 2)
    with pytest.raises(InputError, match="MuJoCo"):
        from_mjcf(path, "bomb")
