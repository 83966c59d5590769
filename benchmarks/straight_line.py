"""Straight-line C as CasADi writes it: what our kernels are measured against."""

from __future__ import annotations

import casadi as ca
import numpy as np

from condyle.graph.program import Numbers, Program

from .casadi_function import casadi_function


def torque_function(program: Program, numbers: Numbers, load_point: np.ndarray) -> ca.Function:
    """(q, q', q'', F) in one vector -> efforts, closure and least norm included."""
    function = casadi_function(program, numbers)
    x = ca.SX.sym("x", program.columns - 6)
    whole = ca.vertcat(x, ca.SX.zeros(3), ca.DM(load_point))
    effort = function(whole)[0]
    return ca.Function("straight_line", [x], [ca.cse(ca.densify(effort))])
