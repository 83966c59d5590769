"""condyle solve: its table, its digits, and rows that never influence each other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.loads import load_point_of
from support.machines import model as model_of

from condyle.backends.c import compiled_kernel as kernel
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.mechanism import COORDINATES
from condyle.motion import read_table

from .conftest import read_csv, write_csv

NAMES = ("X", "Y", "alpha", "beta")
LOAD = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
CALL = ("solve", "masticatory", "--states", "states.csv", "--out", "out.csv")
UNREACHED = "chain temporalis_left"


def header(names: Any = NAMES) -> list[str]:
    return [prefix + name for prefix in ("", "d", "dd") for name in names]


def draw(count: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1, 1, (count, 4)) * [0.002, 0.002, 0.05, 0.08]
    return q, rng.normal(0, 0.5, (count, 4)), rng.normal(0, 5, (count, 4))


@pytest.fixture
def solve(run: Any) -> Any:
    """Runs `condyle solve masticatory` on a table: outcome, columns and cells of its file."""

    def solve(columns: Any, rows: Any, *options: object) -> Any:
        write_csv("states.csv", columns, rows)
        outcome = run(*CALL, *options)
        assert outcome.status == 0, outcome.err
        return outcome, *read_csv("out.csv")

    return solve


def test_columns_and_digits(solve: Any) -> None:
    """Columns in the contract's order; every cell is the double that Python gets, in few digits."""
    model, (q, q1, q2) = model_of("masticatory"), draw(9)
    wrench = np.random.default_rng(1).normal(0, 5, (9, 6))
    outcome, columns, rows = solve([*header(), *LOAD], np.hstack([q, q1, q2, wrench]))
    assert outcome.out.startswith("9 rows solved: out.csv\n")
    chains, contacts = model.mechanism.chain_names, model.mechanism.contact_names
    heads = (("tau", chains), ("contact", contacts), ("", COORDINATES), ("joint", chains))
    assert columns == [f"{kind}_{name}".lstrip("_") for kind, names in heads for name in names]
    point = load_point_of(model, "right_molar")
    found = model.inverse_dynamics(q, q1, q2, wrench, point, outputs="all")
    parts = [found.effort, found.contact_force, found.pose, found.configuration.joint]
    wanted = np.hstack(parts)
    np.testing.assert_array_equal(np.array(rows, dtype=float), wanted)
    digits = [len(figures(cell)) for row in rows for cell in row]
    assert digits == [len(figures(repr(value))) for value in wanted.ravel().tolist()]


def figures(number: str) -> str:
    """Its significant digits."""
    return number.partition("e")[0].replace(".", "").strip("-0")


def test_rows_never_influence_each_other(solve: Any) -> None:
    """37 rows, some out of reach, some without a moment: in any order and alone the same text."""
    q, q1, q2 = draw(37, seed=3)
    q[[4, 11, 12, 30]] += [0.5, 0, 0, 0]
    load = np.random.default_rng(4).normal(0, 5, (37, 6))
    load[:20, 3:] = 0
    rows = np.hstack([q, q1, q2, load])

    def lines(order: Any) -> list[list[str]]:
        return solve([*header(("Y", "Z", "alpha", "beta")), *LOAD], rows[order], "--flag")[2]

    together = lines(slice(None))
    assert {row[-2] for row in together} == {"ok", "unreachable"}
    for order in (np.random.default_rng(0).permutation(37), [0], [5], [11]):
        assert lines(order) == [together[i] for i in order]


def test_any_valid_set_of_coordinates(solve: Any) -> None:
    """The same states in other coordinates, columns in any order: the same torques."""
    names = ("beta", "X", "gamma", "Y")
    found = model_of("masticatory").inverse_dynamics(*draw(12), outputs="all")
    columns = [COORDINATES.index(name) for name in names]
    poses = (found.pose, found.pose_rate, found.pose_acceleration)
    cells = np.hstack([a[:, columns] for a in poses])
    mix = np.random.default_rng(2).permutation(12)
    table = np.array(solve([header(names)[i] for i in mix], cells[:, mix])[2], dtype=float)
    effort = found.effort
    np.testing.assert_allclose(table[:, :6], effort, atol=1e-11 * np.abs(effort).max())
    np.testing.assert_allclose(table[:, 8:14], found.pose, atol=1e-13)


