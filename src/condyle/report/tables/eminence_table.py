"""How near the condyles, as markers have them, are to their surfaces; and this subject's own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.session.subject_eminence import BITE
from ...markers.eminence import FittedProfile
from ...model.distributing import Distribution
from ...results.report_table import NOTHING, Cell, ReportTable

if TYPE_CHECKING:
    from ...analysis.session import SolvedSession


def eminence_tables(session: SolvedSession) -> list[ReportTable]:
    """Distances of the balls from their surfaces; with [eminence] what it came to."""
    distances = [distance_table(session)] if session.mechanism.contacts else []
    if session.subject.eminence is None:
        return distances
    return [*distances, slope_table(session), profile_table(session)]


def distance_table(session: SolvedSession) -> ReportTable:
    """Distances of every trial and contact, before the pose was moved onto the contacts."""
    records = [
        {"trial": one.trial.name, "contact": name, "rms": rms, "largest": largest}
        for one in session.trials
        for name, (rms, largest) in one.motion.off_contacts.items()
    ]
    cells: dict[str, Cell] = {
        "Trial": "trial",
        "Joint": "contact",
        "RMS [mm]": _scaled("rms", 1e3),
        "largest [mm]": _scaled("largest", 1e3),
    }
    notes = [
        "Of each ball, as the platform's markers have it, from its surface, along the normal: what "
        "the surface, the registration and the markers leave.",
    ]
    return ReportTable.of(
        "surfaces", "Distance of the joints from their surfaces", records, cells, notes
    )


def slope_table(session: SolvedSession) -> ReportTable:
    """Slopes fitted to the paths of the balls, and what they change of a bite at rest."""
    eminence = session.subject.eminence
    assert eminence is not None
    how = session.file.solve
    name: Any = how.distribution
    chosen = Distribution(name, how.preload, how.contact_weight, how.emg_weight)
    point, loads = eminence.loads(chosen)
    records = []
    for k, contact in enumerate(eminence.mechanism.contacts):
        record: dict[str, Any] = {"contact": contact.name}
        if eminence.fitted is not None:
            fit = eminence.fitted[contact.name]
            record |= {"slope": fit.slope, "deviation": fit.deviation}
            record |= {"travel": fit.travel, "off": fit.off}
            record |= {f"slope_{trial}": slope for trial, slope in fit.by_trial.items()}
        record |= {f"load_{word}": float(values[k]) for word, values in loads.items()}
        records.append(record)
    cells: dict[str, Cell] = {"Joint": "contact"}
    if eminence.fitted is not None:
        cells |= {
            "Slope [°]": _scaled("slope", np.degrees(1)),
            "SD": _scaled("deviation", np.degrees(1)),
        }
        cells |= {"Travel [mm]": _scaled("travel", 1e3), "Off it, RMS [mm]": _scaled("off", 1e3)}
        for trial in dict.fromkeys(t for fit in eminence.fitted.values() for t in fit.by_trial):
            cells[f"{trial} [°]"] = _scaled(f"slope_{trial}", np.degrees(1))
    cells |= {f"Load, {word} [N]": _scaled(f"load_{word}") for word in loads}
    notes = []
    if eminence.fitted is not None:
        notes.append(
            "Slope: of the line nearest to the path of the ball, or of its profile at home, "
            "falling forward; SD: the larger of what it leaves and of the spread between trials."
        )
    if loads:
        notes.append(
            f"Newtons: joint loads of {BITE:g} N on {point} at rest, on the mechanism's surfaces "
            "and on those used."
        )
    return ReportTable.of("eminence", "This subject's eminence", records, cells, notes)


def profile_table(session: SolvedSession) -> ReportTable:
    """Points of the fitted profiles; none of slopes."""
    assert session.subject.eminence is not None
    records = [
        {"contact": name, "forward": x, "down": down, "deviation": deviation}
        for name, fit in (session.subject.eminence.fitted or {}).items()
        if isinstance(fit, FittedProfile)
        for x, down, deviation in np.column_stack([fit.forward, fit.down, fit.deviations]).tolist()
    ]
    cells: dict[str, Cell] = {"Joint": "contact", "Forward [mm]": _scaled("forward", 1e3)}
    cells |= {"Down [mm]": _scaled("down", 1e3), "SD [mm]": _scaled("deviation", 1e3)}
    notes = [
        "From the ball at home; beyond the last points the surface goes on straight. SD: the "
        "larger of what the curve leaves and of the spread between trials.",
    ]
    return ReportTable.of("profiles", "Fitted profiles of the joints", records, cells, notes)


def _scaled(key: str, factor: float = 1.0) -> Cell:
    """A number of a record in another unit; nothing where the record has none."""
    return lambda record: f"{factor * record[key]:.3g}" if key in record else NOTHING
