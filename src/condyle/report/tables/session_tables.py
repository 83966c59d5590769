"""What a session tells, as tables for a paper: recordings, trials, muscles or actuators."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...analysis.session.cycle_finding import PHASES
from ...analysis.session.jaw_measures import UNITS, bonwill
from ...analysis.session.solved_session import ALL
from ...analysis.sweep.bands import quantiles
from ...markers.session_file import JAW_MEASURES
from ...mechanism.vocabulary import words_of
from ...results.emg_followed import emg_and_activation
from ...results.report_table import NOTHING, Cell, ReportTable
from .eminence_table import eminence_tables

if TYPE_CHECKING:
    from ...analysis.session import SolvedSession, SolvedTrial

MOST = 12  # chains that people are shown; the CSV has all
EMG = ("lag", "rmse", "r2")
MEANS = "± is the standard deviation over the cycles; efforts by size."


def session_tables(session: SolvedSession) -> list[ReportTable]:
    """All that have something in them, in the words of the mechanism."""
    made = (
        *(recording_table, registration_table, marker_table),
        *(trial_table, measure_table, effort_table, emg_table),
    )
    tables = [make(session) for make in made] + eminence_tables(session)
    say = words_of(session.mechanism)
    return [table.in_words(say) for table in tables if table.records]


def recording_table(session: SolvedSession) -> ReportTable:
    """How well each recording fits: markers in their bodies, registration, gaps, contacts."""
    trimmed = {"trimmed": session.file.trim}
    records = [_recording(one) | trimmed for one in session.trials]
    cells: dict[str, Cell] = {
        "Trial": "trial",
        "Frames": "frames",
        "Time [s]": "seconds:.4g",
        "Trimmed [s]": "trimmed:.3g",
        "In bodies [mm]": _mm("marker_rms"),
        "Registration [mm]": _mm("registration_largest"),
        "Between trials [mm]": _mm("fixed_markers_moved"),
        "Before contacts [mm]": _mm("before_contacts_rms"),
        "On contacts [mm]": _mm("on_contacts_rms"),
        "Closures [mm]": _mm("closure_step"),
        "Tilt [°]": lambda record: f"{np.degrees(record['tilt']):.3g}",
        "Head [N]": "inertia_force_largest:.2g",
        "Gaps": "gaps",
        "Without a result": "samples_without_result",
    }
    notes = [
        "Markers, root mean squares: distance from their place in their body; between trials, of "
        "the fixed ones from where the first trial has them in {S}; of the platform's from the "
        "pose before the contacts, and from the nearest on them. Registration: largest of a point.",
        "Closures: largest step between closures before a time and after it, of the platform's "
        "markers; a splint that slips shows here.",
        "Tilt: largest angle between the recording's vertical and the mechanism's; head: largest "
        "inertia force of the platform from the head's motion.",
        "Trimmed: off both ends of the recording, and of each interval between gaps: half a period "
        "of the slowest filter, where noise of accelerations is up to 7 times that in the middle.",
    ]
    return ReportTable.of("recordings", "Recordings", records, cells, notes)


def registration_table(session: SolvedSession) -> ReportTable:
    """Every registered point; people see each registration once."""
    unscaled = {} if session.subject.registered is None else session.subject.registered.residual
    records, printed = list[dict[str, Any]](), list[int]()
    known = list[dict[str, float]]()
    for solved in session.trials:
        fit = solved.motion.registration
        if fit.residual not in known:
            known.append(fit.residual)
            printed += range(len(records), len(records) + len(fit.residual))
        records += [
            {
                "trial": solved.trial.name,
                "point": name,
                "residual": off,
                "any_size": fit.sized[name],
            }
            | {"size": fit.size, "unscaled": unscaled.get(name)}
            for name, off in fit.residual.items()
        ]
    cells: dict[str, Cell] = {"Trial": "trial", "Point": "point", "Off [mm]": _mm("residual")}
    cells |= {"In any size [mm]": _mm("any_size"), "Size": "size:.3g"}
    notes = [
        "Off: distance of a registered point from its place in the mechanism; in any size: from "
        "that in a mechanism of the size that fits best, which is given. Large in any size: a "
        "point that is named or placed wrongly, or a person of another shape."
    ]
    if unscaled:
        cells["Before scaling [mm]"] = _mm("unscaled")
        notes += [note.strip() for note in str(session.subject.scaled).splitlines()]
    title = "Registered points"
    return ReportTable.of("registration", title, records, cells, notes, printed)


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
    wanted = ["duration", *PHASES]
    by = [session.file.cycles_of(solved.trial) for solved in session.trials]
    wanted += dict.fromkeys(f"range_{table.by}" for table in by if table is not None)
    for name in (*(f"contact_{c}" for c in contacts), "load"):
        wanted += [f"peak_{name}", f"impulse_{name}"]
    records = []
    for solved in session.trials:
        known = {word: solved.trial.words.get(word, "") for word in words}
        records.append({"trial": solved.trial.name, **known} | _means([solved], wanted))
    for trials in session.groups.values():
        if len(trials) > 1:
            known = {word: trials[0].group.get(word, "") for word in words}
            records.append({"trial": ALL, **known} | _means(trials, wanted))
    cells: dict[str, Cell] = {"Trial": "trial", **{w.capitalize(): _word(w) for w in words}}
    cells |= {"Cycles": "cycles", "Duration [s]": _pair("duration")}
    if any(record["rest_mean"] for record in records):
        cells["Rest [s]"] = _pair("rest")
    for contact in contacts:
        cells[f"{contact}: peak [N]"] = _pair(f"peak_contact_{contact}")
        cells[f"{contact}: impulse [N s]"] = _pair(f"impulse_contact_{contact}")
    if any(record["peak_load_mean"] for record in records):
        cells |= {
            "Load: peak [N]": _pair("peak_load"),
            "Load: impulse [N s]": _pair("impulse_load"),
        }
    notes = [MEANS, *_bands_note(session)]
    return ReportTable.of("trials", "Cycles of each trial: mean ± SD", records, cells, notes)


def measure_table(session: SolvedSession) -> ReportTable:
    """What clinicians read of the cycles of each group of trials."""
    keys = [key for key in session.trials[0].group if key in session.file.words]
    records: list[dict[str, Any]] = []
    for trials in session.groups.values():
        about = {key: trials[0].group[key] for key in keys}
        records += [
            about | {"measure": name, "unit": unit} | numbers
            for name, (unit, factor) in ((n, UNITS[u]) for n, u in JAW_MEASURES.items())
            if (numbers := _within_and_between(trials, name, factor))["n"]
        ]
    moved = any("low" in record for record in records)
    cells: dict[str, Cell] = {"Measure": lambda record: _readable(record["measure"])}
    cells |= {key.capitalize(): _word(key) for key in keys}
    cells |= {"Unit": "unit", "n": "n", "Mean": "mean:.3g"}
    cells |= {"SD within": "sd_within:.2g", "SD between": "sd_between:.2g"}
    if moved:
        cells |= {"5 %": "low:.3g", "95 %": "high:.3g"}
    notes = []
    if records:
        plane = session.file.plane
        against = "X and Y of {S}" if plane is None else f"the {plane.name} plane"
        b = bonwill(session.mechanism, session.trials[0].axes)
        sides = ", ".join(f"{v * 1e3:.3g}" for name, v in b.items() if name != "angle")
        notes = [
            "Of the incisal point and the condyles from where they are with the teeth closed, as "
            f"measured, without the contacts, against {against}. Within: of cycles about their "
            "trial's mean; between: of the means of trials.",
            f"Bonwill triangle: {sides} mm, {np.degrees(b['angle']):.3g} degrees against "
            f"{against}.",
        ]
        bands = session.file.bands
        if moved and bands is not None:
            notes.append(
                f"5 and 95 %: of the mean over {bands.registrations} registrations, their points "
                f"moved by {session.file.error * 1e3:.3g} mm (standard deviation)."
            )
    return ReportTable.of("measures", "Jaw movements", records, cells, notes)


def _within_and_between(trials: Sequence[SolvedTrial], name: str, factor: float) -> dict[str, Any]:
    """Number of cycles, mean of all, deviation of cycles within trials, and of trials' means."""
    values = [
        np.array([row[name] for row in one.rows if row.get(name) is not None]) * factor
        for one in trials
    ]
    values = [v for v in values if len(v)]
    count = sum(map(len, values))
    freedom = count - len(values)
    squares = sum(float(((v - v.mean()) ** 2).sum()) for v in values)
    moved = {}
    if count and all(name in one.measures for one in trials):
        every = np.concatenate([one.measures[name] for one in trials], axis=1) * factor
        means = np.array([row[np.isfinite(row)].mean() for row in every if np.isfinite(row).any()])
        if len(means):
            low, *_, high = quantiles(means).tolist()
            moved = {"low": low, "high": high}
    return moved | {
        "n": count,
        "trials": len(values),
        "mean": float(np.concatenate(values).mean()) if count else None,
        "sd_within": float(np.sqrt(squares / freedom)) if freedom else None,
        "sd_between": float(np.std([v.mean() for v in values], ddof=1)) if values[1:] else None,
    }


