"""Exports of a mechanism: C for controllers, FMUs, MEX functions, MuJoCo models.

    exported = export(condyle.load_mechanism("masticatory"), ("inverse", "motion"))
    exported.source, exported.header, exported["inverse"].arguments

A target is one file, which writes its files from an `Exported`.
"""

from .c_source import export
from .catalogue import CATALOGUE, DEFAULT, Wish, in_order, usual
from .exported import CArray, Exported, Function

__all__ = [
    "CATALOGUE",
    "DEFAULT",
    "CArray",
    "Exported",
    "Function",
    "Wish",
    "export",
    "in_order",
    "usual",
]
