"""Results do not depend on threads, chunks or the order of samples: bit for bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.cases import Case, case

from condyle.backends import numpy_kernel as numpy
from condyle.backends.c import compiled_kernel as compiled
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.kernel import Answer
from condyle.backends.threads import shared_out
from condyle.errors import InputError
from condyle.model.model import Model
from condyle.results import state_rows
from condyle.results.inverse_rows import solve_states


@pytest.fixture(scope="module", params=["masticatory", "masticatory-curved"])
def kernel(request: pytest.FixtureRequest) -> CompiledKernel:
    mechanism = case(request.param).mechanism
    return Model(mechanism, backend="compiled").kernel("inverse", ("contact",))


Inputs = dict[str, np.ndarray]


@pytest.fixture
def samples(request: pytest.FixtureRequest) -> Inputs:
    """So many that threads are worth while, with samples beyond reach among them."""
    many = case(request.node.callspec.params["kernel"]).repeated(9003)
    many.q[::97, 1] += 10.0
    many.q[5, 0] = np.nan
    return {name: np.asfortranarray(a) for name, a in many.inputs.items()}


def part(inputs: Inputs, rows: object) -> Inputs:
    return {name: a[rows] for name, a in inputs.items()}


def same(got: Answer, wanted: Answer, rows: object = slice(None)) -> None:
    np.testing.assert_array_equal(got.status, wanted.status[rows])
    for name, values in wanted.values.items():
        np.testing.assert_array_equal(got.values[name], values[..., rows], err_msg=name)


def test_threads(kernel: CompiledKernel, samples: Inputs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "WORTH_A_THREAD", 1000)
    alone = kernel.run(samples, threads=1)
    assert 0 in alone.status and alone.status.any()
    for threads in (2, 3, None):
        same(kernel.run(samples, threads=threads), alone)


@pytest.mark.parametrize("threads", [0, -1])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_fewer_than_one_thread(backend: str, threads: int) -> None:
    c = case("masticatory")
    model = Model(c.mechanism, backend=backend)
    with pytest.raises(InputError, match=f"threads: expected .*; got {threads}"):
        model.inverse_dynamics(*c.arguments, threads=threads)


def test_pieces() -> None:
    """Everything is done once, in pieces that start at multiples, however many hands there are."""
    for count in (0, 1, 63, 64, 65, 1000):
        for hands in (1, 2, 3, 7):
            pieces: list[tuple[int, int]] = []
            shared_out(lambda a, b, own=pieces: own.append((a, b)), count, hands, 64)
            pieces.sort()
            assert all(start % 64 == 0 for start, _ in pieces)
            done = [i for start, end in pieces for i in range(start, end)]
            assert done == list(range(count))


def test_what_fails_in_a_thread_is_heard_of() -> None:
    def work(start: int, end: int) -> None:
        if start:
            raise ValueError(f"at {start}")

    with pytest.raises(ValueError, match="at "):
        shared_out(work, 1000, 3, 64)


def test_cut_anywhere(kernel: CompiledKernel, samples: Inputs) -> None:
    whole = kernel.run(samples, threads=1)
    for rows in (slice(0, 50), slice(7, 1000), slice(8, 9), slice(1, None, 7)):
        same(kernel.run(part(samples, rows)), whole, rows)


def test_blocks_of_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its results do not depend on how many samples it takes at a time."""
    c = case("mixed_k2_n8").repeated(100)
    c.q[::9, 1] += 10.0
    kernel = Model(c.mechanism, backend="numpy").kernel("inverse", ("contact",))
    whole = kernel.run(c.inputs)
    assert 0 in whole.status and whole.status.any()
    for size in (1, 7, 64):
        monkeypatch.setattr(numpy, "BLOCK", size)
        same(kernel.run(c.inputs), whole)


def test_order(kernel: CompiledKernel, samples: Inputs) -> None:
    order = np.random.default_rng(0).permutation(len(samples["q"]))
    same(kernel.run(part(samples, order)), kernel.run(samples), order)


def test_callers_in_parallel(
    kernel: CompiledKernel, samples: Inputs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One kernel, many callers: it keeps nothing between calls."""
    monkeypatch.setattr(compiled, "WORTH_A_THREAD", 1000)
    wanted = kernel.run(samples, threads=1)
    with ThreadPoolExecutor(4) as pool:
        for got in pool.map(lambda _: kernel.run(samples, threads=2), range(8)):
            same(got, wanted)


def test_models_do_not_disturb_each_other() -> None:
    """Two mechanisms in one library: their numbers are apart."""
    c = case("masticatory")
    heavy = c.mechanism.model_copy(
        update={"platform": c.mechanism.platform.model_copy(update={"mass": 1.0})}
    )
    first, second = (Model(m, backend="compiled") for m in (c.mechanism, heavy))
    before, other, after = (m.inverse_dynamics(*c.arguments).effort for m in (first, second, first))
    np.testing.assert_array_equal(before, after)
    assert np.abs(before - other).max() > 1e-3
    mine, theirs = (m.kernel("inverse", ()).facts["sha256"] for m in (first, second))
    assert mine == theirs


def test_rows_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However a file is cut: also where only some of its rows have moments."""
    c = case("masticatory").repeated(300)
    load = c.load.copy()
    load[100:, 3:6] = 0.0
    path = write(tmp_path / "states.csv", Case(c.mechanism, c.q, c.q1, c.q2, load))
    model = Model(c.mechanism, backend="compiled")
    texts = []
    for rows in (65536, 100, 33):
        monkeypatch.setattr(state_rows, "CHUNK_ROWS", rows)
        solve_states(model, path, tmp_path / "out.csv")
        texts.append((tmp_path / "out.csv").read_text())
    assert texts[1] == texts[0] and texts[2] == texts[0]


def write(path: Path, c: Case) -> Path:
    """A states file."""
    names = Model(c.mechanism, backend="numpy").independent
    head = [p + name for p in ("", "d", "dd") for name in names]
    head += ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    lines = [",".join(head), *(",".join(map(repr, row)) for row in c.samples[:, :-3].tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
