"""The whole computation of one kernel, from the independent coordinates to the torques.

One expression serves every chain of a family, with the chain's numbers as inputs: a `lane` value
differs from chain to chain, a shared one does not, and `total` sums lanes. What is printed from
this runs lanes in a vector register (one evaluation) or samples (a batch).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from ..dynamics import FORMULATIONS
from ..dynamics.formulation import Body
from ..dynamics.least_norm import Lanes, gram_schmidt, normal_equations
from ..graph.graph import Graph, Value, read
from ..kinematics.chain import FAMILIES, Constants, Family, Law
from ..kinematics.contact import (
    Placement,
    closed_form,
    closed_form_available,
    indices,
    solve_small,
)
from ..kinematics.iteration import newton
from ..kinematics.parasitic import WholeMotion, whole_motion
from ..kinematics.state import PointMotion, State, independent_state, pose_state, twist_state
from .layout import Layout
from .spec import KernelSpec


@dataclass(frozen=True)
class Output:
    """A result: `nodes` is one node for a shared value, one a group for a lane value."""

    name: str
    lane: bool
    nodes: tuple[Value, ...]


@dataclass
class Program:
    """Inputs, definitions and outputs of a kernel as one graph; `early` as in `build`."""

    spec: KernelSpec
    layout: Layout
    graph: Graph = field(default_factory=Graph)
    outputs: list[Output] = field(default_factory=list)
    early: bool = False
    _free: list[ca.SX] = field(default_factory=list)
    _known: dict[str, Value] = field(default_factory=dict)

    def inputs(self, name: str, count: int) -> ca.SX:
        start = self.layout.inputs.index(f"{name}_0") if count else 0
        return self._symbols(name, [self.graph.leaf("input", start + i) for i in range(count)])

    def parameters(self, name: str) -> ca.SX:
        start, count = self.layout.parameters[name]
        return self._symbols(name, [self._number(-1, start + i) for i in range(count)])

    def lane_constants(self, group: int, name: str) -> ca.SX:
        start, count = self.layout.lanes[group][name]
        leaves = [self._number(group, start + i) for i in range(count)]
        return self._symbols(f"{name}_{group}", leaves)

    def _number(self, group: int, i: int) -> Value:
        if (group, i) in self.spec.zeros:
            return self.graph.const(0.0)
        if group < 0:
            return self.graph.leaf("parameter", i)
        return self.graph.leaf("lane", group, i, group=group)

    def total(self, terms: Sequence[ca.SX]) -> ca.SX:
        """Sum over all chains, entry by entry; one term a group."""
        return self._reduced("sum", terms)

    def least(self, terms: Sequence[ca.SX]) -> ca.SX:
        """Minimum over all chains; one term a group."""
        return self._reduced("least", terms)

    def let(self, expression: ca.SX) -> ca.SX:
        """Symbols that stand for an expression, to differentiate with respect to."""
        nodes = read(self.graph, [expression], self._known, self._free)[0]
        return self._symbols(f"let{len(self._free)}", nodes)

    def finish(self, results: Mapping[str, ca.SX | Lanes]) -> None:
        """Results, entry by entry; a list of expressions, one a group, is a lane value."""
        parts = {name: e if isinstance(e, list) else [e] for name, e in results.items()}
        every = [e for expressions in parts.values() for e in expressions]
        # All in one reading, since each goes through everything its expressions share.
        nodes = iter(read(self.graph, every, self._known, self._free))
        for name, expressions in parts.items():
            found = [next(nodes) for _ in expressions]
            for entry in zip(*found, strict=True):
                self.outputs.append(Output(name, isinstance(results[name], list), tuple(entry)))

    def _reduced(self, op: str, terms: Sequence[ca.SX]) -> ca.SX:
        nodes = read(self.graph, list(terms), self._known, self._free)
        reduced = [self.graph.reduce(op, entry) for entry in zip(*nodes, strict=True)]
        return self._symbols(f"{op}{len(self._free)}", reduced)

    def _symbols(self, name: str, nodes: Sequence[Value]) -> ca.SX:
        symbols = [ca.SX.sym(f"{name}#{i}") for i in range(len(nodes))]
        for symbol, node in zip(symbols, nodes, strict=True):
            self._known[symbol.name()] = node
            self._free.append(symbol)
        return ca.vertcat(*symbols) if symbols else ca.SX(0, 1)


@dataclass(frozen=True)
class Basis:
    """Pi, the rates that the contacts allow: identity rows, and `rest` for the other rows.

    Torques of least norm do not depend on which basis it is, so it can be a sparse one.
    """

    identity: Sequence[int]
    others: Sequence[int]
    rest: ca.SX

    def pull(self, f: ca.SX) -> ca.SX:
        """Pi^T f, with a column for each of f."""
        own = f[list(self.identity), :]
        return own + self.rest.T @ f[list(self.others), :] if len(self.others) else own


def twist_basis(motion: WholeMotion, dep: list[int]) -> Basis:
    """Twists with N^T [V; omega] = 0, by the components that stand where `dep` do at home.

    At home R_omega is the identity, so they are determined as well as the coordinates are.
    """
    N = motion.frame.N
    ind = [i for i in range(6) if i not in dep]
    return Basis(ind, dep, -solve_small(N[dep, :].T, N[ind, :].T))


@dataclass(frozen=True)
class ChainTerms:
    """What the chains of one group contribute, lane by lane, dual to the state's rates."""

    law: Law
    forces: dict[str, ca.SX]
    row: ca.SX


