"""Target `acados`: discrete dynamics with exact derivatives, as its generic external functions.

x = (q, q') goes one step of the classical Runge-Kutta method under efforts that are held, without a
load. For solvers of optimal control that run elsewhere; `condyle.optimise` is ours.
"""

from __future__ import annotations

import os

import numpy as np

from ..errors import InputError, brief
from ..files.atomic import make_folder
from ..mechanism import Mechanism
from ..mechanism.chain import limits
from ..mechanism.home import characteristic_length
from ..model.model import Model, derive
from ..version import __version__
from .c_source import export
from .catalogue import CEntry
from .syntax import file_text, literal
from .written import Written, write_texts

UNLIMITED = 1e10  # which acados takes for no limit
GIVEN, BY = "q q1 effort", ("q", "q1", "effort")
ENTRIES = {
    "rate": CEntry(
        "Accelerations under efforts, without a load.",
        GIVEN,
        "acceleration",
        question="forward",
        rubbing="UNCERTIFIED",
    ),
    "slopes": CEntry(
        "Derivatives of the same by q, q1 and efforts.",
        GIVEN,
        " ".join(f"acceleration/{port}>acceleration_by_{port}" for port in BY),
        question="derivative",
        details=lambda wish: ("slopes", "forward", (), BY, ("acceleration",)),
        rubbing="UNCERTIFIED",
    ),
}


def export_acados(
    model: Model | Mechanism | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    step: float = 0.01,
    prefix: str | None = None,
) -> Written:
    """Write `disc_dyn_fun` and `disc_dyn_fun_jac` of a mechanism, in C, for acados.

        condyle.export_acados("masticatory", "acados", step=0.02)

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            path: a folder;  step: of time [s];  prefix: of all names in C.
    Returns: the files: `NAME_acados.c`, and `NAME_acados.py` with an `AcadosModel`, an example of a
            problem (running cost, limits of efforts, the goal as parameters) and its solver.
    Raises: InputError, UnsupportedError: for what cannot be exported to C.
    """
    if isinstance(step, bool) or not isinstance(step, int | float) or not 0 < step < 1e6:
        raise InputError(f"step: expected seconds, such as 0.01; got {brief(step)}")
    own = model if isinstance(model, Model) else derive(model)
    e = export(own, (), prefix=prefix, lanes=0, entries=ENTRIES)
    ends = [np.clip(limits(chain)[:2], -UNLIMITED, UNLIMITED) for chain in e.mechanism.chains]
    low, high = zip(*ends, strict=True)
    length = characteristic_length(e.mechanism)
    sizes = [0.1 * length if name in "XYZ" else 0.1 for name in own.independent]
    rows = {"low": low, "high": high, "sizes": [*sizes, *(10 * size for size in sizes)]}
    words: dict[str, object] = {
        "version": __version__,
        "step": literal(float(step), "double"),
        "m": len(own.independent),
        "n": len(e.mechanism.chains),
        "prefix": e.prefix,
        "PREFIX": e.prefix.upper(),
        # acados copies one file, which has all in it.
        "source": e.source.replace(f'#include "{e.prefix}.h"\n', e.header, 1),
        **{name: f"np.array({np.array(row).tolist()})" for name, row in rows.items()},
    }
    names = {
        "name": e.mechanism.name,
        "free": ", ".join(own.independent),
        "joints": ", ".join(e.mechanism.chain_names),
    }
    texts = {
        file: file_text(file, template, words, names)
        for file, template in (
            (f"{e.prefix}_acados.c", "c_acados.c"),
            (f"{e.prefix}_acados.py", "acados_model.in"),
        )
    }
    data = {"mechanism": e.mechanism.name, "prefix": e.prefix, "step": float(step)}
    return Written(write_texts(make_folder(path), texts), (), data)