def test_flagged_rows_are_kept_and_empty(solve: Any, refused: Any) -> None:
    q, q1, q2 = draw(6)
    q[2, 0], q[4, 3] = 0.3, 1.5
    states = np.hstack([q, q1, q2])
    _, columns, rows = solve(header(), states, "--flag")
    assert columns[-2:] == ["status", "cause"] and len(columns) == 22 and len(rows) == 6
    assert [row[-2] for row in rows] == ["ok", "ok", "unreachable", "ok", "unreachable", "ok"]
    for i, row in enumerate(rows):
        assert all((cell == "") == (i in (2, 4)) for cell in row[:-2])
        assert row[-1] == (UNREACHED if i in (2, 4) else "")
    good = [i for i in range(6) if i not in (2, 4)]
    assert solve(header(), states[good])[2] == [rows[i][:-2] for i in good]
    Path("out.csv").unlink()
    write_csv("states.csv", header(), states)
    err = refused(*CALL, said='chain "temporalis_left" cannot reach M')
    assert "at row 3" in err and "scale it down" in err
    states[2, 0] = 10.0
    write_csv("states.csv", header(), states)
    refused(*CALL, said="Are the lengths of the motion in mm?")


def test_a_singular_row_has_its_own_status(run: Any, refused: Any) -> None:
    """Six level rods of a cube: none can turn the platform about the vertical at home."""
    head = 'name = "star"\n[platform]\nmass = 1.0\ninertia = { xx = 1e-4, yy = 1e-4, zz = 1e-4 }\n'
    parts = (
        "crank = { inertia = 1e-5 }\n"
        "coupler = { mass = 0.01, com = 0.5, transverse = 1e-6, axial = 1e-8 }\n"
    )
    for i in range(6):
        angle = np.pi / 3 * i
        out = np.array([np.cos(angle), np.sin(angle), 0])
        side = np.array([-out[1], out[0], 0])
        joint, tip = 0.05 * out, 0.12 * out + [0, 0, 0.03 * (-1) ** i]
        base = tip + 0.03 * (out * np.sin(0.3) + np.array([0, 0, np.cos(0.3)]))
        places = {"base": base, "axis": side, "crank_tip": tip, "platform": joint}
        text = "".join(f"{k} = {[float(x) for x in v]}\n" for k, v in places.items())
        head += f'[[chain]]\nname = "c{i}"\nkind = "RSS"\n{text}{parts}'
    Path("star.toml").write_text(head)
    states = np.zeros((3, 18))
    states[0, :6], states[2, 0] = [1e-3, 0, 0, 0.02, 0.03, 0.1], 0.5
    write_csv("states.csv", header(COORDINATES), states)
    call = ("solve", "star.toml", *CALL[2:])
    refused(*call, said="singular at row 2")
    assert run(*call, "--flag").status == 0
    rows = read_csv("out.csv")[1]
    assert [row[-2] for row in rows] == ["ok", "singular", "unreachable"]
    assert set(rows[1][:-2]) == {""} and "" not in rows[0][:-1]


def test_loads_are_optional_and_act_at_their_point(solve: Any) -> None:
    """A force at a point is the force at another and the moment between; moments have no point."""
    arm = np.subtract([25.2, -24.8, 9.89], [52.75, 0, 4.63]) / 1000
    force, incisor = np.array([3.0, -2.0, -40.0]), ("--load-point", "incisor")

    def torques(columns: tuple[str, ...], load: Any, *options: str) -> np.ndarray:
        rows = solve([*header(), *columns], [[0] * 12 + [*load]], *options)[2]
        return np.array(rows, dtype=float)[0, :8]

    at_molar = torques(LOAD[:3], force)
    assert (torques(LOAD[:3], force, "--load-point", "right_molar") == at_molar).all()
    shifted = torques(LOAD, [*force, *np.cross(arm, force)], *incisor)
    np.testing.assert_allclose(shifted, at_molar, atol=1e-12)
    assert np.abs(torques(LOAD[:3], force, *incisor) - at_molar).max() > 1e-2
    rest = torques((), [])
    both = torques(LOAD[3:], [0.1, 0.2, 0.3])
    assert (torques(LOAD[3:], [0.1, 0.2, 0.3], *incisor) == both).all()
    assert np.abs(both - rest).max() > 1e-2
    assert (torques(LOAD, [0.0] * 6) == rest).all()


