"""The force balance at N samples: efforts and contact forces against a generalized force.

    Q = J^T tau + sum_k lambda_k D_k,    D_k = N_k - sigma_k T_k,    sigma_k = sign(lambda_k),

six equations for n efforts and k contact forces. The effort is tau + offset, the offset being the
actuator's own loss; limits and objective apply to the effort.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ..errors import InputError

MOST_CONTACTS = 5


@dataclass(frozen=True)
class Problem:
    """N samples of one machine.

    Q:        generalized force that efforts and contacts balance, (N, 6) [N, N m].
    J:        rows of the actuator Jacobian on the platform's twist, (N, n, 6).
    normal:   wrench of a unit contact force without friction, (N, k, 6).
    friction: its reduction by friction where the contact pushes, mu [u; c x u], (N, k, 6);
              zero where there is none.
    low, high: limits of the efforts, (n,), or (N, n) of each sample; infinite where there is none.
    push:     sign of a unilateral contact's force, 0 where the contact is bilateral, (k,).
    preload:  minimum force of unilateral contacts, compressive, and of those with friction, of
              either sign [N]: it keeps them off the border between two patterns.
    offset:   effort less tau, (N, n).
    contact_weight: W, dimensionless: `weighted` adds W (lambda_k / N_ref)^2 of every contact.
    greatest: what objectives measure efforts by, (n,); by default the larger of |limits|.
    target:   what objectives measure efforts from, (N, n); by default 0.
    rubs:     contacts with friction, (k,); by default those where `friction` is not 0.
    reference_force: N_ref [N]; by default the largest finite `scale`, efforts being forces, or 1.
    """

    Q: np.ndarray
    J: np.ndarray
    normal: np.ndarray
    friction: np.ndarray = None  # type: ignore[assignment]
    low: np.ndarray = None  # type: ignore[assignment]
    high: np.ndarray = None  # type: ignore[assignment]
    push: np.ndarray = None  # type: ignore[assignment]
    preload: float = 0.0
    offset: np.ndarray = None  # type: ignore[assignment]
    contact_weight: float = 0.0
    rubs: np.ndarray = None  # type: ignore[assignment]
    greatest: np.ndarray | None = None
    target: np.ndarray | None = None
    reference_force: float | None = None

    def __post_init__(self) -> None:
        """Fill in the defaults and check shapes and values."""
        if np.ndim(self.J) != 3 or np.ndim(self.normal) != 3:
            raise InputError(
                f"J must be (N, n, 6) and normal (N, k, 6); got {np.shape(self.J)} and "
                f"{np.shape(self.normal)}"
            )
        count, n, k = np.shape(self.J)[0], np.shape(self.J)[1], np.shape(self.normal)[1]
        defaults = {
            "friction": np.zeros((count, k, 6)),
            "low": np.full(n, -np.inf),
            "high": np.full(n, np.inf),
            "push": np.zeros(k),
            "offset": np.zeros((count, n)),
        }
        shapes = {"Q": (count, 6), "J": (count, n, 6), "normal": (count, k, 6)}
        shapes |= {name: a.shape for name, a in defaults.items()}
        for name, shape in shapes.items():
            given = getattr(self, name)
            array = defaults[name] if given is None else np.asarray(given, dtype=float)
            each = (count, n) if name in ("low", "high") else shape
            if array.shape not in (shape, each):
                raise InputError(f"{name} must be of shape {shape}; got {array.shape}")
            object.__setattr__(self, name, array)
        if self.rubs is None:
            object.__setattr__(self, "rubs", (self.friction != 0).any(axis=(0, 2)))
        self._check_numbers()

    def _check_numbers(self) -> None:
        low, high, push = self.low, self.high, self.push
        if self.k > MOST_CONTACTS:
            raise InputError(f"at most {MOST_CONTACTS} contacts; got {self.k}")
        if not (low <= high).all() or (low == np.inf).any() or (high == -np.inf).any():
            worst = int(np.argmin((low <= high) & (low < np.inf) & (high > -np.inf)))
            raise InputError(
                f"limits of effort {worst % self.n}: [{low.flat[worst]:g}, "
                f"{np.broadcast_to(high, low.shape).flat[worst]:g}]; the first must be a "
                "number not above the second"
            )
        if not np.isin(push, (-1, 0, 1)).all():
            raise InputError(f"push must be -1, 0 or 1; got {push.tolist()}")
        for name in ("preload", "contact_weight"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise InputError(f"{name} must be a number, 0 or more; got {value}")
        reference = self.reference_force
        if reference is not None and not 0 < reference < np.inf:
            raise InputError(f"reference_force must be a number above 0 [N]; got {reference}")

    @property
    def force_weight(self) -> float:
        """W / N_ref^2, what multiplies the square of a contact force [1/N^2]."""
        reference = self.reference_force
        if reference is None:
            known = self.scale[np.isfinite(self.scale) & (self.scale > 0)]
            reference = float(known.max(initial=0.0)) or 1.0
        return self.contact_weight / reference**2

    @property
    def count(self) -> int:
        """N."""
        return self.J.shape[0]

    @property
    def n(self) -> int:
        """Number of efforts."""
        return self.J.shape[1]

    @property
    def k(self) -> int:
        """Number of contacts."""
        return self.normal.shape[1]

    @property
    def scale(self) -> np.ndarray:
        """max_i: `greatest`, or the larger of |limits|, (n,)."""
        if self.greatest is not None:
            return self.greatest
        largest = np.maximum(np.abs(self.low), np.abs(self.high))
        return largest if largest.ndim == 1 else largest.max(axis=0, initial=0.0)

    @property
    def finite(self) -> np.ndarray:
        """Samples whose inputs are all finite, (N,)."""
        parts = (self.Q, self.J, self.normal, self.friction, self.offset)
        return np.all([np.isfinite(a).all(axis=tuple(range(1, a.ndim))) for a in parts], axis=0)

    def take(self, rows: np.ndarray) -> Problem:
        """The same machine at some of the samples."""
        names = ("Q", "J", "normal", "friction", "offset", "low", "high", "target")
        own = {f.name: getattr(self, f.name) for f in fields(self) if f.name in names}
        of_samples = {n: a for n, a in own.items() if a is not None and np.ndim(a) > 1}
        return replace(self, **{n: a[rows] for n, a in of_samples.items()})

    def bearing(self, contacts: Sequence[int]) -> Problem:
        """The same without the other contacts."""
        own = list(contacts)
        return replace(
            self,
            normal=self.normal[:, own],
            friction=self.friction[:, own],
            push=self.push[own],
            rubs=self.rubs[own],
        )

    def untargeted(self) -> Problem:
        """The same of effort - target."""
        target = self.target
        assert target is not None
        low, high = self.low - target, self.high - target
        Q = self.Q - np.einsum("rni,rn->ri", self.J, target)
        return replace(self, Q=Q, low=low, high=high, greatest=self.scale, target=None)
