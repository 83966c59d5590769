"""condyle solve: its table, its digits, and rows that never influence each other."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.loads import load_point_of

import condyle
from condyle.backends.c import compiled_kernel as kernel
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.mechanism import COORDINATES
from condyle.model.model import Model
from condyle.motion import read_table

NAMES = ("X", "Y", "alpha", "beta")
LOAD = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
CALL = ("solve", "masticatory", "--states", "states.csv", "--out", "out.csv")
Solve = Callable[..., tuple[Any, list[str], list[list[str]]]]


def header(names: tuple[str, ...] = NAMES) -> list[str]:
    return [prefix + name for prefix in ("", "d", "dd") for name in names]


def draw(count: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1, 1, (count, 4)) * [0.002, 0.002, 0.05, 0.08]
    return q, rng.normal(0, 0.5, (count, 4)), rng.normal(0, 5, (count, 4))


@pytest.fixture
def solve(
    condyle_command: Callable[..., Any],
    write_csv: Callable[..., Path],
    read_csv: Callable[..., Any],
) -> Solve:
    """Runs `condyle solve masticatory` on a table: outcome, columns and cells of its file."""

    def run(columns: Sequence[str], rows: np.ndarray, *options: object) -> tuple[Any, Any, Any]:
        write_csv(columns, rows, "states.csv")
        outcome = condyle_command(*CALL, *options)
        return outcome, *(read_csv("out.csv") if Path("out.csv").exists() else ([], []))

    return run


@pytest.fixture
def model(reference: condyle.Mechanism) -> Model:
    return condyle.derive(reference)


def test_columns_and_digits(solve: Solve, model: Model) -> None:
    """Columns in the contract's order; every cell is the double that Python gets, in few digits."""
    q, q1, q2 = draw(9)
    wrench = np.random.default_rng(1).normal(0, 5, (9, 6))
    outcome, columns, rows = solve([*header(), *LOAD], np.hstack([q, q1, q2, wrench]))
    assert outcome.status == 0 and outcome.out.startswith("9 rows solved: out.csv\n")
    chains, contacts = model.mechanism.chain_names, model.mechanism.contact_names
    assert columns == [
        *(f"tau_{name}" for name in chains),
        *(f"contact_{name}" for name in contacts),
        *COORDINATES,
        *(f"joint_{name}" for name in chains),
    ]
    found = model.inverse_dynamics(
        q, q1, q2, wrench, load_point_of(model, "right_molar"), outputs="all"
    )
    parts = [found.effort, found.contact_force, found.pose, found.configuration.joint]
    wanted = np.hstack(parts)
    np.testing.assert_array_equal(np.array(rows, dtype=float), wanted)
    digits = [len(figures(cell)) for row in rows for cell in row]
    assert digits == [len(figures(repr(value))) for value in wanted.ravel().tolist()]


def figures(number: str) -> str:
    """Its significant digits."""
    return number.partition("e")[0].replace(".", "").strip("-0")


@pytest.mark.parametrize("names", [NAMES, ("Y", "Z", "alpha", "beta")])
def test_rows_never_influence_each_other(solve: Solve, names: tuple[str, ...]) -> None:
    """37 rows, some out of reach, some without a moment: in any order and alone the same text."""
    q, q1, q2 = draw(37, seed=3)
    q[[4, 11, 12, 30]] += [0.5, 0, 0, 0]
    load = np.random.default_rng(4).normal(0, 5, (37, 6))
    load[:20, 3:] = 0
    rows = np.hstack([q, q1, q2, load])
    order = np.random.default_rng(0).permutation(37)

    def lines(rows: np.ndarray) -> list[list[str]]:
        outcome, _, cells = solve([*header(names), *LOAD], rows, "--flag")
        assert outcome.status == 0
        return cells

    together = lines(rows)
    assert {row[-2] for row in together} == {"ok", "unreachable"}
    assert lines(rows[order]) == [together[i] for i in order]
    for i in (0, 5, 11, 36):
        assert lines(rows[i : i + 1]) == [together[i]]


@pytest.mark.parametrize("names", [("Y", "Z", "alpha", "beta"), ("beta", "X", "gamma", "Y")])
def test_any_valid_set_of_coordinates(solve: Solve, model: Model, names: tuple[str, ...]) -> None:
    """The same states in other coordinates, columns in any order: the same torques."""
    q, q1, q2 = draw(12)
    found = model.inverse_dynamics(q, q1, q2, outputs="all")
    columns = [COORDINATES.index(name) for name in names]
    poses = (found.pose, found.pose_rate, found.pose_acceleration)
    cells = np.hstack([a[:, columns] for a in poses])
    mix = np.random.default_rng(2).permutation(12)
    outcome, _, rows = solve([header(names)[i] for i in mix], cells[:, mix])
    assert outcome.status == 0, outcome.err
    table = np.array(rows, dtype=float)
    effort = found.effort
    np.testing.assert_allclose(table[:, :6], effort, atol=1e-11 * np.abs(effort).max())
    np.testing.assert_allclose(table[:, 8:14], found.pose, atol=1e-13)


