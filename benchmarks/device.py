"""The reference kernel on a graphics processor, where there is one: transfers apart."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from condyle.backends.cuda import TYPES, CudaKernel
from condyle.graph.program import Programs
from condyle.model.model import Model
from condyle.questions import Question
from condyle.questions.precision import rescaled

from .own import Case
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
