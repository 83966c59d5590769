"""What a session tells, as tables for a paper: recordings, trials, muscles or actuators."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...results.report_table import NOTHING, Cell, ReportTable
from .eminence_table import eminence_tables

if TYPE_CHECKING:
    from ...analysis.session import SolvedSession, SolvedTrial

MOST = 12  # chains that people are shown; the CSV has all
ALL = "all"
MEANS = "± is the standard deviation over the cycles; joint loads and efforts by size."


def session_tables(session: SolvedSession) -> list[ReportTable]:
    """All of them."""
    return [
        recording_table(session),
        marker_table(session),
        trial_table(session),
        effort_table(session),
        *eminence_tables(session),
    ]


def recording_table(session: SolvedSession) -> ReportTable:
    """How well each recording fits: markers in their bodies, registration, gaps, contacts."""
    records = [_recording(one) for one in session.trials]
    cells: dict[str, Cell] = {
        "Trial": "trial",
        "Frames": "frames",
        "Time [s]": "seconds:.4g",
        "In bodies [mm]": _mm("marker_rms"),
        "Registration [mm]": _mm("registration_largest"),
        "Between trials [mm]": _mm("fixed_markers_moved"),
        "Before contacts [mm]": _mm("before_contacts_rms"),
        "On contacts [mm]": _mm("on_contacts_rms"),
        "Tilt [°]": lambda record: f"{np.degrees(record['tilt']):.3g}",
        "Head [N]": "inertia_force_largest:.2g",
        "Gaps": "gaps",
        "Without a result": "samples_without_result",
    }
    notes = [
        "Markers, root mean squares: distance from their place in their body; between trials, of "
        "the fixed ones from where the first trial has them in {S}; of the platform's from the "
        "pose before the contacts, and from the nearest on them. Registration: largest of a point.",
        "Tilt: largest angle between the recording's vertical and the mechanism's; head: largest "
        "inertia force of the platform from the head's motion.",
    ]
    notes += [] if session.scaled is None else str(session.scaled).splitlines()
    return ReportTable.of("recordings", "Recordings", records, cells, [n.strip() for n in notes])


def marker_table(session: SolvedSession) -> ReportTable:
    """Every marker in every trial; people see the worst."""
    records = [record for one in session.trials for record in _markers(one)]
    cells: dict[str, Cell] = {
        "Trial": "trial",
        "Marker": "marker",
        "Body": "body",
        "Seen": "seen:.0%",
        "In body RMS [mm]": _mm("rms"),
        "largest [mm]": _mm("largest"),
        "Before contacts RMS [mm]": _mm("before_rms"),
        "largest [mm] ": _mm("before_largest"),
        "On contacts RMS [mm]": _mm("after_rms"),
        "largest [mm]  ": _mm("after_largest"),
    }
    worst = np.argsort([-(record["rms"] or 0.0) for record in records], kind="stable")[:MOST]
    notes = [f"The {MOST} worst of {len(records)}; the CSV file has all."] * (len(records) > MOST)
    return ReportTable.of("markers", "Markers", records, cells, notes, sorted(worst.tolist()))


def trial_table(session: SolvedSession) -> ReportTable:
    """Duration, joint loads and the load of each trial's cycles."""
    contacts, words = session.mechanism.contact_names, session.file.words
    wanted = ["duration"]
    if session.file.cycles is not None:
        wanted.append(f"range_{session.file.cycles.by}")
    for name in (*(f"contact_{c}" for c in contacts), "load"):
        wanted += [f"peak_{name}", f"impulse_{name}"]
    records = []
    for one in session.trials:
        known = {word: one.trial.words.get(word, "") for word in words}
        records.append({"trial": one.trial.name, **known} | _means([one], wanted))
    for subject in dict.fromkeys(one.trial.subject for one in session.trials):
        mine = [one for one in session.trials if one.trial.subject == subject]
        if len(mine) > 1:
            known = dict.fromkeys(words, "") | ({"subject": subject} if subject else {})
            records.append({"trial": ALL, **known} | _means(mine, wanted))
    cells: dict[str, Cell] = {"Trial": "trial", **{w.capitalize(): _word(w) for w in words}}
    cells |= {"Cycles": "cycles", "Duration [s]": _pair("duration")}
    for contact in contacts:
        cells[f"{contact}: peak [N]"] = _pair(f"peak_contact_{contact}")
        cells[f"{contact}: impulse [N s]"] = _pair(f"impulse_contact_{contact}")
    if any(record["peak_load_mean"] for record in records):
        cells |= {
            "Load: peak [N]": _pair("peak_load"),
            "Load: impulse [N s]": _pair("impulse_load"),
        }
    return ReportTable.of("trials", "Cycles of each trial: mean ± SD", records, cells, [MEANS])


