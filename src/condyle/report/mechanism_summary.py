"""What a mechanism is: freedoms, sizes, masses, gravity, limits, and singularity at home."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sized
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..analysis.map.free_space import QUICK, ball_around_home
from ..errors import SingularError
from ..kinematics.causes import Owner, singular_text
from ..kinematics.chain import FAMILIES
from ..kinematics.singularities import KINDS, SINGULAR, Singularity
from ..mechanism import as_mechanism
from ..mechanism.actuator import Limits
from ..mechanism.chain import limits
from ..mechanism.home import HOME_WARNING, home_residuals, home_warnings
from ..mechanism.mechanism import Contact, Mechanism
from ..mechanism.mechanism_checks import extent, length_text, mechanism_warnings
from ..mechanism.vocabulary import words_of
from ..model.contact_patches import contact_patches
from ..model.model import Model
from ..results.contacts import contact_loss
from ..results.study_answer import StudyAnswer
from ..results.vibrations import HomeModes, home_modes
from .cell import write_picture


@dataclass(frozen=True)
class MechanismSummary(StudyAnswer):
    """A mechanism at home, in its own words; its table is of the chains."""

    mechanism: Mechanism
    facts: dict[str, Any]
    home_warnings: tuple[str, ...]

    @property
    def data(self) -> dict[str, Any]:
        return self.facts

    @property
    def columns(self) -> dict[str, list[Any]]:
        chains = self.facts["chains"]
        keys = ("kind", "joint_unit", "effort_unit", "transmission")
        return {"chain": [*chains]} | {k: [one[k] for one in chains.values()] for k in keys}

    @property
    def warnings(self) -> list[str]:
        """What looks wrong about it."""
        texts = [*self.home_warnings, *(one["message"] for one in self.data["warnings"])]
        return list(map(words_of(self.mechanism), texts))

    def __str__(self) -> str:
        d, say = self.data, words_of(self.mechanism)
        texts = {"contacts": _contact, "ligaments": _ligament, "walls": _wall}
        width = max(len(name) for part in ("chains", *texts) for name in d[part])
        return "\n".join(
            [
                *_overview(d, say),
                say("chains (transmission: the lever arm on the rod, 1 at best, 0 in line)"),
                *(f"  {name:<{width}}  {say(_chain(row))}" for name, row in d["chains"].items()),
                *(
                    line
                    for part, text in texts.items()
                    if d[part]
                    for line in (
                        say(part),
                        *(f"  {n:<{width}}  {say(text(x))}" for n, x in d[part].items()),
                    )
                ),
                *map(say, _singularity(d)),
                *([str(HomeModes(d["vibrations"]))] if d["vibrations"] else []),
            ]
        )


def _overview(d: Mapping[str, Any], say: Callable[[str], str]) -> Iterator[str]:
    counts = f"{_count(d['chains'], 'chain')}, {_count(d['contacts'], 'contact')}, "
    counts += f"{d['degrees_of_freedom']} degrees of freedom, actuation redundancy"
    yield f"{d['name']}: {say(counts)} {d['redundancy']}"
    yield f"independent coordinates: {', '.join(map(say, d['independent']))}"
    yield f"dependent coordinates:   {', '.join(map(say, d['dependent'])) or 'none'}"
    yield f"gravity:                 {_gravity(d['gravity'])}"
    radii = ", ".join(length_text(radius) for radius in d["platform"]["radii_of_gyration"])
    yield f"{say('platform') + ':':<24} {d['platform']['mass']:g} kg, radii of gyration {radii}"
    yield f"moving mass:             {d['moving_mass']:g} kg {say('with the chains')}"
    sides = " x ".join(length_text(side) for side in d["size"])
    yield f"size at home:            {sides} (X x Y x Z, all joints and points)"
    yield (
        f"characteristic length:   {length_text(d['characteristic_length'])} "
        f"({say('mean distance of platform joints and contact points from O_M')})"
    )


def _gravity(gravity: list[float]) -> str:
    """'9.81 m/s^2 along -Z', or with the components where it is along none."""
    size = float(np.linalg.norm(gravity))
    if not size:
        return "none"
    k = int(np.argmax(np.abs(gravity)))
    if abs(gravity[k]) > (1 - 1e-9) * size:
        return f"{size:g} m/s^2 along {'-' if gravity[k] < 0 else '+'}{'XYZ'[k]}"
    return f"{size:g} m/s^2, [{', '.join(f'{g:g}' for g in gravity)}] in {{S}}"


def _chain(chain: Mapping[str, Any]) -> str:
    facts = []
    for name in dict.fromkeys([*chain["lengths"], *chain["masses"]]):
        length, mass = chain["lengths"].get(name), chain["masses"].get(name)
        said = [length_text(length)] if length is not None else []
        said += [f"{mass:g} kg"] if mass is not None else []
        facts.append(" ".join([name, *said]))
    effort, joint = chain["effort_unit"], chain["joint_unit"]
    bounds = [_effort_limit(chain["effort_limit"], effort)] if chain["effort_limit"] else []
    if chain["speed_limit"] is not None:
        bounds.append(f"{chain['speed_limit']:g} {joint}/s")
    facts.append(f"limits {', '.join(bounds)}" if bounds else "no limits")
    facts += _losses(chain["losses"], effort, joint)
    return (
        f"{chain['kind']}, {', '.join(facts)}, joint [{joint}], effort [{effort}], "
        f"transmission at home {chain['transmission']:+.4f}"
    )


def _effort_limit(limit: float | list[float | None], unit: str) -> str:
    """'3 N m' for both directions, '0 to 190.4 N', 'at least 0 N'."""
    if not isinstance(limit, list):
        return f"{limit:g} {unit}"
    low, high = limit
    known = Limits(-np.inf if low is None else low, np.inf if high is None else high, np.inf)
    return known.effort_text(unit)


def _losses(losses: Mapping[str, float], effort: str, joint: str) -> Iterator[str]:
    """What the actuator keeps of its effort, as far as it keeps any."""
    if losses["rotor_inertia"]:
        inertia = "kg m^2" if joint == "rad" else "kg"
        yield (
            f"rotor {losses['rotor_inertia']:g} kg m^2 with gear {losses['gear']:g} "
            f"({losses['reflected_inertia']:.4g} {inertia} at the joint)"
        )
    if losses["viscous"]:
        yield f"viscous {losses['viscous']:g} {effort} s/{joint}"
    if losses["coulomb"]:
        yield (
            f"Coulomb {losses['coulomb']:g} {effort}, fading below "
            f"{losses['smoothing_speed']:g} {joint}/s"
        )
    if losses["zero"]:
        yield f"encoder reads {losses['zero']:g} {joint} at home"


def _contact(contact: Mapping[str, Any]) -> str:
    ball, off = contact["ball_radius"], contact["residual"]
    options = [f", {contact['side']}"] if contact["side"] else []
    options += [f", ball of radius {length_text(ball)}"] if ball is not None else []
    options += [", unilateral"] if contact["one_sided"] else []
    if (friction := contact["friction"])["coefficient"]:
        options.append(
            f", friction {friction['coefficient']:g} fading below "
            f"{friction['smoothing_speed']:g} m/s"
        )
    if abs(off) > HOME_WARNING:
        place = f"{off * 1e3:+.2g} mm off its surface at home"
    else:  # what is left is rounding
        place = "on its surface at home"
    return f"{contact['kind']}{''.join(options)}, {place}{_held_text(contact['held'])}"


def _held_text(held: Mapping[str, Any] | None) -> str:
    """What holding the platform at home against gravity asks of a contact that lifts or gives."""
    if held is None or held["force"] is None:
        return ""
    size = f"{abs(held['force']):.3g} N"
    if held["lost"]:
        return f", held against gravity: would pull {size}, so it lifts"
    text = f", held against gravity: {size}"
    if held["indentation"] is None:
        return text
    if not held["indentation"]:
        return ", not pressed at home"
    text += f", {held['indentation'] * 1e3:.2g} mm"
    if held["peak_pressure"] is None:
        return f"{text} deep"
    area, pressure = held["contact_area"] * 1e6, held["peak_pressure"] * 1e-6
    return f"{text} deep on {area:.3g} mm^2, peak pressure {pressure:.3g} MPa"


def _ligament(ligament: Mapping[str, Any]) -> str:
    strain = ligament["strain"]
    state = f"strain {strain:.3g}" if strain > 0 else "slack"
    return f"line {length_text(ligament['length'])}, {state} at home"


def _wall(wall: Mapping[str, Any]) -> str:
    gap = 0.0 if abs(wall["gap"]) < HOME_WARNING else wall["gap"]
    off = "" if wall["enabled"] else ", off"
    return f"gap {length_text(gap)} at home, reach {length_text(wall['reach'])}{off}"


def _singularity(d: Mapping[str, Any]) -> Iterator[str]:
    s = d["singularity"]
    sigma = ", ".join(f"{v:.4g}" for v in s["J_W_sigma"])
    yield "singularity at home (dimensionless)"
    yield (
        f"  J_W: rank {s['J_W_rank']} of {d['degrees_of_freedom']}, singular values {sigma}, "
        f"condition {s['J_W_condition']:.4g}"
    )
    yield f"  J_A: smallest over largest {s['J_A_ratio']:.4g}"
    change = s["length_sensitivity"]
    if abs(change) > 1e-3:
        yield f"  smaller ratio: {change:+.2g} % per 1 % of characteristic length"
    else:
        yield "  smaller ratio: independent of the characteristic length"
    yield f"  near: {s['near']}"
    room = d["room"]
    settled = room["radius"] == room["at_most"]
    ends = f"ends at {room['ends_at']}"
    if not settled:
        ends = f"not settled in {QUICK:g} s: at most {length_text(room['at_most'])}"
    yield (
        f"room around home: a ball of {length_text(room['radius'])} (angles times the "
        f"characteristic length), off singularities and within bounds, {ends}; "
        f"{room['points']} points, {length_text(room['spacing'])} apart"
    )


def _count(items: Sized, word: str) -> str:
    return f"{len(items)} {word}" + "s" * (len(items) != 1)


def check(mechanism: Any, picture: str | os.PathLike[str] | None = None) -> MechanismSummary:
    """The summary of a mechanism at home, with warnings of implausible numbers.

    Args:
        mechanism: one, a model, the path of a file, or the name of a bundled one.
        picture: SVG file to draw home to; of a singular home with the motion that is free: its
            axis, and arrows at the platform's joints.

    Raises: MechanismError: with every mistake in its file.
            SingularError:  if it is singular at home, with the motion that is free.
    """
    mechanism = as_mechanism(mechanism)
    model = Model(mechanism, backend="numpy")  # one pose: building a kernel takes longer
    home = np.zeros((1, 6))
    s = model.poses.configuration(home).singularity
    _require_regular(model, s, picture)
    room = ball_around_home(model)
    m = mechanism.degrees_of_freedom
    platform = mechanism.platform
    chains = {
        chain.name: _chain_data(chain) | {"transmission": float(s.transmission[0, i])}
        for i, chain in enumerate(mechanism.chains)
    }
    rods = sum(mass for chain in chains.values() for mass in chain["masses"].values())
    pairs = zip(mechanism.contacts, home_residuals(mechanism), strict=True)
    return MechanismSummary(
        mechanism,
        {
            "name": mechanism.name,
            "degrees_of_freedom": m,
            "redundancy": len(mechanism.chains) - m,
            "independent": list(model.independent),
            "dependent": list(model.dependent),
            "characteristic_length": s.length,
            "size": extent(mechanism).tolist(),
            "gravity": list(mechanism.gravity),
            "platform": {
                "mass": platform.mass,
                "radii_of_gyration": np.sqrt(platform.inertia.principal() / platform.mass).tolist(),
            },
            "moving_mass": platform.mass + rods,
            "chains": chains,
            "contacts": {
                contact.name: _contact_data(contact, off) | {"held": patch}
                for (contact, off), patch in zip(pairs, _held(model), strict=True)
            },
            "ligaments": {
                one.name: {"length": one.length, "strain": one.length / one.slack_length - 1}
                for one in mechanism.ligaments
            },
            "walls": {
                wall.name: {"gap": wall.gap, "reach": wall.reach, "enabled": wall.enabled}
                for wall in mechanism.walls
            },
            "singularity": {
                "J_W_sigma": [float(v) for v in s.J_W_sigma[0]],
                "J_W_rank": int(s.rank[0]),
                "J_W_condition": float(min(s.condition[0], 1e300)),
                "J_A_ratio": float(s.inverse_ratio[0]),
                "length_sensitivity": float(model.poses.length_sensitivity(home)[0]),
                "near": KINDS[int(s.kind()[0])],
            },
            "room": {
                "radius": room.radius,
                "at_most": room.at_most,
                "ends_at": room.stops,
                "points": room.points,
                "spacing": room.spacing,
            },
            "vibrations": home_modes(model).data if model.system.structure.gives else {},
            "warnings": [
                {"kind": found.kind, "message": found.message, **found.data}
                for found in mechanism_warnings(mechanism)
            ],
        },
        tuple(home_warnings(mechanism)),
    )


def _held(model: Model) -> list[dict[str, Any] | None]:
    """Each contact that lifts or gives its force, held against gravity at home, whether it is
    lost, and depth, area and pressure; None of other contacts, and of what is not known."""
    mechanism = model.mechanism
    asked = [bool(contact.one_sided or contact.compliance) for contact in mechanism.contacts]
    if not any(asked):
        return [None] * len(asked)
    home = np.zeros((1, len(model.independent)))
    force = model.inverse_dynamics(home, home, home).contact_force
    patch = contact_patches(mechanism, np.zeros((1, 6)), force)
    values = {
        "force": force,
        "indentation": patch.indentation,
        "contact_area": patch.area,
        "mean_pressure": patch.mean_pressure,
        "peak_pressure": patch.peak_pressure,
    }
    lost = contact_loss(mechanism, force)[0].tolist()
    return [
        {n: _finite(a[0, i]) for n, a in values.items()} | {"lost": lost[i]} if own else None
        for i, own in enumerate(asked)
    ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _require_regular(model: Model, s: Singularity, picture: str | os.PathLike[str] | None) -> None:
    """Draws home, and raises SingularError where efforts are not determined, as solutions do."""
    mechanism, regular = model.mechanism, s.ratio[0] > SINGULAR
    say = words_of(mechanism)
    name = mechanism.chain_names[int(np.argmin(np.abs(s.transmission[0])))]
    inverse = s.inverse_ratio[0] < SINGULAR
    owner = Owner("chain", (name,)) if inverse else Owner("platform")
    text = singular_text("home", float(s.ratio[0]), owner)
    free = None if regular or inverse else model.poses.free_motion(np.zeros(6))
    if free is not None:
        text += f": it {model.poses.free_motion_text(np.zeros(6))}"
    if picture is not None:
        write_picture(picture, mechanism, free, "" if regular else say(text))
    if regular:
        return
    hint = say("The efforts are not determined there; move the ends of chains or the contacts")
    if picture is not None:
        hint += f". {picture} shows home"
    elif free is not None:
        hint += "; --picture FILE.svg (picture=) draws this motion"
    raise SingularError(say(f"{text}."), hint=f"{hint}.", value=float(s.ratio[0]), bound=SINGULAR)


def _chain_data(chain: Any) -> dict[str, Any]:
    family, actuator, limit = FAMILIES[chain.kind], chain.actuator, limits(chain)
    ends = [v if np.isfinite(v) else None for v in (limit.low, limit.high)]
    losses = ["rotor_inertia", "gear", "reflected_inertia", "viscous", "coulomb", "smoothing_speed"]
    losses += ["zero"]
    return {
        "kind": chain.kind,
        "joint_unit": family.joint_unit,
        "effort_unit": family.effort_unit,
        "lengths": chain.lengths,
        "masses": chain.masses,
        # One number where it is the same both ways, else [least, greatest] with None for no limit.
        "effort_limit": (limit.high if limit.symmetric else ends) if limit.limited else None,
        "speed_limit": actuator.speed_limit,
        "losses": {name: getattr(actuator, name) for name in losses},
    }


def _contact_data(contact: Contact, residual: float) -> dict[str, Any]:
    return {
        "kind": contact.surface.kind,
        "side": contact.side,
        "ball_radius": contact.ball_radius,
        "one_sided": contact.one_sided,
        "friction": contact.friction.entries(),
        "residual": float(residual),
    }
