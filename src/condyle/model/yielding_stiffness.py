"""Stiffness of mechanisms whose contacts yield, with the contacts' depths eliminated.

Depths c are added to q, and N' = dN/dd of the contacts' laws, F = 1 / N', to K:

    f_q = -K_qq q - K_qc c,    F f_c = -(F K_cq + G_q) q - (F K_cc + G_c) c = 0,

with K under contact forces that are held, and G the slopes of the gaps: G_q = 0 and G_c = 1 but for
how the normals turn. Freedom of contacts is reduced statically, as that of rods is: c = S q. How
the curvatures of the surfaces change along them is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, UnsupportedError
from ..mechanism.mechanism import Mechanism
from .contact_patches import contact_patches
from .implicit import solved
from .system import System

Array = np.ndarray


@dataclass(frozen=True)
class CondensedStiffness:
    """Stiffness at N loaded poses, in q, samples first; K, elastic, M, D, terms, twist, rates as of
    `Equilibrium`.

    load_map: (N, 6, m), whose transpose makes generalized forces of a wrench at the point.
    contacts: compliance of the point while q is held, (N, 6, 6);  stable: whether contacts are,
              (N,), by themselves.
    """

    K: Array
    elastic: Array
    M: Array
    D: Array
    terms: Array
    twist: Array
    rates: Array
    load_map: Array
    contacts: Array
    stable: Array


def require_all_giving(system: System, rigid: Array) -> None:
    """Raises an error where depths of contacts cannot be eliminated.

    Args: rigid: which chains do not give, (n,).
    """
    if len(system.numbers) > 1:
        raise UnsupportedError(
            'contacts: stiffness of several variants at once is of contacts that are "kept"; take '
            "one mechanism after the other"
        )
    if rigid.any():
        names = [chain.name for chain in system.mechanism.chains]
        without = ", ".join(name for name, held in zip(names, rigid, strict=True) if held)
        raise InputError(
            f'contacts "compliant" take chains that give too; {without} are rigid: state their '
            'stiffness (chain.<name>.actuator.stiffness), or take contacts "kept"'
        )


def condensed(
    mechanism: Mechanism, pose: Array, values: Mapping[str, Array], m: int
) -> CondensedStiffness:
    """Args: pose: where contacts have yielded, (N, 6);  values: of the question
    `elastic_yielding`, samples first, chains last."""
    force, slope = values["contact_force"], values["gap_slope"]
    patch = contact_patches(mechanism, pose, force)
    yields = np.isfinite(patch.stiffness) & (patch.stiffness > 0)  # not: rigid, or lost
    give = np.where(yields, 1 / np.where(yields, patch.stiffness, 1.0), 0.0)
    F, T, K = give[..., None], values["twist"], values["K"]

    def eliminated(K: Array) -> tuple[Array, Array, Array]:
        """F K_cc + G_c, S, and K in q."""
        inner = F * K[:, m:, m:] + slope[..., m:]
        S = -_solved(inner, F * K[:, m:, :m] + slope[..., :m])
        return inner, S, K[:, :m, :m] + K[:, :m, m:] @ S

    inner, S, reduced = eliminated(K)
    basis = np.concatenate([np.broadcast_to(np.eye(m), (len(S), m, m)), S], axis=1)
    dual = basis.transpose(0, 2, 1)
    damping = [
        contact.compliance.damping if contact.compliance else 0.0 for contact in mechanism.contacts
    ]
    closing = slope @ basis
    loss = np.where(give > 0, np.abs(force) * damping, 0.0)[..., None]
    left = _solved(inner.transpose(0, 2, 1), K[:, :m, m:].transpose(0, 2, 1))
    root = np.sqrt(F)
    held = root * K[:, m:, m:] * root.transpose(0, 2, 1) + slope[..., m:]
    held[~np.isfinite(held).all(axis=(1, 2))] = 0.0
    size, inner_values = np.abs(basis), np.linalg.eigvalsh((held + held.transpose(0, 2, 1)) / 2)
    return CondensedStiffness(
        K=reduced,
        elastic=eliminated(values["elastic"])[2],
        M=dual @ values["M"] @ basis,
        D=dual @ values["D"] @ basis + closing.transpose(0, 2, 1) @ (loss * closing),
        terms=size.transpose(0, 2, 1) @ values["terms"] @ size,
        twist=T @ basis,
        rates=values["A"].transpose(0, 2, 1) @ basis,
        load_map=T[..., :m] - T[..., m:] @ (F * left),
        contacts=T[..., m:] @ _solved(inner, F * T[..., m:].transpose(0, 2, 1)),
        stable=np.all(inner_values > 0, axis=1),
    )


def _solved(A: Array, right: Array) -> Array:
    return solved(A, right)[0]
