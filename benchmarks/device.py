"""The reference kernel on a graphics processor, where there is one: transfers apart.

    python -m benchmarks.device

Also of every bundled machine the answers of `backend="cuda"`, arrays there and back, and numpy's.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

import numpy as np

from condyle.backends.cuda import TYPES, CudaKernel
from condyle.graph.program import Programs
from condyle.mechanism import load_mechanism
from condyle.mechanism.library import bundled_mechanisms
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.precision import rescaled

from .own import Case, reachable_samples
from .rows import Probe

COUNT = 1 << 22  # samples: enough to fill any processor
ERRORS = {"double": 1e-9, "float": 1e-2}


def device_probes(model: Model) -> Iterator[Probe]:
    """Efforts in double and float.

    Raises: MissingExtraError: without CuPy;  whatever CuPy raises without a device.
    """
    case = Case.of(model.mechanism)
    arrays = case.many(COUNT)
    ports = dict(zip(("q", "q1", "q2"), arrays, strict=False))
    ports |= {"force": arrays[3][:, :3], "moment": arrays[3][:, 3:], "point": arrays[4][:1]}
    for precision, tolerance in ERRORS.items():
        question = Question.about(model.system.structure, "inverse")
        main = rescaled(question.variants().main, question.name, precision)
        kernel = CudaKernel(Programs(main), model.system.numbers, precision)
        yield _probe(kernel, ports, case.right, precision, tolerance)


def _probe(
    kernel: CudaKernel,
    ports: dict[str, np.ndarray],
    right: np.ndarray,
    precision: str,
    tolerance: float,
) -> Probe:
    import cupy

    sent: dict[str, Any] = {
        name: cupy.asarray(ports[name], dtype=TYPES[precision], order="F") for name in ports
    }
    found = cupy.asnumpy(kernel.on_device(sent)[0]["effort"][:, : len(right)]).T
    error = float(np.abs(found - right).max() / np.abs(right).max())
    run = partial(_seconds, kernel, sent)
    return Probe(f"CUDA batch, {precision}", run, error, tolerance=tolerance)


def _seconds(kernel: CudaKernel, sent: dict[str, Any]) -> float:
    import cupy

    cupy.cuda.Device().synchronize()
    start = time.perf_counter()
    for _ in range(4):
        kernel.on_device(sent)
    cupy.cuda.Device().synchronize()
    return (time.perf_counter() - start) / (4 * COUNT)


def answers(name: str, count: int = 1000) -> Iterator[str]:
    """Lines of a bundled machine: a question, unequal statuses, the largest relative difference."""
    models = [Model(load_mechanism(name), backend=b) for b in ("numpy", "cuda")]
    m, n = models[0].mechanism.degrees_of_freedom, len(models[0].mechanism.chains)
    samples = reachable_samples(models[0], count)
    q, v, a = (samples[:, i * m : (i + 1) * m] for i in range(3))
    effort = np.random.default_rng(1).normal(0, 1, (count, n))
    asked: dict[str, Callable[[Model], Mapping[str, np.ndarray]]] = {
        "inverse_kinematics": lambda model: vars(model.inverse_kinematics(q)),
        "inverse_dynamics": lambda model: vars(model.inverse_dynamics(q, v, a)),
        "forward_dynamics": lambda model: vars(model.forward_dynamics(q, v, effort)),
        "mass_matrix": lambda model: {"mass": model.mass_matrix(q), "status": np.zeros(count)},
    }
    for question, ask in asked.items():
        expected, found = (ask(model) for model in models)
        good = (expected["status"] == 0) & (found["status"] == 0)
        unequal = int((expected["status"] != found["status"]).sum())
        largest = max(
            error(found[key][good], expected[key][good])
            for key in expected
            if isinstance(expected[key], np.ndarray) and key not in ("status", "bound")
        )
        yield f"{name:28} {question:20} {unequal:4} {largest:9.1e}"


def error(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference over the largest number."""
    if not expected.size:
        return 0.0
    return float(np.nanmax(np.abs(found - expected)) / (np.nanmax(np.abs(expected)) or 1.0))


def there_and_back(count: int = 1 << 20) -> float:
    """Seconds a sample of the reference mechanism's efforts, from numpy's arrays to numpy's."""
    model = Model("masticatory", backend="cuda")
    arguments = Case.of(model.mechanism).many(count)
    seconds = []
    for _ in range(9):
        start = time.perf_counter()
        model.inverse_dynamics(*arguments)
        seconds.append(time.perf_counter() - start)
    return sorted(seconds)[4] / count


def main() -> None:
    for name in bundled_mechanisms():
        for line in answers(name):
            print(line, flush=True)
    for probe in device_probes(Model("masticatory", backend="numpy")):
        seconds = sorted(probe.run() for _ in range(9))[4]
        print(f"{probe.name}: {seconds * 1e9:.4f} ns a sample, error {probe.error:.1e}", flush=True)
    print(f"there and back: {there_and_back() * 1e9:.1f} ns a sample")


if __name__ == "__main__":
    main()
