"""Results do not depend on threads, chunks or the order of samples: bit for bit."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from condyle.errors import InputError
from condyle.kernels import compiled
from condyle.kernels.compiled import Kernel
from condyle.model import Model
from condyle.results import states
from condyle.results.states import solve_file
from support.cases import Case, case

Results = tuple[dict[str, np.ndarray], np.ndarray]


@pytest.fixture(scope="module", params=["masticatory", "masticatory-curved"])
def kernel(request: pytest.FixtureRequest) -> Kernel:
    c = case(request.param)
    return Model(c.mechanism, backend="compiled").kernel.kernel(c.point, ("contact",), True)


@pytest.fixture
def samples(kernel: Kernel, request: pytest.FixtureRequest) -> np.ndarray:
    """Some chunks and a piece, with samples beyond reach among them."""
    name = request.node.callspec.params["kernel"]
    many = case(name).repeated(2 * compiled.CHUNK + 1003).samples
    many[::97, 1] += 10.0
    many[5, 0] = np.nan
    return np.asfortranarray(many)


def same(got: Results, wanted: Results) -> None:
    np.testing.assert_array_equal(got[1], wanted[1])
    for name, values in wanted[0].items():
        np.testing.assert_array_equal(got[0][name], values, err_msg=name)


def test_threads(kernel: Kernel, samples: np.ndarray) -> None:
    alone = kernel.run(samples, threads=1)
    assert 0 in alone[1] and alone[1].any()
    for threads in (2, 3, None):
        same(kernel.run(samples, threads=threads), alone)


@pytest.mark.parametrize("threads", [0, -1])
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_fewer_than_one_thread(backend: str, threads: int) -> None:
    c = case("masticatory")
    model = Model(c.mechanism, backend=backend)
    for call in (model.evaluate, model.torques):
        with pytest.raises(InputError, match=f"threads is {threads}; expected 1 or more"):
            call(*c.arguments, threads=threads)


def test_chunks(kernel: Kernel, samples: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = kernel.run(samples, threads=1)
    for size in (1, 7, 8, 1000):
        few = samples[: 50 * size]
        monkeypatch.setattr(compiled, "CHUNK", size)
        names = {name: values[: len(few)] for name, values in whole[0].items()}
        same(kernel.run(few, threads=2), (names, whole[1][: len(few)]))


def test_order(kernel: Kernel, samples: np.ndarray) -> None:
    order = np.random.default_rng(0).permutation(len(samples))
    values, status = kernel.run(samples)
    same(kernel.run(samples[order]), ({k: v[order] for k, v in values.items()}, status[order]))


def test_callers_in_parallel(kernel: Kernel, samples: np.ndarray) -> None:
    """One kernel, many callers: it keeps nothing between calls."""
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
    first, second = (Model(m, backend="compiled").kernel for m in (c.mechanism, heavy))
    before = first.solve(*c.arguments, outputs=("contact",))
    other = second.solve(*c.arguments, outputs=("contact",))
    after = first.solve(*c.arguments, outputs=("contact",))
    np.testing.assert_array_equal(before.torque, after.torque)
    assert np.abs(before.torque - other.torque).max() > 1e-3
    assert (
        second.kernel(c.point, ("contact",), True).facts["sha256"]
        == (first.kernel(c.point, ("contact",), True).facts["sha256"])
    )


def test_rows_of_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However a file is cut: also where only some of its rows have moments."""
    c = case("masticatory").repeated(300)
    load = c.load.copy()
    load[100:, 3:6] = 0.0
    path = write(tmp_path / "states.csv", Case(c.mechanism, c.q, c.q1, c.q2, load))
    model = Model(c.mechanism, backend="compiled")
    texts = []
    for rows in (65536, 100, 33):
        monkeypatch.setattr(states, "CHUNK_ROWS", rows)
        solve_file(model, path, tmp_path / "out.csv")
        texts.append((tmp_path / "out.csv").read_text())
    assert texts[1] == texts[0] and texts[2] == texts[0]


def write(path: Path, c: Case) -> Path:
    """A states file."""
    names = Model(c.mechanism, backend="numpy").independent
    head = [p + name for p in ("", "d", "dd") for name in names]
    head += ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    lines = [",".join(head), *(",".join(map(repr, row)) for row in c.samples.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