def effort_table(session: SolvedSession) -> ReportTable:
    """Peaks of each chain's effort in each trial's cycles; people see the largest."""
    trials, chains = session.trials, session.mechanism.chain_names
    found = [_means([one], [f"peak_tau_{c}" for c in chains]) for one in trials]
    records: list[dict[str, Any]] = []
    for chain in chains:
        record: dict[str, Any] = {"chain": chain}
        for one, means in zip(trials, found, strict=True):
            for word in ("mean", "sd"):
                record[f"{one.trial.name}_{word}"] = means[f"peak_tau_{chain}_{word}"]
        records.append(record)
    units = {str(unit) for unit in trials[0].solution["effort_unit"].values}
    unit = units.pop() if len(units) == 1 else "N or N m"
    cells: dict[str, Cell] = {"Chain": "chain"}
    cells |= {f"{one.trial.name} [{unit}]": _pair(one.trial.name) for one in trials}
    size = [max((r[f"{t.trial.name}_mean"] or 0.0 for t in trials), default=0.0) for r in records]
    shown = sorted(np.argsort(-np.array(size), kind="stable")[:MOST].tolist())
    notes = [MEANS]
    if len(records) > MOST:
        notes.append(f"The {MOST} largest of {len(records)}; the CSV file has all.")
    return ReportTable.of("efforts", "Peak efforts: mean ± SD", records, cells, notes, shown)


def cycle_columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """A row for each cycle, by column."""
    return {name: _column([row[name] for row in rows]) for name in (rows[0] if rows else ())}


def _column(values: list[Any]) -> list[Any]:
    """Words that are numbers throughout stay numbers; else all are text, and missing ones empty."""
    if all(v is None or (isinstance(v, int | float) and not isinstance(v, bool)) for v in values):
        return [float("nan") if v is None else v for v in values]
    return ["" if v is None else str(v).lower() if isinstance(v, bool) else str(v) for v in values]


def _recording(one: SolvedTrial) -> dict[str, Any]:
    motion, vertical = one.motion, one.motion.vertical.data()
    rms = np.array([r.rms for r in motion.residuals])
    every = motion.markers_moved.get("all", {})
    return {
        "trial": one.trial.name,
        "frames": len(motion.recording.t),
        "seconds": float(motion.motion.t[-1] - motion.motion.t[0]),
        "marker_rms": float(np.sqrt(np.nanmean(rms**2))),
        "registration_largest": max(motion.registration.residual.values(), default=None),
        "fixed_markers_moved": one.moved,
        "before_contacts_rms": every.get("before_rms"),
        "on_contacts_rms": every.get("after_rms"),
        "on_contacts_largest": every.get("after_largest"),
        "tilt": vertical["tilt"]["largest"],
        "inertia_force_largest": vertical["inertia_force"]["largest"],
        "gaps": len(motion.gaps),
        "samples_without_result": int((one.solution["status"].values != 0).sum()),
    }


def _markers(one: SolvedTrial) -> list[dict[str, Any]]:
    """Distances [m] of every marker of a trial from its place."""
    keys = ("before_rms", "before_largest", "after_rms", "after_largest")
    return [
        {"trial": one.trial.name, "marker": r.name, "body": r.body, "seen": r.seen}
        | {"rms": _known(r.rms), "largest": _known(r.largest)}
        | {key: one.motion.markers_moved.get(r.name, {}).get(key) for key in keys}
        for r in one.motion.residuals
    ]


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _means(trials: Sequence[SolvedTrial], names: Iterable[str]) -> dict[str, Any]:
    """Number of whole cycles of trials, mean and standard deviation of measures over them."""
    rows = [row for one in trials for row in one.rows if not row["samples_without_result"]]
    found: dict[str, Any] = {"cycles": len(rows)}
    for name in names:
        values = [row[name] for row in rows if row[name] is not None]
        found[f"{name}_mean"] = float(np.mean(values)) if values else None
        found[f"{name}_sd"] = float(np.std(values, ddof=1)) if len(values) > 1 else None
    return found


def _pair(name: str) -> Cell:
    """'12.3 ± 0.4'."""

    def cell(record: dict[str, Any]) -> str:
        mean, sd = record[f"{name}_mean"], record[f"{name}_sd"]
        if mean is None:
            return NOTHING
        return f"{mean:.3g}" if sd is None else f"{mean:.3g} ± {sd:.2g}"

    return cell


def _mm(name: str) -> Cell:
    return lambda record: NOTHING if record[name] is None else f"{record[name] * 1e3:.3g}"


def _word(name: str) -> Cell:
    return lambda record: str(record[name]) or NOTHING
