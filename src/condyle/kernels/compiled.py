"""Compiled kernels: built from a spec, loaded with ctypes (which releases the GIL), run on arrays.

A spec's kernel serves every mechanism of its structure; a `Kernel` is one filled with a
mechanism's numbers.
"""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..backends import cache
from ..backends.compiler import REMEDY, Compiler, CompilerError, find_compiler
from ..backends.notice import notice
from ..backends.threads import workers
from ..dynamics import FORMULATIONS
from ..errors import InputError, UnsupportedError
from ..kinematics.contact import indices
from ..mechanism.home import independent_coordinates
from ..mechanism.mechanism import Mechanism
from ..progress import step
from ..questions.layout import Layout, specialise
from ..questions.spec import OUTPUTS, KernelSpec, kernel_spec
from .result import PoseRates, Torques

if TYPE_CHECKING:
    from .interpreted import Interpreted

CHUNK = 1024  # samples that are worth a thread
PIECES = 2  # that a thread takes one after another: few, since handing them out takes time
LOOK_AGAIN = 2  # status of samples that the interpreter has to decide

_doubles = ctypes.POINTER(ctypes.c_double)


class Kernel:
    """One mechanism's numbers in a compiled kernel.

    Attributes: outputs: name -> (first column, columns) of `run`'s results.
                facts:   flags, compiler, operation count, seconds of the build.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        formulation: str,
        route: str,
        load_point: np.ndarray,
        outputs: Sequence[str] = (),
        moment: bool = False,
    ) -> None:
        """Raises CompilerError where no kernel can be built."""
        compiler = find_compiler()
        spec = kernel_spec(mechanism, formulation, route, tuple(outputs), moment)
        layout = Layout.of(spec)
        parameters = layout.parameter_values(mechanism, load_point)
        lanes = layout.lane_values(mechanism, compiler.lanes)
        self.spec = specialise(spec, parameters, lanes)
        entry, self._library = _loaded(self.spec, compiler)
        self.facts, self.cached = entry.facts, entry.cached
        self._table = _aligned(self.facts["table_size"])
        blocks = [np.ascontiguousarray(block) for block in lanes]
        pointers = (_doubles * len(blocks))(*(_pointer(block) for block in blocks))
        self._library.prepare(_pointer(parameters), pointers, _pointer(self._table))
        self.outputs: dict[str, tuple[int, int]] = {}
        self._columns = 0
        for name, count in self.facts["outputs"]:
            self.outputs[name] = (self._columns, count)
            self._columns += count
        # Lanes run family by family; results go out in the mechanism's order.
        self._order = np.argsort(layout.chain_order(mechanism))
        self._ordered = bool((np.diff(self._order) == 1).all())

    @property
    def inputs(self) -> int:
        """Columns of a sample: q, q', q'', force and, if asked for, moment."""
        return 3 * self.spec.m + (6 if self.spec.moment else 3)

    def run(
        self, inputs: np.ndarray, threads: int | None = None
    ) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Evaluate samples.

        Args:    inputs: (N, `inputs`), of any strides; columns that are contiguous are fastest.
                 threads: at most so many; default: the processors at hand. Results do not
                 depend on it.
        Returns: name -> (N, columns), and status (N,): 0 ok, 1 unreachable, 2 look again.
        """
        inputs = np.asarray(inputs, dtype=np.float64)
        self._check(inputs.shape[1:])
        count = len(inputs)
        results = np.empty((self._columns, count))
        status = np.empty(count, dtype=np.uint8)
        row, column = inputs.strides
        if row % 8 or column % 8 or not inputs.flags.aligned:  # a view into a record, say
            inputs = np.array(inputs, order="F")
            row, column = inputs.strides
        base = inputs.ctypes.data
        hands = workers(threads)
        size = max(CHUNK, -(-count // (PIECES * hands)))

        def piece(start: int) -> None:
            end = min(start + size, count)
            columns = (ctypes.c_void_p * self.inputs)(
                *(base + start * row + k * column for k in range(self.inputs))
            )
            self._library.batch(
                self._table.ctypes.data,
                ctypes.addressof(columns),
                row // 8,
                end - start,
                results.ctypes.data + 8 * start,
                count,
                status.ctypes.data + start,
            )

        starts = range(0, count, size)
        if min(hands, len(starts)) > 1:
            with ThreadPoolExecutor(min(hands, len(starts))) as pool:
                list(pool.map(piece, starts))
        else:
            for start in starts:
                piece(start)
        named = {name: results[a : a + n].T for name, (a, n) in self.outputs.items()}
        return named, status

    def one(self, sample: np.ndarray) -> np.ndarray:
        """Evaluate one sample, (inputs,), at least latency: all outputs in a row, (columns,)."""
        sample = np.ascontiguousarray(sample, dtype=np.float64)
        self._check(sample.shape)
        result = np.empty(self._columns)
        self._library.one(self._table.ctypes.data, sample.ctypes.data, result.ctypes.data)
        return result

    def _check(self, shape: tuple[int, ...]) -> None:
        if shape != (self.inputs,):
            raise InputError(f"a sample of this kernel has {self.inputs} numbers; got {shape}")

    def in_order(self, lanes: np.ndarray) -> np.ndarray:
        """Lane results (N, n) in the order of the mechanism's chains."""
        return lanes if self._ordered else lanes[:, self._order]

    @property
    def address(self) -> tuple[int, int, int]:
        """Addresses of `one`, of `batch` and of the table, to call them from C."""
        one, batch = (
            ctypes.cast(getattr(self._library, name), ctypes.c_void_p).value or 0
            for name in ("one", "batch")
        )
        return one, batch, self._table.ctypes.data


