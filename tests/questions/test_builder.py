"""What a question is written on, run by numpy and by C at every width, against sums by hand."""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from support.cases import case, ones

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.kernel import AGAIN, KernelValues
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.errors import InputError
from condyle.graph.program import Program, Programs
from condyle.questions.builder import Builder
from condyle.questions.file_numbers import numbers_of
from condyle.questions.numbers import INERTIA
from condyle.questions.structure import structure_of
from condyle.status import Status

MECHANISM = case("all_kinds").mechanism  # families interleaved, groups of 3, 3 and 2
STRUCTURE = structure_of(MECHANISM)
NUMBERS = numbers_of(STRUCTURE, MECHANISM)
KINDS = np.array([chain.kind for chain in MECHANISM.chains])
JOINTS = np.array([chain.platform for chain in MECHANISM.chains])
GRAVITY = np.array(MECHANISM.gravity)
GROUPS = range(len(STRUCTURE.chains))
N, n = 21, len(KINDS)


def question() -> Program:
    """Of every kind of port and output one."""
    b = Builder(STRUCTURE)
    x = b.sample("x", 2)
    y = b.lane_sample("y", 2)
    z = b.lane_sample("z")
    w = b.sample("w", 1)
    mask = [b.lane(g, "mask") for g in GROUPS]
    joint = [b.lane(g, "joint") for g in GROUPS]
    b.output("by_lane", [y[g] * x[0] + joint[g][0] for g in GROUPS], "")
    ragged = [None if kind == "PSS" else z[g] * x for g, kind in enumerate(STRUCTURE.families)]
    b.output("ragged", ragged, "N")
    one = [z[g] + 1 if kind == "PSS" else None for g, kind in enumerate(STRUCTURE.families)]
    b.output("one_family", one, "")
    b.output("matrices", [y[g] @ joint[g].T for g in GROUPS], "", 2, 3)
    b.output("same", [x[1] for _ in GROUPS], "")
    b.output("shared_matrix", x @ ca.horzcat(w, x[0], 1), "", 2, 3)
    b.output("total", b.total([mask[g] * ca.vertcat(y[g], 1) for g in GROUPS]), "")
    b.output("least", b.least([joint[g][1] * x[0] for g in GROUPS]), "")
    b.output("gravity", b.parameter("gravity") * w, "")
    b.check(x[0] + 10, 1.0, Status.unreachable)
    b.check(x[1], 0.0)
    return b.finish()


PROGRAM = question()
VARIANTS = Programs(PROGRAM, single=True)
RNG = np.random.default_rng(0)
SHAPES = {"x": (N, 2), "y": (N, 2, n), "z": (N, n), "w": (N, 1)}
INPUTS = {port: RNG.normal(0, 1, shape) for port, shape in SHAPES.items()}
INPUTS["x"][:4] = [[-10.0, 1], [-9.5, -1], [-20, -1], [np.nan, 1]]