def test_a_component_alone_and_columns_that_are_not_used(solve: Any) -> None:
    state, results = np.hstack(draw(2)), []
    for columns, load in ((LOAD[:3], [0, 0, -9]), (("fz [kN]", "t", "label"), [-0.009, 1, 2])):
        outcome, _, rows = solve([*header(), *columns], np.hstack([state, [load, load]]))
        results.append(np.array(rows, dtype=float))
    np.testing.assert_allclose(results[1], results[0], rtol=1e-12, atol=1e-15)
    assert 'states.csv: columns "t", "label" are not used' in outcome.err


def test_bounds_warn_and_strict_refuses(solve: Any, refused: Any) -> None:
    states = np.zeros((3, 12))
    states[1, 1], states[2, 1] = 0.0031, 0.004  # bounds end 3 mm to the side
    left = '"left_condyle" leaves its bounds in 2 rows, first in row 2, by up to 1 mm in row 3'
    assert left in solve(header(), states)[0].err
    refused(*CALL[:-1], "strict.csv", "--strict", said='"left_condyle" leaves its bounds')
    states[1:, 1] = 0.0029
    outcome = solve(header(), states, "--strict", "--quiet")[0]
    assert (outcome.out, outcome.err) == ("", "")


@pytest.mark.usefixtures("compiler_command")
def test_threads(run: Any, refused: Any, solve: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """--threads reaches the kernel, and the file is the same to the byte, with and without."""
    asked, real = [], CompiledKernel.run
    solve(header(), np.hstack(draw(50)))  # a new kernel is first held against numpy

    def spy(self: CompiledKernel, inputs: Any, threads: int | None = None, *more: Any) -> Any:
        if "effort" in (result.name for result in self.interface.results):
            asked.append(threads)
        return real(self, inputs, threads, *more)

    monkeypatch.setattr(CompiledKernel, "run", spy)
    monkeypatch.setattr(kernel, "WORTH_A_THREAD", 1000)
    texts = set()
    for options in ((), ("--threads", 1), ("--threads", 3)):
        solve(header(), np.hstack(draw(50)), *options)
        texts.add(Path("out.csv").read_bytes())
    assert len(texts) == 1 and asked == [None, 1, 3]
    for command in (CALL, ("run", "masticatory")):
        refused(*command, "--threads", 0, said="--threads")
    assert run("run", "--threads", 2, "--rate", 20).status == 0 and asked[3:] == [2]


def test_a_static_bite_in_two_lines(run: Any, refused: Any) -> None:
    """Numbers found independently with the same muscles, by sum of cubes."""
    Path("bite.csv").write_text("X,Y,alpha,beta,Fz\n0,0,0,0,-10\n0,0,0,0,-100\n")
    call = ("solve", "human-jaw", "--states", "bite.csv", "--out", "o.csv")
    outcome = run(*call, "--distribution", "cubic")
    assert outcome.status == 0 and "at rest" in outcome.err and outcome.err.count("\n") == 1
    assert "Greatest activation (of muscles; of others force over limit): 0.178, " in outcome.out
    assert " in row 2" in outcome.out and outcome.data["greatest_activation"]["row"] == 2
    joints = ["contact_left_condyle", "contact_right_condyle"]
    loads = read_table("o.csv").require(joints)[1]
    np.testing.assert_allclose(loads, [-25.2, -18.5], atol=0.05)
    assert run(*call, "--distribution", "cubic", "--load-point", "incisor").status == 0
    np.testing.assert_allclose(read_table("o.csv").require(joints)[1], [-92.9] * 2, atol=0.05)
    Path("bite.csv").write_text("X,Y,alpha,beta,dX\n0,0,0,0,0\n")  # a rate is no rest
    refused(*call, said='"dY", "dalpha", "dbeta" are missing')