def _readable(name: str) -> str:
    return name.replace("_", " ").capitalize()


def effort_table(session: SolvedSession) -> ReportTable:
    """Peaks of each chain's effort in each trial's cycles; people see the largest."""
    trials, chains = session.trials, session.mechanism.chain_names
    means_of_trials = [_means([solved], [f"peak_tau_{c}" for c in chains]) for solved in trials]
    records: list[dict[str, Any]] = []
    for chain in chains:
        record: dict[str, Any] = {"chain": chain}
        for solved, means in zip(trials, means_of_trials, strict=True):
            for word in ("mean", "sd", "low", "high"):
                if f"peak_tau_{chain}_{word}" in means:
                    record[f"{solved.trial.name}_{word}"] = means[f"peak_tau_{chain}_{word}"]
        records.append(record)
    units = {str(unit) for unit in trials[0].solution["effort_unit"].values}
    unit = units.pop() if len(units) == 1 else "N or N m"
    cells: dict[str, Cell] = {"Chain": "chain"}
    cells |= {f"{solved.trial.name} [{unit}]": _pair(solved.trial.name) for solved in trials}
    size = [max((r[f"{t.trial.name}_mean"] or 0.0 for t in trials), default=0.0) for r in records]
    printed = sorted(np.argsort(-np.array(size), kind="stable")[:MOST].tolist())
    notes = [MEANS, *_bands_note(session)]
    if len(records) > MOST:
        notes.append(f"The {MOST} largest of {len(records)}; the CSV file has all.")
    return ReportTable.of("efforts", "Peak efforts: mean ± SD", records, cells, notes, printed)