def by_hand(inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Chains where the mechanism has them, samples last."""
    x, y, z, w = (inputs[name] for name in "xyzw")
    has, own = KINDS != "PSS", KINDS == "PSS"
    right = np.stack([w[:, 0], x[:, 0], np.ones(len(x))], axis=1)
    found = {
        "by_lane": y * x[:, :1, None] + JOINTS[:, 0],
        "ragged": z[:, None, has] * x[:, :, None],
        "one_family": z[:, own] + 1,
        "matrices": y[:, :, None] * JOINTS.T[None, None],
        "same": np.repeat(x[:, 1:], n, axis=1),
        "shared_matrix": x[:, :, None] * right[:, None],
        "total": np.column_stack([y.sum(axis=2), np.full(len(x), n)]),
        "least": np.minimum.reduce(JOINTS[:, 1] * x[:, :1], axis=1),
        "gravity": GRAVITY * w,
    }
    return {name: np.moveaxis(a, 0, -1) for name, a in found.items()}


def rows(inputs: dict[str, np.ndarray]) -> np.ndarray:
    """A row of columns a sample, lanes group by group."""
    order = list(NUMBERS.order)
    y, z = inputs["y"][:, :, order], inputs["z"][:, order]
    return np.hstack([inputs["x"], y.reshape(len(y), -1), z, inputs["w"]])


def check(answer: KernelValues) -> None:
    assert answer.status.tolist()[:4] == [AGAIN, AGAIN, Status.unreachable, AGAIN]
    wanted_status = np.where(INPUTS["x"][4:, 1] >= 0, 0, AGAIN)
    np.testing.assert_array_equal(answer.status[4:], wanted_status)
    wanted = by_hand(INPUTS)
    assert list(answer.values) == list(wanted)
    for name, value in wanted.items():
        got = answer.values[name][..., 4:]
        assert got.shape == value[..., 4:].shape, name
        np.testing.assert_allclose(got, value[..., 4:], rtol=1e-13, atol=1e-15, err_msg=name)


def test_numpy() -> None:
    check(NumpyKernel(VARIANTS, NUMBERS).run(INPUTS))


@pytest.mark.usefixtures("compiler_command")
def test_c(monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups that do not fill a vector, in a batch and in one evaluation."""
    for width in (2, 4, 8):
        monkeypatch.setenv("CONDYLE_LANES", str(width))
        assert any(count % width for count in STRUCTURE.counts)
        kernel = CompiledKernel("builder", lambda: VARIANTS, NUMBERS)
        check(kernel.run(INPUTS))
        check(KernelValues(*ones(kernel, rows(INPUTS))))


def test_ports() -> None:
    face = PROGRAM.interface
    assert [(p.name, p.size, p.lanes, p.start) for p in face.ports] == [
        ("x", 2, False, 0),
        ("y", 2, True, 2),
        ("z", 1, True, 2 + 2 * n),
        ("w", 1, False, 2 + 3 * n),
    ]
    assert (face.columns, face.lanes) == (3 + 3 * n, n)
    results = {r.name: r for r in face.results}
    assert results["ragged"].groups == tuple(g for g in GROUPS if STRUCTURE.families[g] != "PSS")
    assert face.width(results["ragged"]) == 2 * (KINDS != "PSS").sum()
    assert face.width(results["matrices"]) == 6 * n and face.width(results["shared_matrix"]) == 6
    assert results["ragged"].unit == "N" and results["least"].shape == ()


def test_arrays_that_do_not_fit_a_port() -> None:
    kernel = NumpyKernel(VARIANTS, NUMBERS)
    for port, shape, wanted in (("y", (N, n), f"N, 2, {n}"), ("z", (N, 2, n), f"N, {n}")):
        with pytest.raises(InputError, match=rf"{port}: expected an array of shape \({wanted}\)"):
            kernel.run({**INPUTS, port: np.zeros(shape)})


def run(build: Callable[[Builder], None], **inputs: np.ndarray) -> dict[str, np.ndarray]:
    b = Builder(STRUCTURE)
    build(b)
    return NumpyKernel(Programs(b.finish()), NUMBERS).run(inputs).values


def test_tangents_and_jacobians_go_through_totals() -> None:
    """f = (sum_i joint_i . x)^2 x: its slope by hand; and what is left where x_0 vanishes."""

    def build(b: Builder) -> None:
        x = b.sample("x", 3)
        inside = b.total([b.lane(g, "mask") * (b.lane(g, "joint").T @ x) for g in GROUPS])
        f = inside * inside * x
        b.output("J", b.jacobian(f, x), "", 3, 3)
        b.output("along", b.tangent(f, x, [1.0, -2.0, 0.5]), "")
        cut = b.cut(ca.sin(x))
        b.output("of_cut", b.jacobian(cut * cut[0], cut), "", 3, 3)
        b.output("at_zero", b.at_zero(ca.horzcat(f, x), x[:2]), "", 3, 2)

    x = RNG.normal(0, 1, (9, 3))
    found = run(build, x=x)
    s = JOINTS.sum(axis=0)
    for i, p in enumerate(x):
        J = (s @ p) ** 2 * np.eye(3) + 2 * (s @ p) * np.outer(p, s)
        np.testing.assert_allclose(found["J"][..., i], J, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(found["along"][:, i], J @ [1.0, -2.0, 0.5], rtol=1e-12)
        c = np.sin(p)
        own = c[0] * np.eye(3) + np.outer(c, [1.0, 0, 0])
        np.testing.assert_allclose(found["of_cut"][..., i], own, rtol=1e-12)
        rest = np.array([0, 0, p[2]])
        wanted = np.column_stack([(s @ rest) ** 2 * rest, rest])
        np.testing.assert_allclose(found["at_zero"][..., i], wanted, rtol=1e-12, atol=1e-15)


def test_parameters_are_the_mechanisms() -> None:
    def build(b: Builder) -> None:
        x = b.sample("x", 1)
        for name in ("mass", "inertia", "gravity", "length"):
            b.output(name, b.parameter(name) * x, "")

    found = run(build, x=np.ones((1, 1)))
    platform = MECHANISM.platform
    tensor = platform.inertia.tensor()
    assert found["mass"][0] == platform.mass
    np.testing.assert_array_equal(found["inertia"][:, 0], [tensor[i, j] for i, j in INERTIA])
    np.testing.assert_array_equal(found["gravity"][:, 0], GRAVITY)
