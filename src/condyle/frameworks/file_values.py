"""Numbers of a mechanism file as arrays of JAX, and the kernel's numbers that they make."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from ..errors import InputError
from ..graph.program import Numbers
from ..graph.transform import LANE_NUMBERS
from ..graph.transform import NUMBERS as SHARED_NUMBERS
from ..mechanism.kept_home import kept_contacts
from ..model.model import Model
from ..questions import Question
from ..questions.derivative import PREFIX
from ..questions.file_numbers import numbers_of_file
from ..questions.number_paths import FileNumbers, NumberPath
from ..questions.numbers import Layout
from ..questions.structure import Structure, walls_of
from .traced import traced

NUMBERS = (SHARED_NUMBERS, LANE_NUMBERS)  # ports of the kernel's numbers
DIRECTIONS = tuple(PREFIX + name for name in NUMBERS)
FILE = "file"


@dataclass(frozen=True)
class FileValues:
    """Some numbers of a mechanism file, in a row x, (..., F); home is kept.

    file: all numbers of it;  own: as backends take them;  run: the question `file_numbers`, traced.
    """

    file: FileNumbers
    paths: tuple[NumberPath, ...]
    structure: Structure
    own: Numbers
    run: Callable[[Mapping[str, Any]], dict[str, Any]]

    @staticmethod
    def of(model: Model, paths: Sequence[str]) -> FileValues:
        """Raises: InputError: for paths that are no numbers of the mechanism."""
        if isinstance(paths, str):
            paths = (paths,)
        mechanism, structure = model.mechanism, model.system.unreduced.structure
        walls = walls_of(mechanism, structure, kept_contacts(mechanism, paths, "home"))
        file = FileNumbers(mechanism, structure, walls)
        own = numbers_of_file(mechanism, structure, walls)
        question = Question("file_numbers", structure, (walls,)).with_ports()
        return FileValues(
            file, tuple(file.at(paths)), structure, own, traced(question.variants().main, own)
        )

    @cached_property
    def _places(self) -> np.ndarray:
        """The place of each entry of x among all numbers of the file."""
        return np.array([self.file.place(slot) for path in self.paths for slot in path.slots])

    def given(self, numbers: Mapping[str, Any]) -> Any:
        """x of a call, (..., F): what is not given is the mechanism's.

        Raises: InputError: for other numbers, or arrays that do not fit.
        """
        import jax.numpy as jnp

        known = {path.path: path for path in self.paths}
        if unknown := [str(name) for name in numbers if name not in known]:
            raise InputError(
                f"numbers: expected some of {', '.join(known)}, which to_jax was given; got "
                f"{', '.join(unknown)}"
            )
        nominal = self.file.row[self._places]
        parts, start = [], 0
        for path in self.paths:
            own = jnp.asarray(nominal[start : start + path.size])
            start += path.size
            if path.path in numbers:
                a = jnp.asarray(numbers[path.path], dtype=float)
                lead = a.shape[: a.ndim - len(path.shape)]
                if a.shape[len(lead) :] != path.shape:
                    shape = ", ".join(["...", *map(str, path.shape)])
                    raise InputError(
                        f"numbers: {path.path}: expected an array of shape ({shape}), got {a.shape}"
                    )
                own = a.reshape(*lead, path.size)
            parts.append(own)
        lead = jnp.broadcast_shapes(*(a.shape[:-1] for a in parts))
        return jnp.concatenate([jnp.broadcast_to(a, (*lead, a.shape[-1])) for a in parts], axis=-1)

    def kernel_numbers(self, x: Any) -> tuple[Any, Any]:
        """What the ports `NUMBERS` take, (..., P) and (..., all of lanes)."""
        import jax.numpy as jnp

        lead, shared = x.shape[:-1], self.own.parameters.size
        every = jnp.broadcast_to(self.file.row, (*lead, self.file.row.size))
        every = every.at[..., self._places].set(x)
        numbers = self.run({SHARED_NUMBERS: every[..., :shared], LANE_NUMBERS: every[..., shared:]})
        layout = Layout.of(self.structure)
        names = [name for name, (_, count) in layout.parameters.items() if count]
        first = [numbers[name].reshape(*lead, -1) for name in names]
        size, groups = max(layout.sizes[1], default=0), []
        for group, names_of in enumerate(layout.lanes):
            rows = [
                numbers[f"{name}_{group}"].reshape(*lead, -1, self.structure.counts[group])
                for name in names_of
            ]
            block = jnp.concatenate(rows, axis=-2)
            gap = [(0, 0)] * len(lead) + [(0, size - block.shape[-2]), (0, 0)]
            groups.append(jnp.pad(block, gap))
        # Lanes of a group stand in the callers' order already.
        starts = np.cumsum([0, *self.structure.counts])
        order = np.concatenate([np.sort(self.own.order[a:b]) for a, b in pairwise(starts)])
        every = jnp.concatenate(groups, axis=-1)[..., np.argsort(order)]
        return jnp.concatenate(first, axis=-1), every.reshape(*lead, -1)

    def slopes(
        self, derivative: Callable[..., dict[str, Any]], given: Any, x: Any, results: Sequence[str]
    ) -> dict[str, Any]:
        """Derivatives of results by x, (..., r, F), by one direction of the kernel's numbers each.

        Args: derivative: of a question's ports, its numbers and their directions.
        """
        import jax
        import jax.numpy as jnp

        size = x.shape[-1]
        units = jnp.broadcast_to(
            jnp.eye(size).reshape(size, *[1] * (x.ndim - 1), size), (size, *x.shape)
        )
        moved = jax.vmap(lambda unit: jax.jvp(self.kernel_numbers, (x,), (unit,))[1])(units)
        same = [jnp.broadcast_to(a, (size, *a.shape)) for a in given]
        found = derivative(*same, *moved)
        return {f"{name}/{FILE}": jnp.moveaxis(found[PREFIX + name], 0, -1) for name in results}