def build(spec: KernelSpec, careful: bool = False, early: bool = False) -> Program:
    """The program of a spec.

    Args: careful: solve for the torques by `gram_schmidt` where `normal_equations` are quicker.
          early: fewer operations after one another, for more of them in all.
    """
    p = Program(spec, Layout.of(spec), early=early)
    m = spec.m
    q, q1, q2 = (p.inputs(name, m) for name in ("q", "q1", "q2"))
    force = p.inputs("force", 3)
    moment = p.inputs("moment", 3) if spec.moment else ca.SX.zeros(3)
    g = p.parameters("gravity")

    contacts = p.layout.contact_symbols(p.parameters)
    if closed_form_available([form for form, _ in spec.contacts], spec.dependent):
        placement = closed_form(contacts, spec.dependent, q, p.parameters("branch"))
    else:
        placement = newton(contacts, spec.dependent, q)
    motion = whole_motion(contacts, spec.dependent, placement, q1, q2)
    formulation = FORMULATIONS[spec.formulation]
    dep = indices(spec.dependent)
    if spec.route == "direct":
        state = independent_state(q, q1, q2, placement.pose())
        basis = Basis(range(spec.m), [], ca.SX(0, spec.m))
    elif formulation.uses_twist:
        state = twist_state(placement.position, motion.R, motion.twist, motion.twist_rate)
        basis = twist_basis(motion, dep)
    else:
        state = _pose_state(p, placement, motion)
        ind = [i for i in range(6) if i not in dep]
        basis = Basis(ind, dep, motion.M_J[dep, :])

    fold = folds(spec)
    chains = [_chain_terms(p, group, spec.formulation, state, g, fold) for group in _groups(spec)]
    body = _body(p, fold)
    r = state.R @ p.parameters("load_point")
    bite = -(state.B.T @ ca.vertcat(force, ca.cross(r, force) + moment))
    parts = {"platform": formulation.platform(state, body, g)}
    parts |= _chain_parts(p, chains, "share" in spec.outputs)
    parts["bite"] = bite

    A = [basis.pull(c.row) for c in chains]
    if "share" in spec.outputs:
        b = ca.horzcat(*(basis.pull(part) for part in parts.values()))
    else:
        total = _sum(list(parts.values()))
        b = basis.pull(total)
    solve = gram_schmidt if careful or spec.n == m else normal_equations
    shares, quality = solve(p.total, A, b)
    torque = [_sum(ca.horzsplit(s)) for s in shares]
    results: dict[str, ca.SX | Lanes] = {
        "torque": torque,
        "margin": _margin(p, placement, chains),
        "quality": quality,
    }
    if "contact" in spec.outputs and dep:
        known = None if spec.route == "direct" else (parts, chains)
        results["contact"] = _contact_forces(
            p, spec, motion, placement, force, moment, torque, known
        )
    if "share" in spec.outputs:
        results["share"] = [s.T for s in shares]
    if "motion" in spec.outputs:
        results |= {
            "position": placement.position,
            "cosines": placement.bryant.cos,
            "sines": placement.bryant.sin,
            "rate": motion.rate,
            "acceleration": motion.acceleration,
        }
    if "joint" in spec.outputs:
        results["joint_rate"] = [c.law.rate for c in chains]
        results["joint_acceleration"] = [c.law.acceleration for c in chains]
    p.finish(results)
    return p


def folds(spec: KernelSpec) -> bool:
    """Whether a chain's bodies act as one, with end masses that are part of the platform."""
    return spec.formulation == "virtual_power" and "share" not in spec.outputs


def _groups(spec: KernelSpec) -> list[tuple[int, str]]:
    return [(index, kind) for index, (kind, _) in enumerate(spec.chains)]


def _pose_state(p: Program, placement: Placement, motion: WholeMotion) -> State:
    """The state in X_EE, by symbols that a formulation can differentiate with respect to."""
    pose, rate, acceleration = (
        p.let(v) for v in (placement.pose(), motion.rate, motion.acceleration)
    )
    return pose_state(pose, rate, acceleration)


