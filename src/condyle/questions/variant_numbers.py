"""Numbers of variants of a mechanism: `file_numbers` with the file's numbers as columns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..backends.choose import Backend, BackendName
from ..backends.kernel import AGAIN
from ..graph.program import Numbers
from ..graph.transform import LANE_NUMBERS, NUMBERS
from ..mechanism.kept_home import kept_contacts
from ..mechanism.mechanism import Mechanism
from . import Question
from .file_numbers import numbers_of_file
from .number_paths import FileNumbers
from .numbers import Layout
from .structure import Structure, walls_of

BLOCK = 256  # variants at a time, whose numbers stay in a cache


@dataclass(frozen=True)
class VariantNumbers:
    """Numbers of V variants.

    numbers: as of `numbers_of`;  status: (V,), of `Status`: ok, refused, singular.
    doubt:   those that only `mechanism.set` can judge, by number: their numbers are not to be used.
    """

    numbers: Numbers
    status: np.ndarray
    doubt: np.ndarray


def variant_numbers(
    mechanism: Mechanism,
    structure: Structure,
    table: Mapping[str, np.ndarray],
    keep: str = "home",
    backend: BackendName = "auto",
) -> VariantNumbers:
    """The kernel's numbers of every variant, and whether it is a mechanism.

    Args:   structure: of all variants, whose dependent coordinates they keep;
            table: path -> values, (V, ...), SI;  keep: as of `mechanism.set`.
    Raises: InputError: for a path without numbers of this structure.
    """
    walls = walls_of(mechanism, structure, kept_contacts(mechanism, table, keep))
    bare = replace(structure, formulation="virtual_power", route="core", zeros=frozenset())
    file = FileNumbers(mechanism, bare, walls)
    places = [[*map(file.place, path.slots)] for path in file.at(list(table))]
    own = numbers_of_file(mechanism, bare, walls)
    question = Question.about(bare, "file_numbers", walls, True).with_ports()
    kernel = Backend(backend).kernel(question.key, question.variants, Numbers.none(own.order))
    layout, shared = Layout.of(structure), own.parameters.size
    count = len(next(iter(table.values())))
    numbers = Numbers(
        np.empty((count, layout.sizes[0])),
        tuple(
            np.empty((count, size, chains))
            for size, chains in zip(layout.sizes[1], bare.counts, strict=True)
        ),
        tuple(np.empty((count, size)) for size in layout.sizes[1]),
        own.order,
    )
    status = np.empty(count, dtype=np.uint8)
    # A buffer with the variants of a number side by side.
    buffer = np.repeat(file.row[:, None], min(BLOCK, count), axis=1)
    for at in range(0, count, BLOCK):
        rows = slice(at, min(at + BLOCK, count))
        size = rows.stop - at
        every = buffer[:, :size]
        for values, at_rows in zip(table.values(), places, strict=True):
            every[at_rows] = np.reshape(values[rows], (size, -1)).T
        lanes = every[shared:].T.reshape(size, -1, len(own.order))
        answer = kernel.run({NUMBERS: every[:shared].T, LANE_NUMBERS: lanes})
        status[rows] = answer.status
        for name, (start, n) in layout.parameters.items():
            if n:
                numbers.parameters[rows, start : start + n] = answer.values[name].reshape(n, size).T
        for group, names in enumerate(layout.lanes):
            for name, (start, n) in names.items():
                value = answer.values[f"{name}_{group}"].reshape(n, -1, size)
                numbers.lanes[group][rows, start : start + n] = np.moveaxis(value, -1, 0)
    for group, first in enumerate(numbers.lanes):
        numbers.padding[group][...] = layout.idle(group, first[..., 0])
    doubt = np.flatnonzero(status == AGAIN)
    return VariantNumbers(numbers, status, doubt)
