"""Contacts of a plant FMU that lift and land, in C: what of `fmi_lifting.c` a mechanism fills.

The exported mechanism is without these contacts, as a run of `simulate` is in which they lift; its
question `lifting` says what unit pushes of theirs change. Which of rigid ones are active is a mode,
which changes at events; what compliant ones push with follows from the state.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from ..backends.c.emit import text as packaged_text
from ..errors import UnsupportedError
from ..mechanism import Mechanism
from ..mechanism.compliance import CurvedCompliance, FoundationCompliance, HertzCompliance
from ..mechanism.contact import Contact
from ..mechanism.home import characteristic_length
from ..simulation.plan import FreedContacts
from .catalogue import CEntry
from .exported import CArray, Exported
from .syntax import filled, identifiers, literal, packaged

QUESTION, IMPACT = "lifting", "impact"
RESULTS = (
    "acceleration contact_force gap gap_rate gap_bias gap_response q_response force_response "
    "wall_curvature"
)
OWN = frozenset(RESULTS.split()[3:])  # which are no variables
MOST = 12  # faces, of which all sets are tried


def require_exportable(lifting: FreedContacts) -> None:
    """Raises UnsupportedError for contacts that lift in simulations, and not in FMUs."""
    if lifting.kept.drives is not None:
        raise UnsupportedError(
            "contacts.kind: FMUs have no contacts that lift together with [drives]; leave one of "
            "both out, or simulate it"
        )
    if len(lifting.names) > MOST:
        raise UnsupportedError(
            f"contacts.kind: at most {MOST} faces of contacts lift in FMUs, got "
            f"{len(lifting.names)}"
        )


def _rubs(lifting: FreedContacts) -> bool:
    """Whether landings have friction."""
    return not lifting.compliant and bool(lifting.friction.any())


def lifting_entries(lifting: FreedContacts) -> dict[str, CEntry]:
    """The questions of a mechanism, with the numbers of its contacts."""
    numbers = {name: value.tolist() for name, value in lifting.ports().items()}
    curved = tuple(
        i
        for i, one in enumerate(lifting.tables)
        if lifting.compliant
        and isinstance(one.compliance, CurvedCompliance)
        and not one.offset_surface.flat
    )
    entry = CEntry(
        "Forward dynamics without the contacts that lift, and what unit pushes of these change.",
        "q q1 effort force moment point",
        RESULTS,
        details=lambda wish: (lifting.forms, curved),
        limits=numbers,
    )
    if not _rubs(lifting):
        return {QUESTION: entry}
    impact = CEntry(
        "What impulses at the contacts that lift change.",
        "q q1",
        "velocity impulse_response q_response",
        details=lambda wish: (lifting.forms,),
        limits=numbers,
    )
    return {QUESTION: entry, IMPACT: impact}


def _labels(lifting: FreedContacts) -> tuple[str, ...]:
    """Names of faces: those of their contacts, with a side where there are two."""
    return tuple(
        f"{name}_{'low' if sign > 0 else 'high'}" if lifting.names.count(name) > 1 else name
        for name, sign in zip(lifting.names, lifting.push, strict=True)
    )


def lifting_arrays(lifting: FreedContacts, arrays: Mapping[str, CArray]) -> dict[str, CArray]:
    """Arrays of the plant, with those of its contacts in the place of the question's own."""
    found = {name: a for name, a in arrays.items() if name not in OWN}
    faces = identifiers(_labels(lifting)).values()
    contacts = lifting.kept.model.mechanism.contact_names

    def array(name: str, text: str, unit: str, labels: Iterable[str]) -> CArray:
        row = tuple(labels)
        return CArray(name, text, row, (unit,) * len(row), False)

    force = "contact forces on the platform, along the unit normals"
    found["contact_force"] = array("contact_force", force, "N", identifiers(contacts).values())
    found["gap"] = array(
        "gap", "how far a contact is open, negative where it is indented", "m", faces
    )
    if not lifting.compliant:
        found["active"] = array("active", "1 where a contact bears, 0 where it is open", "1", faces)
    passes = "passes zero where a contact lifts or lands: force or gap"
    found["event_indicator"] = array("event_indicator", passes, "1", faces)
    return found