def _loaded(spec: KernelSpec, compiler: Compiler) -> tuple[cache.Entry, ctypes.CDLL]:
    """The kernel of a spec, built if need be.

    Raises: CompilerError: where it cannot be built, or loaded once it is.
    """
    recipe = _recipe(spec, compiler)

    def make(folder: Path) -> tuple[Path, dict[str, Any]]:
        return _make(folder, spec, compiler)

    ways = (
        lambda: cache.find(recipe),
        lambda: cache.build(recipe, make, notice),
        lambda: cache.build_apart(recipe, make),
    )
    problem: Exception | None = None
    try:
        for way in ways:
            if (entry := way()) is not None:
                try:
                    return entry, _load(str(entry.library))
                except OSError as error:  # built with another C library, or cleared just now
                    problem = error
    except (OSError, AttributeError, UnsupportedError) as error:
        problem = error
    raise CompilerError(f"no kernel could be built and loaded: {problem}") from problem


def _recipe(spec: KernelSpec, compiler: Compiler) -> str:
    """Name of everything that shapes a kernel."""
    return cache.digest(
        generator_digest(),
        version("casadi"),
        spec.text(),
        repr((compiler.command, compiler.flags)),
        str(compiler.lanes),
        compiler.identity,
    )


def _make(folder: Path, spec: KernelSpec, compiler: Compiler) -> tuple[Path, dict[str, Any]]:
    from ..backends.c.emit import emit

    with step("building a kernel"):
        source = emit(spec, compiler.lanes)
        text, library = folder / "kernel.c", folder / "kernel.so"
        text.write_text(source.text, encoding="utf-8")
        compiler.build(text, library)
    _load(str(library))  # only what can be loaded is kept
    facts = {
        "spec": spec.text(),
        "outputs": source.outputs,
        "table_size": source.table_size,
        "operations": source.operations,
        "lanes": compiler.lanes,
        "compiler": list(compiler.command),
        "flags": list(compiler.flags),
    }
    return library, facts


@lru_cache(maxsize=1)
def generator_digest() -> str:
    """A hash of all code that decides what a kernel's C looks like."""
    package = files("condyle")
    parts: list[bytes] = []
    for room in (
        "mechanism",
        "kinematics",
        "dynamics",
        "graph",
        "questions",
        "backends",
        "kernels",
    ):
        for path in sorted(Path(str(package / room)).rglob("*")):
            if path.suffix in (".py", ".h"):
                parts += [str(path.name).encode(), path.read_bytes()]
    return cache.digest(*parts)


@lru_cache(maxsize=64)
def _load(path: str) -> ctypes.CDLL:
    library = ctypes.CDLL(path)
    library.batch.argtypes = [
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_ssize_t,
        ctypes.c_size_t,
        ctypes.c_void_p,
        ctypes.c_size_t,
        ctypes.c_void_p,
    ]
    library.batch.restype = None
    library.one.argtypes = [ctypes.c_void_p] * 3
    library.one.restype = None
    library.prepare.restype = None
    return library


