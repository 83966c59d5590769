"""Checks of a mechanism: values that are valid and suggest a wrong unit or sign.

They are warnings, since they may be intended; each has a kind for programs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..errors import join
from .bodies import Platform
from .chain import limits
from .home import Parts, characteristic_length
from .ligament import Ligament

LARGE, SMALL = 10.0, 1e-4  # metres
EARTH, EARTH_SPREAD = 9.81, 0.06  # m/s^2: 9.76 at the equator's mountains, 9.83 at the poles
DENSEST = 2e4  # kg/m^3 of a cube as large as the mechanism; nearly osmium
SOUND = 340.0  # m/s
ROUGHEST = 2.0  # coefficient of friction: hardly any pair has more
POINTLIKE = 3e-3  # radius of gyration over the platform's own size
ROUNDING = 1e-12  # metres outside a bound
TORN = 0.5  # strain of a ligament at home: tissue tears at less


class CheckedMechanism(Parts, Protocol):
    """A mechanism, as far as its checks read it."""

    @property
    def platform(self) -> Platform: ...
    @property
    def gravity(self) -> tuple[float, ...]: ...
    @property
    def ligaments(self) -> tuple[Ligament, ...]: ...


@dataclass(frozen=True)
class CheckWarning:
    """A warning; `str` for people.

    kind: one word for programs, the same for ever;  data: the numbers of the message, SI.
    """

    kind: str
    message: str
    data: Mapping[str, Any] = field(default_factory=dict)

    def __str__(self) -> str:
        return self.message


def mechanism_warnings(mechanism: CheckedMechanism) -> list[CheckWarning]:
    """Sizes, masses, gravity, limits and bounds that look like a slip of units or of a sign."""
    return [
        *_sizes(mechanism),
        *_platform(mechanism),
        *_rods(mechanism),
        *_gravity(mechanism),
        *_speeds(mechanism),
        *_losses(mechanism),
        *_friction(mechanism),
        *_bounds(mechanism),
        *_ligaments(mechanism),
    ]


def extent(mechanism: CheckedMechanism) -> np.ndarray:
    """Sides of the box around all points of the mechanism at home, (3,) [m]."""
    points = [*platform_points(mechanism)]
    points += [point for chain in mechanism.chains for point in chain.fixed_points]
    return np.ptp(np.array(points), axis=0)


def platform_points(mechanism: CheckedMechanism) -> list[tuple[float, ...]]:
    """Joints, contacts and landmarks of the platform, in {M} [m]."""
    points: list[tuple[float, ...]] = [chain.platform for chain in mechanism.chains]
    return [*points, *(c.point for c in mechanism.contacts), *mechanism.platform.points.values()]


def length_text(metres: float) -> str:
    """A length as people say it: millimetres, and metres from ten on."""
    return f"{metres:.4g} m" if abs(metres) >= LARGE else f"{metres * 1e3:.4g} mm"


def _beyond(
    kind: str, text: str, values: Mapping[str, Any], show: str, key: str, what: str = "chain"
) -> Iterator[CheckWarning]:
    """One warning for all parts that share a problem.

    Args: text: of the message, with {} for the list;  show: a name and its numbers in it.
    """
    if values:
        numbers = {n: v if isinstance(v, list) else [v] for n, v in values.items()}
        listed = join(show.format(*v, name=f'{what} "{n}"') for n, v in numbers.items())
        yield CheckWarning(kind, text.format(listed), {key: values})


def _sizes(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    overall = {"the characteristic length": characteristic_length(mechanism)}
    parts = {
        f'the {name} of chain "{chain.name}"': length
        for chain in mechanism.chains
        for name, length in chain.lengths.items()
    } | {
        f'the ball of contact "{contact.name}"': contact.ball_radius
        for contact in mechanism.contacts
        if contact.ball_radius is not None
    }
    slips = {
        "length_large": 'are these millimetres in a file of length_unit "m"?',
        "length_small": 'are these metres in a file of length_unit "mm"?',
    }
    for lengths in (overall, parts):
        large = {name: v for name, v in lengths.items() if v > LARGE}
        small = {name: v for name, v in lengths.items() if v < SMALL}
        for (kind, question), some in zip(slips.items(), (large, small), strict=True):
            if some:
                listed = join(f"{name} {length_text(v)}" for name, v in some.items())
                yield CheckWarning(kind, f"lengths: {listed}; {question}", {"lengths": some})
        if large or small:
            return


def _platform(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    mass = mechanism.platform.mass
    gyration = float(np.sqrt(mechanism.platform.inertia.principal()[-1] / mass))
    size = float(np.linalg.norm(platform_points(mechanism), axis=1).max())
    overall = max(float(extent(mechanism).max()), size)
    data = {"gyration": gyration, "size": size, "mass": mass}
    if gyration > overall:
        yield CheckWarning(
            "gyration_large",
            f"platform: its radius of gyration, {length_text(gyration)}, is beyond the size of the "
            f"mechanism, {length_text(overall)}; inertia is in kg m^2 and mass in kg, whatever the "
            "length_unit",
            data,
        )
    elif gyration < POINTLIKE * size:
        yield CheckWarning(
            "gyration_small",
            f"platform: its radius of gyration is {length_text(gyration)}, and its joints are up "
            f"to {length_text(size)} from its mass centre; inertia is in kg m^2",
            data,
        )
    most = DENSEST * overall**3
    if mass > most:
        yield CheckWarning(
            "mass_large",
            f"platform: {mass:g} kg in a mechanism of {length_text(overall)} is denser than any "
            "metal; mass is in kg",
            data,
        )


def _rods(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    beyond = {
        f'{name} of chain "{chain.name}"': (radius, chain.lengths[name])
        for chain in mechanism.chains
        for name, radius in chain.radii_of_gyration.items()
        if radius > chain.lengths[name]
    }
    if beyond:
        listed = join(
            f"the {name} {length_text(radius)} (it is {length_text(length)} long)"
            for name, (radius, length) in beyond.items()
        )
        yield CheckWarning(
            "rod_gyration",
            f"radius of gyration beyond the body's length: {listed}; transverse is in kg m^2",
            {"rods": {name: list(pair) for name, pair in beyond.items()}},
        )


def _gravity(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    gravity = np.array(mechanism.gravity)
    size = float(np.linalg.norm(gravity))
    data = {"gravity": list(mechanism.gravity)}
    if size and abs(size - EARTH) > EARTH_SPREAD:
        yield CheckWarning(
            "gravity_size", f"gravity: {size:g} m/s^2 is neither the Earth's 9.81 nor none", data
        )
    if gravity[2] > 0.5 * size:
        yield CheckWarning(
            "gravity_upwards", "gravity: it points up, along +Z; down is negative", data
        )


def _speeds(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    # rad/s of a crank, else m/s
    speeds = {c.name: limits(c).speed * c.lengths.get("crank", 1.0) for c in mechanism.chains}
    beyond = {name: v for name, v in speeds.items() if SOUND < v < np.inf}
    text = "speed_limit: beyond the speed of sound: {}"
    yield from _beyond("speed_limit", text, beyond, "{name} {:.4g} m/s", "speeds")


def _losses(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    """Actuators that cannot overcome their own friction, or whose friction never acts in full."""
    stuck, fading = {}, {}
    for chain in mechanism.chains:
        own, limit = chain.actuator, limits(chain)
        if own.coulomb >= limit.greatest:
            stuck[chain.name] = [own.coulomb, limit.greatest]
        if own.coulomb and own.smoothing_speed >= limit.speed:
            fading[chain.name] = [own.smoothing_speed, limit.speed]
    show = "{name} {:g} of {:g}"
    text = "coulomb: no less than the greatest effort: {}; such an actuator moves nothing"
    yield from _beyond("coulomb_large", text, stuck, show, "chains")
    text = "smoothing_speed: no less than the speed limit: {}; friction never acts in full"
    yield from _beyond("smoothing_large", text, fading, show, "chains")


def _friction(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    found = {contact.name: contact.friction.coefficient for contact in mechanism.contacts}
    large = {name: mu for name, mu in found.items() if mu > ROUGHEST}
    text = f"friction: a coefficient above {ROUGHEST:g}: {{}}; is it a percentage?"
    yield from _beyond("friction_large", text, large, "{name} {:g}", "contacts", "contact")


def _bounds(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    for contact in mechanism.contacts:
        bounds = contact.bounds.entries()
        if not contact.surface.known or not any(bounds.values()):
            continue
        for axis, value in zip("xyz", contact.touching_point, strict=True):
            low, high = bounds[axis] or (-np.inf, np.inf)
            if value < low - ROUNDING or value > high + ROUNDING:
                yield CheckWarning(
                    "home_outside_bounds",
                    f'contact "{contact.name}": home is outside its bounds: {axis} is '
                    f"{value * 1e3:.6g} mm, and the surface goes from {low * 1e3:.6g} to "
                    f"{high * 1e3:.6g} mm",
                    {"contact": contact.name, "axis": axis, "value": value, "bounds": [low, high]},
                )


def _ligaments(mechanism: CheckedMechanism) -> Iterator[CheckWarning]:
    strains = {one.name: one.length / one.slack_length - 1 for one in mechanism.ligaments}
    torn = {name: strain for name, strain in strains.items() if strain > TORN}
    text = f"slack_length: a strain above {TORN:g} at home: {{}}; is the slack length too short?"
    yield from _beyond("ligament_torn", text, torn, "{name} {:.3g}", "ligaments", "ligament")
