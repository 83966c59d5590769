"""Results do not depend on threads, chunks or the order of samples: bit for bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.cases import case

from condyle.backends import numpy_kernel as numpy
from condyle.backends.c import compiled_kernel as compiled
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.kernel import KernelValues
from condyle.backends.threads import shared_out
from condyle.errors import InputError
from condyle.model.model import Model
from condyle.results import row_stream
from condyle.results.inverse_rows import solve_states

Inputs = dict[str, np.ndarray]


def inputs_of(name: str, count: int) -> Inputs:
    """With samples beyond reach among them."""
    many = case(name).repeated(count)
    many.q[::97, 1] += 10.0
    many.q[5, 0] = np.nan
    return {name: np.asfortranarray(a) for name, a in many.inputs.items()}


def part(inputs: Inputs, rows: object) -> Inputs:
    return {name: a[rows] for name, a in inputs.items()}


def require_same(got: KernelValues, wanted: KernelValues, rows: object = slice(None)) -> None:
    np.testing.assert_array_equal(got.status, wanted.status[rows])
    for name, values in wanted.values.items():
        np.testing.assert_array_equal(got.values[name], values[..., rows], err_msg=name)


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved"])
@pytest.mark.usefixtures("compiler_command")
def test_a_batch_is_its_samples(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In any number of threads, cut anywhere, in any order, and with many callers: a kernel keeps
    nothing between calls."""
    kernel: CompiledKernel = Model(case(name).mechanism, backend="compiled").kernel(
        "inverse", ("contact",)
    )
    monkeypatch.setattr(compiled, "WORTH_A_THREAD", 500)
    samples = inputs_of(name, 3003)
    whole = kernel.run(samples, threads=1)
    assert 0 in whole.status and whole.status.any()
    for threads in (2, 3, None):
        require_same(kernel.run(samples, threads=threads), whole)
    order = np.random.default_rng(0).permutation(len(samples["q"]))
    for rows in (slice(0, 50), slice(7, 1000), slice(8, 9), slice(1, None, 7), order):
        require_same(kernel.run(part(samples, rows)), whole, rows)
    with ThreadPoolExecutor(4) as pool:
        for got in pool.map(lambda _: kernel.run(samples, threads=2), range(8)):
            require_same(got, whole)


def test_blocks_of_numpy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its results do not depend on how many samples it takes at a time."""
    kernel = Model(case("mixed_k2_n8").mechanism, backend="numpy").kernel("inverse", ("contact",))
    samples = inputs_of("mixed_k2_n8", 100)
    whole = kernel.run(samples)
    assert 0 in whole.status and whole.status.any()
    for size in (1, 7, 64):
        monkeypatch.setattr(numpy, "BLOCK", size)
        require_same(kernel.run(samples), whole)


@pytest.mark.usefixtures("compiler_command")
def test_fewer_than_one_thread() -> None:
    c = case("masticatory")
    for backend in ("compiled", "numpy"):
        model = Model(c.mechanism, backend=backend)
        for threads in (0, -1):
            with pytest.raises(InputError, match=f"threads: expected .*; got {threads}"):
                model.inverse_dynamics(*c.arguments, threads=threads)


def test_pieces() -> None:
    """Everything is done once, in pieces that start at multiples, however many hands there are.

    What fails in a thread is heard of.
    """
    for count in (0, 1, 63, 64, 65, 1000):
        for hands in (1, 2, 3, 7):
            pieces: list[tuple[int, int]] = []
            shared_out(lambda a, b, own=pieces: own.append((a, b)), count, hands, 64)
            pieces.sort()
            assert all(start % 64 == 0 for start, _ in pieces)
            done = [i for start, end in pieces for i in range(start, end)]
            assert done == list(range(count))

    def work(start: int, end: int) -> None:
        if start:
            raise ValueError(f"at {start}")

    with pytest.raises(ValueError, match="at "):
        shared_out(work, 1000, 3, 64)


@pytest.mark.usefixtures("compiler_command")
def test_models_do_not_disturb_each_other() -> None:
    """Two mechanisms in one library: their numbers are apart."""
    c = case("masticatory")
    heavy = c.mechanism.set({"platform.mass": 1.0})
    first, second = (Model(m, backend="compiled") for m in (c.mechanism, heavy))
    before, other, after = (m.inverse_dynamics(*c.arguments).effort for m in (first, second, first))
    np.testing.assert_array_equal(before, after)
    assert np.abs(before - other).max() > 1e-3
    mine, theirs = (m.kernel("inverse", ()).facts["sha256"] for m in (first, second))
    assert mine == theirs


@pytest.mark.usefixtures("compiler_command")
def test_rows_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However a file is cut: also where only some of its rows have moments."""
    c = case("masticatory").repeated(300)
    rows = c.samples[:, :-3].copy()
    rows[100:, -3:] = 0.0
    model = Model(c.mechanism, backend="compiled")
    head = [p + name for p in ("", "d", "dd") for name in model.independent]
    head += ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    path, out = tmp_path / "states.csv", tmp_path / "out.csv"
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=",".join(head), comments="")
    texts = []
    for size in (65536, 100, 33):
        monkeypatch.setattr(row_stream, "CHUNK_ROWS", size)
        solve_states(model, path, out)
        texts.append(out.read_text())
    assert texts[1] == texts[0] and texts[2] == texts[0]