def test_flagged_rows_are_kept_and_empty(solve: Solve) -> None:
    q, q1, q2 = draw(6)
    q[2, 0], q[4, 3] = 0.3, 1.5
    states = np.hstack([q, q1, q2])
    outcome, columns, rows = solve(header(), states, "--flag")
    assert outcome.status == 0
    assert columns[-2:] == ["status", "cause"] and len(columns) == 22 and len(rows) == 6
    assert [row[-2] for row in rows] == ["ok", "ok", "unreachable", "ok", "unreachable", "ok"]
    for i, row in enumerate(rows):
        assert all((cell == "") == (i in (2, 4)) for cell in row[:-2])
        assert row[-1] == ("chain temporalis_left" if i in (2, 4) else "")
    Path("out.csv").unlink()
    outcome, _, _ = solve(header(), states)
    assert outcome.status == 2 and "at row 3" in outcome.err and not Path("out.csv").exists()
    assert 'chain "temporalis_left" cannot reach M' in outcome.err
    assert "scale it down" in outcome.err
    states[2, 0] = 10.0
    outcome, _, _ = solve(header(), states)
    assert "Are the lengths of the motion in mm?" in outcome.err
    good = [i for i in range(6) if i not in (2, 4)]
    for options, end in (((), -2), (("--flag",), None)):
        outcome, _, found = solve(header(), states[good], *options)
        assert outcome.status == 0 and found == [rows[i][:end] for i in good]


def test_a_singular_row_has_its_own_status(
    condyle_command: Callable[..., Any],
    write_csv: Callable[..., Path],
    read_csv: Callable[..., Any],
    tmp_path: Path,
) -> None:
    """Six level rods of a cube: none can turn the platform about the vertical at home."""
    chains = []
    for i in range(6):
        angle = np.pi / 3 * i
        out = np.array([np.cos(angle), np.sin(angle), 0])
        side = np.array([-out[1], out[0], 0])
        joint, tip = 0.05 * out, 0.12 * out + [0, 0, 0.03 * (-1) ** i]
        base = tip + 0.03 * (out * np.sin(0.3) + np.array([0, 0, np.cos(0.3)]))
        places = {"base": base, "axis": side, "crank_tip": tip, "platform": joint}
        text = "".join(f"{k} = {[float(x) for x in v]}\n" for k, v in places.items())
        coupler = "{ mass = 0.01, com = 0.5, transverse = 1e-6, axial = 1e-8 }"
        chains.append(
            f'[[chain]]\nname = "c{i}"\nkind = "RSS"\n{text}'
            f"crank = {{ inertia = 1e-5 }}\ncoupler = {coupler}\n"
        )
    inertia = "{ xx = 1e-4, yy = 1e-4, zz = 1e-4 }"
    head = f'name = "star"\n[platform]\nmass = 1.0\ninertia = {inertia}\n'
    (tmp_path / "star.toml").write_text(head + "".join(chains))
    states = np.zeros((3, 18))
    states[0, :6], states[2, 0] = [1e-3, 0, 0, 0.02, 0.03, 0.1], 0.5
    write_csv(header(COORDINATES), states, "states.csv")
    arguments = ("solve", "star.toml", "--states", "states.csv", "--out", "out.csv")
    assert condyle_command(*arguments, "--flag").status == 0
    rows = read_csv("out.csv")[1]
    assert [row[-2] for row in rows] == ["ok", "singular", "unreachable"]
    assert set(rows[1][:-2]) == {""} and "" not in rows[0][:-1]
    Path("out.csv").unlink()
    outcome = condyle_command(*arguments)
    assert outcome.status == 2 and "singular at row 2" in outcome.err
    assert not Path("out.csv").exists()


def test_loads_are_optional_and_act_at_their_point(solve: Solve) -> None:
    """A force at a point is the force at another and the moment between; moments have no point."""
    q, q1, q2 = np.zeros((3, 1, 4))
    arm = np.subtract([25.2, -24.8, 9.89], [52.75, 0, 4.63]) / 1000
    force = np.array([3.0, -2.0, -40.0])

    def torques(columns: tuple[str, ...], load: Any, *options: str) -> np.ndarray:
        states = np.hstack([q, q1, q2, [load]])
        outcome, _, rows = solve([*header(), *columns], states, *options)
        assert outcome.status == 0
        return np.array(rows, dtype=float)[0, :8]

    at_molar = torques(LOAD[:3], force)
    assert (torques(LOAD[:3], force, "--load-point", "right_molar") == at_molar).all()
    shifted = torques(LOAD, [*force, *np.cross(arm, force)], "--load-point", "incisor")
    np.testing.assert_allclose(shifted, at_molar, atol=1e-12)
    assert np.abs(torques(LOAD[:3], force, "--load-point", "incisor") - at_molar).max() > 1e-2
    rest = torques((), [])
    both = torques(LOAD[3:], [0.1, 0.2, 0.3])
    assert (torques(LOAD[3:], [0.1, 0.2, 0.3], "--load-point", "incisor") == both).all()
    assert np.abs(both - rest).max() > 1e-2
    assert (torques(LOAD, [0.0] * 6) == rest).all()


