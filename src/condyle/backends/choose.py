"""Which backend runs a question: compiled where there is a compiler, else numpy; or cuda."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Literal, get_args

from ..errors import InputError, did_you_mean
from ..extras import require
from ..graph.program import Numbers, Programs
from .c.compiled_kernel import CompiledKernel
from .compiler import REMEDY, CompilerError, find_compiler
from .cuda import CudaKernel
from .kernel import Kernel
from .notice import notice
from .numpy_kernel import NumpyKernel

BackendName = Literal["auto", "compiled", "numpy", "cuda"]
BACKENDS = get_args(BackendName)
ALIASES = {"interpreted": "numpy"}  # an older name


class Backend:
    """Makes kernels; `name` tells which it is: one that cannot build kernels turns to numpy."""

    def __init__(self, name: BackendName = "auto") -> None:
        """`CONDYLE_BACKEND` decides what auto means, if it is set.

        Raises: InputError:    for an unknown backend.
                CompilerError: if compiled is asked for and there is no compiler.
                MissingExtraError: if cuda is asked for without CuPy.
        """
        self.requested: BackendName = name
        chosen = os.environ.get("CONDYLE_BACKEND") or "auto" if name == "auto" else name
        chosen = ALIASES.get(chosen, chosen)
        if chosen not in BACKENDS:
            raise InputError(f'no backend "{chosen}".{did_you_mean(chosen, BACKENDS)}')
        self.required: bool = chosen == "compiled"
        self.name: str = "compiled" if chosen == "auto" else chosen
        if self.name == "cuda":
            require("cupy", "cuda")
        if self.name == "compiled":
            try:
                find_compiler()
            except CompilerError as error:
                self._give_up(error)

    def kernel(self, key: str | None, build: Callable[[], Programs], numbers: Numbers) -> Kernel:
        """The question's kernel.

        Raises: CompilerError: where it cannot be built and numpy was not to stand in.
        """
        if self.name == "compiled":
            try:
                return CompiledKernel(key, build, numbers)
            except CompilerError as error:
                self._give_up(error)
        if self.name == "cuda":
            return CudaKernel(build(), numbers)
        return NumpyKernel(build(), numbers)

    def _give_up(self, error: CompilerError) -> None:
        if self.required:
            raise CompilerError(f"{error}. {REMEDY}") from None
        self.name = "numpy"
        notice(f"{error}; numpy gives the same numbers, slower", "compiler")
