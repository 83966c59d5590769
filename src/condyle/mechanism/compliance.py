"""How a contact gives under its force: laws of indentation, area and pressure.

    linear        N = stiffness d
    hertz         two elastic bodies: N = (4/3) E* sqrt(R) d^(3/2) of a sphere
    foundation    a thin elastic layer of independent springs: p = K d / h at every point

N is the force that presses the sides together, d their approach at the centre of the patch. Both
laws with an area see the two surfaces as paraboloids, by their principal relative curvatures
k1 <= k2: the gap around the contact is (k1 x^2 + k2 y^2) / 2. Hertz after Johnson, Contact
Mechanics (1985), chapter 4; foundation after his section 4.3, with the layer's modulus K of
Blankevoort, Kuiper, Huiskes and Grootenboer, J. Biomechanics 24, 1019-1031 (1991).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, StrictBool, model_validator

from .kinds import Kinds
from .quantities import ContactDamping, Modulus, PoissonRatio, PositiveLength, Stiffness
from .table import Table

Array = np.ndarray
Sided = tuple[float, float]  # of the ball, of the surface
ECCENTRICITY_STEPS = 24  # each leaves at most an eighth of the error
STRAIN_STEPS = 60  # Newton from above: about ten, and more where the layer is all but gone


@dataclass(frozen=True)
class ContactPatch:
    """A contact under load, (...) each; NaN where its law does not say it, or does not hold.

    indentation:    approach of the two sides at the centre [m].
    area:           of the patch [m^2];  reach: from its centre to its farthest edge [m].
    mean_pressure, peak_pressure: [Pa].
    energy_density: elastic energy a volume where it is largest, at the centre [J/m^3].
    strain:         what has to be small for the law to hold: indentation over the layer's
                    thickness, or half the patch over the radius of curvature.
    stiffness:      dN / d indentation at this load, curvatures held [N/m].
    """

    indentation: Array
    area: Array
    reach: Array
    mean_pressure: Array
    peak_pressure: Array
    energy_density: Array
    strain: Array
    stiffness: Array


class Compliance(Table):
    """A law by which a contact gives."""

    implied: ClassVar[tuple[str, ...]] = ("damping",)
    curved: ClassVar[bool] = False  # whether it needs the curvatures
    largest_strain: ClassVar[float] = math.inf  # beyond it the law is a tenth off or more

    kind: str
    damping: ContactDamping = Field(
        default=0.0, description="d of Hunt and Crossley's force N (1 + d v); statics has none"
    )

    @abstractmethod
    def patch(self, force: Array, curvature: Array) -> ContactPatch:
        """The contact under forces (...) >= 0 [N]; where there is none, nothing touches.

        Args: curvature: principal relative curvatures, (..., 2), rising [1/m].
        """

    @property
    @abstractmethod
    def exponent(self) -> float:
        """n of N = c d^n."""

    def pressed(self, indentation: Array, curvature: Array) -> tuple[Array, Array]:
        """N [N] and the elastic energy [J] at indentations (...) [m]; 0 where there is none.

        Args: curvature: as of `patch`.
        """
        d, n = np.maximum(indentation, 0.0), self.exponent
        force = (d / self.patch(np.ones_like(d), curvature).indentation) ** n
        return force, force * d / (n + 1)


class LinearCompliance(Compliance):
    """N = stiffness d: a contact without a shape, hence without area and pressure."""

    exponent: ClassVar[float] = 1.0

    kind: Literal["linear"] = "linear"
    stiffness: Stiffness

    def patch(self, force: Array, curvature: Array) -> ContactPatch:
        k, unknown = np.full(np.shape(force), self.stiffness), np.full(np.shape(force), np.nan)
        values = dict.fromkeys(ContactPatch.__dataclass_fields__, unknown)
        patch = _where_pressed(ContactPatch(**(values | {"indentation": force / k})), force)
        return replace(patch, stiffness=k)


class CurvedCompliance(Compliance):
    """A law of two curved sides, whose numbers are one, or the ball's and the surface's."""

    curved: ClassVar[bool] = True

    modulus: Modulus | tuple[Modulus, Modulus] = Field(
        description="Young's; two: of the ball and of the surface, one: the other side is rigid"
    )
    radius: PositiveLength | tuple[PositiveLength, PositiveLength] | None = Field(
        default=None,
        description="of the ball's curvature where it touches; two: along the platform's X and "
        "across; default: ball_radius",
    )
    length: PositiveLength | None = Field(
        default=None, description="of a line of contact, as of a cylinder; default: a point"
    )

    @property
    def sides(self) -> int:
        """Elastic sides, 1 or 2."""
        return 2 if isinstance(self.modulus, tuple) else 1

    @model_validator(mode="after")
    def _as_many_sides(self) -> Self:
        for name in ("poisson", "thickness"):
            if self.sides == 1 and isinstance(getattr(self, name, None), tuple):
                raise ValueError(f"{name} has two sides, and modulus one: give both of either")
        return self

    def ball_curvature(self, ball_radius: float | None) -> Sided:
        """Curvatures of the ball along the platform's X and across [1/m]."""
        radii = self.radius if self.radius is not None else ball_radius
        assert radii is not None, "checked by the contact"
        along, across = _pair(radii)
        return 1 / along, 1 / across

    def relative_curvature(self, surface: Array, ball_radius: float | None) -> Array:
        """Principal relative curvatures, (..., 2), rising [1/m].

        Args: surface: second derivatives xx, yy, xy, (3, ...) [1/m], of the surface's height
              towards the ball, x and y in the directions of the ball's two radii.
        """
        along, across = self.ball_curvature(ball_radius)
        xx, yy, xy = along - surface[0], across - surface[1], surface[2]
        mean, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
        return np.stack([mean - half, mean + half], axis=-1)