def lifting_macros(
    lifting: FreedContacts, mechanism: Mechanism, places: Mapping[str, int]
) -> dict[str, object]:
    """Macros of `fmi.c`, and of the contacts' code."""
    return {
        "FACES": len(lifting.names),
        "INDICATORS": places["event_indicator"],
        "ACTIVE": places.get("active", 0),
        "RIGID": int(not lifting.compliant),
        "FRICTION": int(_rubs(lifting)),
        "LENGTH": literal(characteristic_length(mechanism), "double"),
    }


def lifting_code(lifting: FreedContacts, e: Exported, places: Mapping[str, int]) -> str:
    """The contacts' code, filled."""
    contacts = lifting.kept.model.mechanism.contacts
    held = [i for i in range(len(contacts)) if i not in lifting.contacts]
    function, names = e[QUESTION], {"contact_force": "force"}
    words = ["of"]
    for a in function.arguments:
        words.append(f"v + {places[a.name]}" if a.given else f"t->{names.get(a.name, a.name)}")
    law = "compliant" if lifting.compliant else "rigid"
    own: dict[str, object]
    if not lifting.compliant:
        own = {
            "elimination": packaged_text("elimination.h"),
            "restitution": _row(lifting.restitution),
            "landing": _landing(lifting, e, places),
        }
    else:
        own = {"laws": "".join(f"    {{{_law(one)}}},\n" for one in lifting.tables)}
    code = packaged("fmi_lifting.c")
    return filled(
        code,
        {
            **places,
            "free": len(e["motion"].inputs[0].labels),
            "held": len(held),
            "faces": len(lifting.names),
            "contacts": len(contacts),
            "push": _row(lifting.push),
            "contact_of": ", ".join(map(str, lifting.contacts)),
            "held_of": ", ".join(map(str, [*held, 0])),
            "call": f"{function.name}({', '.join(words)})",
            "law": filled(packaged(f"fmi_{law}.c"), own),
        },
    )


def _landing(lifting: FreedContacts, e: Exported, places: Mapping[str, int]) -> str:
    """Code of a landing."""
    if not _rubs(lifting):
        return packaged("fmi_landing.c")
    state = f"of, v + {places['q']}, v + {places['q1']}"
    words = {
        "friction": _row(lifting.friction),
        "impact": f"{e[IMPACT].name}({state}, velocity, response, q_response)",
    }
    return filled(packaged("fmi_friction.c"), words)


def _row(values: Iterable[float]) -> str:
    return ", ".join(literal(float(x), "double") for x in values)


def _law(contact: Contact) -> str:
    """A contact's law as its row in C: N = scale factor d^power."""
    law = contact.compliance
    assert law is not None
    shape, depth, along, across = "STIFF", 0.0, 0.0, 0.0
    power = law.exponent
    if isinstance(law, HertzCompliance):
        if law.length is not None:
            scale = math.pi / 4 * law.effective_modulus * law.length
        else:
            shape, scale = "ELLIPSE", math.sqrt(8) / 3 * math.pi * law.effective_modulus
    elif isinstance(law, FoundationCompliance):
        give, depth = law.thinning
        if law.length is not None:
            shape, scale = "LAYER_LINE", math.sqrt(2) * law.length / (0.75 * give)
        elif law.large_strain:
            shape, scale, power = "THICK_LAYER", 2 * math.pi * depth**2 / give, 0.0
        else:
            shape, scale = "LAYER", math.pi / give
    else:
        scale = float(law.patch(np.ones(1), np.zeros((1, 2))).stiffness[0])
    if isinstance(law, CurvedCompliance):
        along, across = law.ball_curvature(contact.ball_radius)
    radius = contact.ball_radius or 0.0
    numbers = (scale, power, law.damping, along, across, radius, depth)
    return f"{shape}, {_row(numbers)}"