def emg_table(session: SolvedSession) -> ReportTable:
    """How each muscle's activation follows its EMG in the cycles of each trial."""
    records = []
    for solved in session.trials:
        for chain in emg_and_activation(solved.solution):
            names = [f"emg_{what}_{chain}" for what in EMG]
            means = {
                key.replace(f"_{chain}", ""): value
                for key, value in _means([solved], names).items()
            }
            if means["emg_rmse_mean"] is not None:
                records.append({"trial": solved.trial.name, "chain": chain} | means)
    cells: dict[str, Cell] = {"Trial": "trial", "Chain": "chain", "Cycles": "cycles"}
    cells |= {"Lag [ms]": _pair("emg_lag", 1e3), "RMSE": _pair("emg_rmse"), "R²": _pair("emg_r2")}
    notes = [
        "Activation against the EMG's envelope, cycle by cycle, mean ± SD. Lag: of the largest "
        "correlation within 0.3 s; RMSE and R² are at that lag, and at none where a cycle has none."
    ]
    return ReportTable.of("emg", "Activation and EMG", records, cells, notes)


def cycle_columns(rows: Sequence[Mapping[str, Any]]) -> dict[str, list[Any]]:
    """A row for each cycle, by column."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: list[Any]) -> list[Any]:
    """Words that are numbers throughout stay numbers; else all are text, and missing ones empty."""
    if all(v is None or (isinstance(v, int | float) and not isinstance(v, bool)) for v in values):
        return [float("nan") if v is None else v for v in values]
    return ["" if v is None else str(v).lower() if isinstance(v, bool) else str(v) for v in values]


def _recording(solved: SolvedTrial) -> dict[str, Any]:
    motion, verticals = solved.motion, [each.vertical.data() for each in solved.motions]
    rms = np.array([r.rms for r in motion.residuals])
    every = motion.markers_moved.get("all", {})
    return {
        "trial": solved.trial.name,
        "frames": len(motion.recording.t),
        "seconds": float(sum(np.ptp(each.motion.t) for each in solved.motions)),
        "marker_rms": float(np.sqrt(np.nanmean(rms**2))),
        "registration_largest": max(motion.registration.residual.values(), default=None),
        "fixed_markers_moved": solved.moved,
        "before_contacts_rms": every.get("before_rms"),
        "on_contacts_rms": every.get("after_rms"),
        "on_contacts_largest": every.get("after_largest"),
        "closure_step": None if solved.slip is None else solved.slip.size,
        "closure_step_time": None if solved.slip is None else solved.slip.time,
        "tilt": max(each["tilt"]["largest"] for each in verticals),
        "inertia_force_largest": max(each["inertia_force"]["largest"] for each in verticals),
        "gaps": len(motion.gaps),
        "intervals": len(solved.motions),
        "samples_without_result": int((solved.solution["status"].values != 0).sum()),
    }


def _markers(solved: SolvedTrial) -> list[dict[str, Any]]:
    """Distances [m] of every marker of a trial from its place."""
    keys = ("before_rms", "before_largest", "after_rms", "after_largest")
    return [
        {"trial": solved.trial.name, "marker": r.name, "body": r.body, "seen": r.seen}
        | {"rms": _known(r.rms), "largest": _known(r.largest)}
        | {key: solved.motion.markers_moved.get(r.name, {}).get(key) for key in keys}
        for r in solved.motion.residuals
    ]


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _means(trials: Sequence[SolvedTrial], names: Iterable[str]) -> dict[str, Any]:
    """Number of whole cycles of trials, mean and standard deviation of measures over them."""
    rows = [row for solved in trials for row in solved.rows if not row["samples_without_result"]]
    means: dict[str, Any] = {"cycles": len(rows)}
    for name in names:
        values = [row[name] for row in rows if row.get(name) is not None]
        means[f"{name}_mean"] = float(np.mean(values)) if values else None
        means[f"{name}_sd"] = float(np.std(values, ddof=1)) if len(values) > 1 else None
        if all(name in solved.by_variant for solved in trials):
            means |= _band(trials, name)
    return means


def _band(trials: Sequence[SolvedTrial], name: str) -> dict[str, float | None]:
    """Outer quantiles over variants of the mean over the whole cycles of trials."""
    means = np.concatenate(
        [
            one.by_variant[name][:, [not row["samples_without_result"] for row in one.rows]]
            for one in trials
        ],
        axis=1,
    )
    if not means.size:
        return {f"{name}_low": None, f"{name}_high": None}
    low, *_, high = quantiles(means.mean(axis=1)).tolist()
    return {f"{name}_low": _known(low), f"{name}_high": _known(high)}


def _bands_note(session: SolvedSession) -> list[str]:
    variants = session.trials[0].variants
    if variants is None:
        return []
    return [f"In brackets: 5 to 95 % of {variants.count} variants, of the mean."]


def _pair(name: str, factor: float = 1.0) -> Cell:
    """'12.3 ± 0.4', with variants '12.3 ± 0.4 [11.2, 13.9]'."""

    def cell(record: dict[str, Any]) -> str:
        mean, sd = record[f"{name}_mean"], record[f"{name}_sd"]
        if mean is None:
            return NOTHING
        low, high = record.get(f"{name}_low"), record.get(f"{name}_high")
        band = "" if low is None or high is None else f" [{factor * low:.3g}, {factor * high:.3g}]"
        text = f"{factor * mean:.3g}"
        return f"{text}{band}" if sd is None else f"{text} ± {factor * sd:.2g}{band}"

    return cell


def _mm(name: str) -> Cell:
    return lambda record: NOTHING if record[name] is None else f"{record[name] * 1e3:.3g}"


def _word(name: str) -> Cell:
    return lambda record: str(record[name]) or NOTHING