class HertzCompliance(CurvedCompliance):
    """Two elastic bodies that are large beside the patch: a sphere, an ellipsoid, or a cylinder.

    1 / E* = (1 - nu^2) / E, summed over the elastic sides. Of a line of contact N =
    (pi / 4) E* length d, as is usual: its true approach depends on where it is measured.
    """

    largest_strain: ClassVar[float] = 0.3

    kind: Literal["hertz"] = "hertz"
    poisson: PoissonRatio | tuple[PoissonRatio, PoissonRatio]

    @property
    def exponent(self) -> float:
        return 1.5 if self.length is None else 1.0

    @property
    def effective_modulus(self) -> float:
        """E* [Pa]."""
        return 1 / sum((1 - nu**2) / E for E, nu in self._materials)

    @property
    def _materials(self) -> list[Sided]:
        moduli, ratios = _pair(self.modulus), _pair(self.poisson)
        return list(zip(moduli, ratios, strict=True))[: self.sides]

    def patch(self, force: Array, curvature: Array) -> ContactPatch:
        E, N = self.effective_modulus, np.asarray(force, dtype=float)
        low, high = np.moveaxis(np.where(curvature > 0, curvature, np.nan), -1, 0)
        with np.errstate(all="ignore"):
            if self.length is not None:
                high = np.where(curvature[..., 1] > 0, curvature[..., 1], np.nan)
                a = np.full(N.shape, np.inf)
                b = np.sqrt(4 * N / (np.pi * self.length * E * high))
                area, peak = 2 * b * self.length, 2 * N / (np.pi * b * self.length)
                indentation = 4 * N / (np.pi * E * self.length)
                stiffness = np.full(N.shape, np.pi / 4 * E * self.length)
                reach = np.hypot(self.length / 2, b)
            else:
                m = _square_eccentricity(high / low)
                K, D = _ellipse_integrals(m)
                a = np.cbrt(3 * N * D / (np.pi * E * low))
                b = a * np.sqrt(1 - m)
                area, peak, reach = np.pi * a * b, 3 * N / (2 * np.pi * a * b), a
                indentation = 3 * N * K / (2 * np.pi * a * E)
                stiffness = 1.5 * N / indentation
            # Stresses at the centre of the patch, in units of the pressure there.
            share = np.where(np.isfinite(a), b / (a + b), 0.0)
            density = [_energy_density(peak, share, modulus, nu) for modulus, nu in self._materials]
            patch = ContactPatch(
                indentation, area, reach, N / area, peak, np.max(density, axis=0), b * high,
                stiffness,
            )  # fmt: skip
        return _where_pressed(patch, N)


