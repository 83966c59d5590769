"""Exported C, built with the kernels' flags, so that it can be timed beside them."""

from __future__ import annotations

import ctypes
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from condyle.backends.compiler import find_compiler
from condyle.export import Exported, export
from condyle.mechanism.mechanism import Mechanism

from .own import Case, Timer
from .rows import Probe

PORTABLE, WIDE = "exported C", "exported C with vector types"
FEW = 64  # samples that are compared
MOST = 64  # results
ADAPTER = """
int one(const double *table, const double *in, double *out);
int one(const double *table, const double *in, double *out) {{
    (void)table;
    return {call};
}}
"""


def exported_probes(mechanism: Mechanism) -> Iterator[Probe]:
    """Efforts by exported C: portable, and with vector types."""
    compiler, timer, case = find_compiler(), Timer(), Case.of(mechanism)
    made = export(mechanism, ("inverse",), lanes=compiler.lanes)
    folder = Path(tempfile.mkdtemp(prefix="condyle-bench-"))
    (folder / f"{made.prefix}.h").write_text(made.header, encoding="utf-8")
    samples = np.vstack([case.columns, np.zeros((8, case.columns.shape[1]))])
    for name, define in ((PORTABLE, ""), (WIDE, f"#define {made.prefix.upper()}_VECTOR\n")):
        source = folder / f"{'wide' if define else 'plain'}.c"
        text = define + made.source + ADAPTER.format(call=call(made))
        source.write_text(text, encoding="utf-8")
        compiler.build(source.with_suffix(".so"), source)
        one = ctypes.CDLL(str(source.with_suffix(".so"))).one
        run = partial(_seconds, timer, one, samples, len(case.samples))
        yield Probe(f"{mechanism.name} {name}", run, _error(one, samples, case.right[:FEW]))


def _seconds(timer: Timer, one: Any, samples: np.ndarray, count: int) -> float:
    """An evaluation, each waiting for the one before."""
    mine, out = samples.copy(), np.zeros(MOST)  # each moves the next sample a little
    width = ctypes.c_size_t(samples.shape[1])
    return timer.library.time_one(one, None, _at(mine), ctypes.c_size_t(count), width, _at(out), 1)


def _error(one: Any, samples: np.ndarray, right: np.ndarray) -> float:
    """Of the largest effort."""
    worst, out = 0.0, np.zeros(MOST)
    for sample, efforts in zip(samples, right, strict=False):
        one(None, _at(sample), _at(out))
        worst = max(worst, float(np.abs(out[: len(efforts)] - efforts).max()))
    return worst / float(np.abs(right).max())


def call(made: Exported, given: str = "in", found: str = "out") -> str:
    """A call of `inverse` on numbers in a row."""
    f, words, at = made["inverse"], [], 0
    for a in f.inputs:
        words.append(f"{given} + {at}")
        at += a.size
    return f"{f.name}({', '.join([*words, found])})"


def _at(a: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(a.ctypes.data)