def _aligned(count: int) -> np.ndarray:
    """An array that starts on a cache line, as vector loads like it."""
    raw = np.zeros(count + 8)
    offset = (-raw.ctypes.data // 8) % 8
    return raw[offset : offset + count]


def _pointer(a: np.ndarray) -> Any:
    return a.ctypes.data_as(_doubles)


class Compiled:
    """Inverse dynamics of one mechanism by compiled kernels; same numbers as `Interpreted`.

    Kernels are built when first needed, one for each set of outputs. The few samples that a
    kernel cannot judge, next to a singularity, go to the interpreter; all of them do where the
    compiler fails, unless kernels are `required`.
    """

    def __init__(
        self, mechanism: Mechanism, formulation: str, route: str, required: bool = False
    ) -> None:
        """Raises CompilerError where there is no compiler."""
        find_compiler()
        self._mechanism, self._formulation, self._route = mechanism, formulation, route
        self._required, self._failed = required, False
        self._kernels: dict[tuple[bytes, tuple[str, ...], bool], Kernel] = {}

    @property
    def name(self) -> str:
        return "interpreted" if self._failed else "compiled"

    @cached_property
    def interpreted(self) -> Interpreted:
        from .interpreted import Interpreted

        return Interpreted(self._mechanism, FORMULATIONS[self._formulation], self._route)

    def kernel(
        self, load_point: np.ndarray, outputs: Collection[str] = (), moment: bool = False
    ) -> Kernel:
        """The kernel for a load at a point, (3,) [m] in {M}, and some outputs."""
        wanted = tuple(name for name in OUTPUTS if name in outputs)
        key = (np.ascontiguousarray(load_point).tobytes(), wanted, moment)
        if key not in self._kernels:
            self._kernels[key] = Kernel(
                self._mechanism, self._formulation, self._route, load_point, wanted, moment
            )
        return self._kernels[key]

    def solve(
        self,
        q: np.ndarray,
        q1: np.ndarray,
        q2: np.ndarray,
        load: np.ndarray,
        outputs: Collection[str] = OUTPUTS,
        threads: int | None = None,
    ) -> Torques:
        """Efforts at N samples; see `Interpreted.solve`. One load point for all samples.

        Raises: CompilerError: if a kernel cannot be built and is required.
        """
        if self._failed or (len(load) and (load[:, 6:] != load[0, 6:]).any()):
            return self.interpreted.solve(q, q1, q2, load, outputs)
        point = load[0, 6:] if len(load) else np.zeros(3)
        try:
            # With moments even where all are zero: no sample's digits depend on its company.
            kernel = self.kernel(point, outputs, moment=True)
        except CompilerError as error:
            if self._required:
                raise CompilerError(f"{error}. {REMEDY}") from None
            self._failed = True
            notice(f"{error}; the interpreter gives the same numbers, slower", "compiler")
            return self.interpreted.solve(q, q1, q2, load, outputs)
        columns = [q, q1, q2, load[:, :6]]
        inputs = np.empty((len(q), kernel.inputs), order="F")
        np.concatenate(columns, axis=1, out=inputs)
        found, status = kernel.run(inputs, threads)
        result = self._labelled(kernel, q, found, status)
        again = np.flatnonzero(status == LOOK_AGAIN)
        if again.size:
            careful = self.interpreted.solve(q[again], q1[again], q2[again], load[again], outputs)
            _put(result, careful, again)
        return result

    def _labelled(
        self, kernel: Kernel, q: np.ndarray, found: dict[str, np.ndarray], status: np.ndarray
    ) -> Torques:
        n, k = kernel.spec.n, len(kernel.spec.contacts)
        share = rate = acceleration = poses = None
        contact = found.get("contact", np.empty((len(q), k)))
        if "share" in kernel.spec.outputs:
            parts = found["share"].shape[1] // n
            share = np.stack([kernel.in_order(s) for s in np.split(found["share"], parts, axis=1)])
        if "joint" in kernel.spec.outputs:
            rate = kernel.in_order(found["joint_rate"])
            acceleration = kernel.in_order(found["joint_acceleration"])
        if "motion" in kernel.spec.outputs:
            angles = np.arctan2(found["sines"], found["cosines"])
            pose = np.hstack([found["position"], angles])
            # The given coordinates as they are: arc functions return principal values.
            pose[:, indices(independent_coordinates(self._mechanism))] = q
            # The contacts can be met in a pose that a chain cannot reach.
            met = np.isfinite(pose).all(axis=1)
            poses = PoseRates(pose, found["rate"], found["acceleration"], met)
        return Torques(
            torque=kernel.in_order(found["torque"]),
            share=share,
            contact_force=contact if "contact" in kernel.spec.outputs else None,
            rate=rate,
            acceleration=acceleration,
            reached=status != 1,
            poses=poses,
            uncertain=(status == LOOK_AGAIN) | ~np.isfinite(found["torque"].sum(axis=1)),
        )


def _put(result: Torques, careful: Torques, where: np.ndarray) -> None:
    """Replace samples of a result by better ones, in place."""
    for name in ("torque", "contact_force", "rate", "acceleration", "reached"):
        target, source = getattr(result, name), getattr(careful, name)
        if target is not None:
            target[where] = source
    if result.share is not None:
        result.share[:, where] = careful.share
    if result.poses is not None and careful.poses is not None:
        for name in ("pose", "rate", "acceleration", "reached"):
            getattr(result.poses, name)[where] = getattr(careful.poses, name)