class FoundationCompliance(CurvedCompliance):
    """A layer of independent springs, such as cartilage: p = K d / h.

    K = (1 - nu) E / ((1 + nu) (1 - 2 nu)), for the layer cannot give way sideways; of two layers
    h / K is the sum. With `large_strain` p = -K log(1 - d / h), of one layer at a point.
    """

    implied: ClassVar[tuple[str, ...]] = (*Compliance.implied, "large_strain")
    largest_strain: ClassVar[float] = 0.2

    kind: Literal["foundation"] = "foundation"
    poisson: PoissonRatio | tuple[PoissonRatio, PoissonRatio]
    thickness: PositiveLength | tuple[PositiveLength, PositiveLength]
    large_strain: StrictBool = Field(
        default=False, description="the layer stiffens as it thins, at large indentations"
    )

    @model_validator(mode="after")
    def _one_layer(self) -> Self:
        if any(nu >= 0.5 for nu in _pair(self.poisson)):
            raise ValueError("poisson: a foundation needs less than 0.5: K is infinite there")
        if self.large_strain and (self.sides == 2 or self.length is not None):
            raise ValueError("large_strain is of one layer at a point: leave out the other")
        return self

    @property
    def exponent(self) -> float:
        return 2.0 if self.length is None else 1.5

    def pressed(self, indentation: Array, curvature: Array) -> tuple[Array, Array]:
        if not self.large_strain:
            return super().pressed(indentation, curvature)
        K, depth = self._layers[0]
        d = np.maximum(indentation, 0.0)
        with np.errstate(all="ignore"):
            R, x = 1 / np.sqrt(np.prod(curvature, axis=-1)), d / depth
            scale = 2 * np.pi * R * depth * K
            force, energy = scale * _squeeze(x), scale * depth * _squeeze_integral(x)
        gone = x >= 1  # no layer is left
        return np.where(gone, np.nan, force), np.where(gone, np.nan, energy)

    @property
    def _layers(self) -> list[Sided]:
        """K [Pa] and h [m] of each."""
        numbers = zip(*map(_pair, (self.modulus, self.poisson, self.thickness)), strict=True)
        return [
            ((1 - nu) * E / ((1 + nu) * (1 - 2 * nu)), h) for E, nu, h in [*numbers][: self.sides]
        ]

    @property
    def thinning(self) -> Sided:
        """Indentation a pressure, h / K [m/Pa], and thickness [m], of all layers."""
        return sum(h / K for K, h in self._layers), sum(h for _, h in self._layers)

    def patch(self, force: Array, curvature: Array) -> ContactPatch:
        N, layers = np.asarray(force, dtype=float), self._layers
        give, depth = self.thinning
        softest = min(K for K, _ in layers)
        low, high = np.moveaxis(np.where(curvature > 0, curvature, np.nan), -1, 0)
        with np.errstate(all="ignore"):
            if self.length is not None:
                high = np.where(curvature[..., 1] > 0, curvature[..., 1], np.nan)
                d = np.cbrt((0.75 * N * give / self.length) ** 2 * high / 2)
                b = np.sqrt(2 * d / high)
                area, reach = 2 * b * self.length, np.hypot(self.length / 2, b)
                peak, stiffness = d / give, 1.5 * N / d
            else:
                R = 1 / np.sqrt(low * high)
                if self.large_strain:
                    x = _strain(N * give / (2 * np.pi * R * depth**2))
                    d, peak = depth * x, -softest * np.log1p(-x)
                else:
                    d = np.sqrt(N * give / (np.pi * R))
                    peak = d / give
                area, reach = 2 * np.pi * R * d, np.sqrt(2 * d / low)
                stiffness = 2 * np.pi * R * peak
            density = softest * _squeeze(d / depth) if self.large_strain else peak**2 / 2 / softest
            found = ContactPatch(d, area, reach, N / area, peak, density, d / depth, stiffness)
        return _where_pressed(found, N)


