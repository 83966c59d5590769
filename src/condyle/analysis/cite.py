"""`cite`: references to what a result was made with, for a paper."""

from __future__ import annotations

import os
import re
from importlib.resources import files

import xarray as xr

from ..results.solution import as_kind, open_solution
from ..version import __version__

ALWAYS = ("Cheng2023", "condyle", "CasADi", "xarray")
LIMITED = ("DAQP", "HiGHS")  # efforts within limits
LEAST_NORM = "minimum_norm"


def cite(solution: xr.Dataset | str | os.PathLike[str] | None = None) -> str:
    """BibTeX entries of the method, the program and the solvers; of a solution, what it used.

    Args:   solution: or its NetCDF file. Default: what every result stands on.
    Raises: InputError: for what is not a condyle solution.
    """
    keys = [*ALWAYS]
    if solution is not None:
        given = open_solution(solution) if isinstance(solution, str | os.PathLike) else solution
        found = as_kind(given, "solution", "solution")
        machine = found.condyle.mechanism
        if found.condyle.options.get("distribution", LEAST_NORM) != LEAST_NORM:
            keys += LIMITED
        if any(chain.kind == "muscle" for chain in machine.chains):
            keys.append("DeGroote2016")
        if machine.name.startswith("human-jaw"):
            keys.append("Hannam2008")
    text = (files(__package__) / "references.bib").read_text(encoding="utf-8")
    entries = {
        match[1]: match[0] for match in re.finditer(r"@\w+\{(\w+),.*?^\}$", text, re.S | re.M)
    }
    return "\n\n".join(entries[key] for key in keys).replace("VERSION", __version__)