def _chain_terms(
    p: Program, group: tuple[int, str], formulation: str, state: State, g: ca.SX, fold: bool
) -> ChainTerms:
    index, kind = group
    family = FAMILIES[kind]
    constants: Constants = family.named(p.lane_constants(index, "constants"))
    M = state.point(p.lane_constants(index, "joint"))
    if fold:
        law, force = _folded(family, constants, M, g, p.early)
        forces = {"chains": force}
    else:
        law = FORMULATIONS[formulation].chain(family, constants, M, g)
        forces = law.forces
    if p.spec.formulation != "virtual_power" or not family.idle:
        # A lane without a chain has neither J nor force; elsewhere idle constants see to that.
        active = p.lane_constants(index, "active")
        forces = {name: active * f for name, f in forces.items()}
        law = replace(law, J=active * law.J)
    pulled = {name: state.pull(f, M.lever) for name, f in forces.items()}
    return ChainTerms(law, pulled, state.pull(law.J, M.lever))


def _folded(
    family: Family, c: Constants, M: PointMotion, g: ca.SX, early: bool
) -> tuple[Law, ca.SX]:
    """A chain's law, and all its force on M but that of its end masses, (3,).

    Early, the force is ready one step after the joint's acceleration, of which it is an affine
    function; that takes a few operations more.
    """
    held: list[ca.SX] = []
    acceleration = ca.SX.sym("acceleration")

    def let(value: ca.SX) -> ca.SX:
        held.append(value)
        return acceleration

    law = family.law(c, M.position, M.velocity, M.acceleration, g, let if early else ca.SX)
    force = _sum(list(law.forces.values())) + law.J * law.effort
    if held:
        slope = ca.jacobian(force, acceleration)
        rest = ca.substitute(force, acceleration, 0)
        law = replace(law, acceleration=held[0])
        force = rest + slope * held[0]
    return law, force


def _body(p: Program, folded: bool) -> Body:
    """The platform, alone or with the end masses of the chains folded into it."""
    mass, first, i = (
        p.parameters(f"{'folded_' if folded else ''}{name}")
        for name in ("mass", "first_moment", "inertia")
    )
    inertia = ca.vertcat(*(ca.horzcat(*(i[k] for k in row)) for row in _SYMMETRIC))
    return Body(mass, first, inertia)


_SYMMETRIC = ((0, 3, 4), (3, 1, 5), (4, 5, 2))  # entries xx, yy, zz, xy, xz, yz


def _chain_parts(p: Program, chains: Sequence[ChainTerms], apart: bool) -> dict[str, ca.SX]:
    """Forces of the chains' bodies, summed over the chains: by body, or all in one."""
    size = chains[0].row.shape[0]
    if not apart:
        return {"chains": p.total([_sum(list(c.forces.values())) for c in chains])}
    names: dict[str, None] = {}
    for kind, _ in p.spec.chains:
        names.update(dict.fromkeys(reversed(FAMILIES[kind].bodies)))
    return {
        name: p.total([c.forces.get(name, ca.SX.zeros(size)) for c in chains]) for name in names
    }


def _margin(p: Program, placement: Placement, chains: Sequence[ChainTerms]) -> ca.SX:
    """Least of the dimensionless reaches: not negative where the pose can be reached."""
    least = p.least([c.law.reach for c in chains])
    if placement.reach is None:
        return least
    # A pose that Newton did not find is not unreachable but unknown: 0, to be looked at again.
    return least * placement.reach if placement.iterated else ca.fmin(least, placement.reach)


def _contact_forces(
    p: Program,
    spec: KernelSpec,
    motion: WholeMotion,
    placement: Placement,
    force: ca.SX,
    moment: ca.SX,
    torque: Lanes,
    known: tuple[dict[str, ca.SX], Sequence[ChainTerms]] | None,
) -> ca.SX:
    """lambda along the unit normals, from the dependent rows of G mu = Q - J^T tau."""
    dep = indices(spec.dependent)
    G = motion.frame.N
    if known is None:
        # Route `direct` has no equations across the contacts: take them from virtual power.
        g = p.parameters("gravity")
        state = twist_state(placement.position, motion.R, motion.twist, motion.twist_rate)
        chains = [_chain_terms(p, gr, "virtual_power", state, g, True) for gr in _groups(spec)]
        body = _body(p, True)
        r = state.R @ p.parameters("load_point")
        Q = FORMULATIONS["virtual_power"].platform(state, body, g)
        Q = Q - ca.vertcat(force, ca.cross(r, force) + moment)
        Q = Q + _chain_parts(p, chains, False)["chains"]
    else:
        parts, chains = known[0], list(known[1])
        Q = _sum(list(parts.values()))
        if not FORMULATIONS[spec.formulation].uses_twist:
            G = motion.E.T @ G
    pulled = p.total([c.row[dep] * t for c, t in zip(chains, torque, strict=True)])
    left = Q[dep] - pulled
    mu = solve_small(G[dep, :], left)
    if spec.parallel:
        # mu_mean grad (phi_1 + phi_2) / 2 + mu_difference grad (phi_1 - phi_2)
        mu = ca.vertcat(mu[0] / 2 + mu[1], mu[0] / 2 - mu[1])
        return mu * motion.frame.n_length[0]
    return mu * motion.frame.n_length


def _sum(terms: Sequence[ca.SX]) -> ca.SX:
    total = terms[0]
    for term in terms[1:]:
        total = total + term
    return total