def _pair(value: float | Sided) -> Sided:
    return value if isinstance(value, tuple) else (value, value)


def _where_pressed(patch: ContactPatch, force: Array) -> ContactPatch:
    """The patch; 0 where there is no force."""
    apart = force <= 0
    return ContactPatch(*(np.where(apart, 0.0, a) for a in vars(patch).values()))


def _ellipse_integrals(m: Array) -> tuple[Array, Array]:
    """Complete elliptic integrals K and D = (K - E) / m at the squared eccentricity m."""
    from scipy.special import ellipk, elliprd  # which takes a while

    return ellipk(m), elliprd(0.0, 1 - m, 1.0) / 3


def _square_eccentricity(ratio: Array) -> Array:
    """e^2 of the patch, from the ratio of the curvatures, >= 1.

    ratio = (K - D) / ((1 - e^2) D). Its logarithm falls in log(b / a)
    with a slope between 1.5 (circles) and 2.
    """
    t, goal = np.zeros(np.shape(ratio)), np.log(ratio)
    for _ in range(ECCENTRICITY_STEPS):
        m = -np.expm1(2 * t)
        K, D = _ellipse_integrals(m)
        t = t + (np.log((K - D) / D) - 2 * t - goal) / 1.75
    return -np.expm1(2 * t)


def _energy_density(peak: Array, share: Array, modulus: float, nu: float) -> Array:
    """Energy density of a half-space under the centre of the patch [J/m^3] (Johnson, eq. 3.46).

    Args: share: b / (a + b) of its semi-axes.
    """
    along, across = (2 * nu + (1 - 2 * nu) * part for part in (share, 1 - share))
    square = along**2 + across**2 + 1 - 2 * nu * (along * across + along + across)
    return peak**2 * square / (2 * modulus)


def _squeeze(x: Array) -> Array:
    """(1 - x) log(1 - x) + x: energy of a layer at strain x, over K."""
    small = x**2 / 2 + x**3 / 6 + x**4 / 12 + x**5 / 20 + x**6 / 30
    return np.where(x < 1e-3, small, (1 - x) * np.log1p(-x) + x)


def _squeeze_integral(x: Array) -> Array:
    """The integral of `_squeeze` from 0 to x."""
    small, rest = x**3 / 6 + x**4 / 24 + x**5 / 60 + x**6 / 120, 1 - x
    return np.where(x < 1e-2, small, (rest**2 - 1) / 4 + x**2 / 2 - rest**2 / 2 * np.log1p(-x))


def _strain(energy: Array) -> Array:
    """Inverse of `_squeeze`; NaN beyond 1, where no layer is left.

    It is convex and at least x^2 / 2, so that Newton comes down to it from sqrt(2 energy).
    """
    x = np.minimum(np.sqrt(2 * energy), 1 - 1e-16)
    for _ in range(STRAIN_STEPS):
        x = x + (_squeeze(x) - energy) / np.log1p(-x)
    return np.where(energy < 1, x, np.nan)


# A new one is a file that registers its table here.
COMPLIANCES = Kinds[Compliance](
    "condyle.compliances", LinearCompliance, HertzCompliance, FoundationCompliance
)
ContactCompliance = Annotated[Any, COMPLIANCES]