def test_a_component_alone_and_columns_that_are_not_used(solve: Solve) -> None:
    state = np.hstack(draw(2))
    results = []
    for columns, load in ((LOAD[:3], [0, 0, -9]), (("fz [kN]", "t", "label"), [-0.009, 1, 2])):
        outcome, _, rows = solve([*header(), *columns], np.hstack([state, [load, load]]))
        assert outcome.status == 0
        results.append(np.array(rows, dtype=float))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-12, atol=1e-15)
    assert 'states.csv: columns "t", "label" are not used' in outcome.err


def test_bounds_warn_and_strict_refuses(solve: Solve) -> None:
    states = np.zeros((3, 12))
    states[1, 1], states[2, 1] = 0.0031, 0.004  # bounds end 3 mm to the side
    outcome, _, _ = solve(header(), states)
    assert outcome.status == 0 and Path("out.csv").exists()
    assert (
        '"left_condyle" leaves its bounds in 2 rows, first in row 2, by up to 1 mm in row 3'
        in outcome.err
    )
    Path("out.csv").unlink()
    outcome, _, _ = solve(header(), states, "--strict")
    assert outcome.status == 2 and '"left_condyle" leaves its bounds' in outcome.err
    assert [path.name for path in Path().iterdir()] == ["states.csv"]
    states[1:, 1] = 0.0029
    outcome, _, _ = solve(header(), states, "--strict", "--quiet")
    assert (outcome.status, outcome.out, outcome.err) == (0, "", "")


@pytest.mark.usefixtures("compiler_command")
def test_threads(
    condyle_command: Callable[..., Any], solve: Solve, monkeypatch: pytest.MonkeyPatch
) -> None:
    """--threads reaches the kernel, and the file is the same to the byte, with and without."""
    asked = []
    real = CompiledKernel.run

    def spy(self: CompiledKernel, inputs: Any, threads: int | None = None) -> Any:
        if "effort" in (result.name for result in self.interface.results):
            asked.append(threads)
        return real(self, inputs, threads)

    monkeypatch.setattr(CompiledKernel, "run", spy)
    monkeypatch.setattr(kernel, "WORTH_A_THREAD", 1000)
    texts = []
    for options in ((), ("--threads", 1), ("--threads", 3)):
        assert solve(header(), np.hstack(draw(50)), *options)[0].status == 0
        texts.append(Path("out.csv").read_bytes())
    assert texts[1] == texts[0] and texts[2] == texts[0]
    assert asked == [None, 1, 3]
    for command in (CALL, ("run", "masticatory")):
        outcome = condyle_command(*command, "--threads", 0)
        assert outcome.status == 2 and "--threads" in outcome.err
    assert condyle_command("run", "--threads", 2).status == 0 and asked[3:] == [2]


def test_a_static_bite_in_two_lines(condyle_command: Callable[..., Any]) -> None:
    """Numbers found independently with the same muscles, by sum of cubes."""
    Path("bite.csv").write_text("X,Y,alpha,beta,Fz\n0,0,0,0,-10\n0,0,0,0,-100\n")
    call = ("solve", "human-jaw", "--states", "bite.csv", "--out", "o.csv")
    call += ("--distribution", "cubic")
    outcome = condyle_command(*call, "--backend", "numpy")
    assert outcome.status == 0 and "at rest" in outcome.err and outcome.err.count("\n") == 1
    assert "Greatest activation (effort over its limit): 0.178, " in outcome.out
    assert " in row 2" in outcome.out
    joints = ["contact_left_condyle", "contact_right_condyle"]
    loads = read_table("o.csv").require(joints)[1]
    np.testing.assert_allclose(loads, [-25.2, -18.5], atol=0.05)
    incisor = condyle_command(*call, "--load-point", "incisor", "--json")
    assert json.loads(incisor.out)["greatest_activation"]["row"] == 2
    np.testing.assert_allclose(read_table("o.csv").require(joints)[1], [-92.9] * 2, atol=0.05)


def test_rates_without_accelerations_are_no_rest(condyle_command: Callable[..., Any]) -> None:
    Path("s.csv").write_text("X,Y,alpha,beta,dX\n0,0,0,0,0\n")
    outcome = condyle_command("solve", "human-jaw", "--states", "s.csv", "--out", "o.csv")
    assert outcome.status == 2 and '"dY", "dalpha", "dbeta" are missing' in outcome.err
    assert not Path("o.csv").exists()
