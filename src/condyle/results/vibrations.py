"""Modes and stiffness of a mechanism at home, in words, and modes at states of a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..distribution.objectives import NAMED
from ..errors import InputError, brief
from ..mechanism.mechanism import COORDINATES
from ..model.distributing import Distribution
from ..model.given import as_model
from ..model.model import Contacts, Model
from ..motion import Motion
from ..motion.table_writer import write_table
from ..quantities.entries import SCREW
from ..status import STATUS_NAMES, Status
from .row_stream import Columns, StateReader, StatesReport, row_stream

if TYPE_CHECKING:
    import xarray as xr

HELD = 1e-12  # of the largest compliance: what contacts hold has rounding alone
SMALL = 0.1  # of the largest displacement, that a line of text leaves out
KNOWN = (Status.ok, Status.unstable)
KNOWN_NAMES = tuple(status.name for status in KNOWN)


@dataclass(frozen=True)
class HomeModes:
    """Small vibrations at home, held against gravity: `data` for programs, `str` to read.

    data: mechanism, at, contacts, status; of each mode frequency [Hz], damping, shape (in q) and
          displacement (of the point); compliance (6, 6), and its principal values and axes; None
          for what is not known.
    """

    data: dict[str, Any]

    def __str__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        d = self.data
        yielding = ", with contacts that yield" if d["contacts"] == "compliant" else ""
        yield f"small vibrations at home, held against gravity{yielding}"
        if d["status"] not in KNOWN_NAMES:
            yield f"  unknown: {Status[d['status']].meaning}"
            return
        for i, (hertz, ratio) in enumerate(zip(d["frequency"], d["damping"], strict=True), 1):
            yield f"  {i}  {_hertz(hertz)}{_damping(ratio)}{_moves(d, i - 1)}"
        if d["status"] == Status.unstable.name:
            yield f"  {Status.unstable.meaning}"
        for direction, size, other in softness(d):
            yield f"  {d['at']}: softest {direction} {size}, {other}"

    @property
    def warnings(self) -> list[str]:
        return []


def home_modes(model: Any, at: str | None = None, contacts: Contacts = "kept") -> HomeModes:
    """Modes and compliance at home, under gravity.

    Args:   model: one, or a mechanism, its file or name;  at: point of the platform; default: O_M.
            contacts: kept or compliant, as of `Model.stiffness`.
    Raises: InputError: for a mechanism that is rigid, or an unknown point.
    """
    model = as_model(model)
    home = np.zeros(len(model.independent))
    modes, stiffness = (
        how(home, at=at, contacts=contacts) for how in (model.modes, model.stiffness)
    )
    names = ("compliance", "translation", "translation_axis", "rotation", "rotation_axis")
    data: dict[str, Any] = {
        "mechanism": model.mechanism.name,
        "at": at or "O_M",
        "contacts": contacts,
        "status": STATUS_NAMES[int(stiffness.status)],
        "coordinates": list(model.independent),
        "characteristic_length": model.characteristic_length,
    }
    own = ("frequency", "damping", "shape", "displacement")
    data |= {name: _plain(getattr(modes, name)) for name in own}
    return HomeModes(data | {name: _plain(getattr(stiffness, name)) for name in names})


def solution_modes(solution: xr.Dataset) -> tuple[Model, HomeModes] | None:
    """Model and modes at home of a solution's mechanism, by its distribution if that needs no EMG;
    None where nothing gives, a surface was written in Python, or modes are not known."""
    mechanism = solution.condyle.mechanism
    known = all(contact.surface.known for contact in mechanism.contacts)
    if not known or all(chain.rigid for chain in mechanism.chains):
        return None
    name = solution.condyle.options.get("distribution")
    named = NAMED.get(name) if isinstance(name, str) else None
    chosen = Distribution(name) if named is not None and not named.follows else None
    model = Model(mechanism, backend="numpy", distribution=chosen)
    found = home_modes(model)
    return (model, found) if found.data["status"] in KNOWN_NAMES else None


def mode_states(
    model: Any,
    states: str | Path,
    out: str | Path,
    at: str | None = None,
    flag: bool = False,
    strict: bool = False,
    contacts: Contacts = "kept",
) -> StatesReport:
    """Natural frequencies and damping ratios at states, one per row.

    Args:   model: one, or a mechanism, its file or name.
            states: States (CSV or Parquet), one per row: independent coordinates and, if there is a
            load, Fx .. Mz.
            out: File for the frequencies (.csv or .parquet).
            at: Point of the platform at which loads act.
            flag: keep rows without modes, empty, with their status.
            contacts: kept on their surfaces, or compliant: those with `compliance` yield.
    Raises: InputError: for a mechanism that is rigid, rates, and rows without modes unless `flag`.
    """
    model = as_model(model)
    reader = StateReader(model, at)
    with row_stream(states, out, reader.known, strict=strict) as rows:
        for table in rows:
            reader.require_independent(table, "modes are those at")
            if not reader.rest(table):
                raise InputError(f"{table.source}: modes are those at rest; remove the rates")
            state = reader.state(table)
            load = state["wrench"], state["at"]
            modes = model.modes(state["q"], None, *load, contacts=contacts)
            bad = np.flatnonzero(~np.isin(modes.status, KNOWN))
            if bad.size and not flag:
                why = list(Status)[modes.status[bad[0]]].meaning
                raise InputError(
                    f"row {rows.count + int(bad[0]) + 1} has no modes: {why}. --flag (flag=True) "
                    "keeps such rows, empty"
                )
            columns: Columns = {}
            for name in ("frequency", "damping"):
                values = getattr(modes, name)
                columns |= {f"{name}_{i + 1}": values[:, i] for i in range(values.shape[1])}
            columns["status"] = [STATUS_NAMES[i] for i in modes.status.tolist()]
            rows.write(columns)
    return rows.report(mechanism=model.mechanism.name, distribution=model.distribution.name)


def write_mode(model: Any, mode: int, file: str | Path, contacts: Contacts = "kept") -> None:
    """Write `mode_motion` as a table, for `condyle run --motion`."""
    motion = mode_motion(model, mode, contacts=contacts)
    columns = {"t": motion.t} | dict(zip(motion.names, motion.value.T, strict=True))
    write_table(file, columns)


def mode_motion(
    model: Any,
    mode: int = 1,
    amplitude: float = 0.02,
    period: float = 1.0,
    contacts: Contacts = "kept",
) -> Motion:
    """Two swings of a mode about home, as slow as eyes are: to solve, and to watch.

    Args:   model: one, or a mechanism, its file or name;  mode: 1 is the lowest.
            amplitude: largest part of the shape [characteristic lengths, rad];  period: [s].
            contacts: kept or compliant: whose mode it is; the motion has q alone.
    Raises: InputError: for a mechanism that is rigid, or a mode that it has not.
    """
    model = as_model(model)
    require_mode(mode, len(model.independent))
    modes = model.modes(np.zeros(len(model.independent)), contacts=contacts)
    require_mode(mode, int(np.isfinite(modes.shape).all(axis=1).sum()))
    shape = of_amplitude(model, modes.shape[mode - 1], amplitude)
    t = np.linspace(0.0, 2 * period, 121)
    q = np.sin(2 * np.pi * t / period)[:, None] * shape
    source = f"mode {mode}, {modes.frequency[mode - 1]:.5g} Hz"
    return Motion.from_arrays(t, q, model.independent, source=source)


def require_mode(mode: object, count: int) -> None:
    """Raises: InputError: for what is not the number of one of so many modes."""
    if isinstance(mode, bool) or not isinstance(mode, int) or not 1 <= mode <= count:
        raise InputError(f"mode: expected a number from 1 to {count}, got {brief(mode)}")


def of_amplitude(model: Any, shape: np.ndarray, amplitude: float) -> np.ndarray:
    """A shape in q, (m,), whose largest part is so many characteristic lengths, or rad."""
    lengths = [name in COORDINATES[:3] for name in model.independent]
    size = np.where(lengths, model.characteristic_length, 1.0)
    scaled: np.ndarray = shape * amplitude / np.abs(shape / size).max()
    return scaled


def softness(d: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Softness in lengths, then angles, in words: the point's softest direction, compliance, and
    the direction that is stiffest, or held.

    Args: d: `HomeModes.data`.
    """
    for kind, unit, how in (("translation", "m/N", "along"), ("rotation", "rad/(N m)", "about")):
        sizes, axes = d[kind], d[f"{kind}_axis"]
        if sizes[0] is None:
            continue
        other = f"held {how} {_axis(axes[2])}"
        if sizes[2] > HELD * sizes[0]:
            other = f"stiffest {how} {_axis(axes[2])} {sizes[2]:.3g} {unit}"
        yield f"{how} {_axis(axes[0])}", f"{sizes[0]:.3g} {unit}", other


def _plain(a: np.ndarray) -> Any:
    """Lists, with None for what is no number."""
    return np.where(np.isfinite(a), a.astype(object), np.array(None)).tolist()


def _hertz(value: float | None) -> str:
    if value is None:
        return "held by chains without a stiffness"
    return f"{value:.5g} Hz" if value > 0 else f"gives way ({value:.5g} Hz)"


def _damping(ratio: float | None) -> str:
    return f", damping {ratio:.2%}" if ratio else ""


def _moves(d: Mapping[str, Any], mode: int) -> str:
    """The largest displacement, of lengths and of angles, where that is not small."""
    text = mostly(d, mode)
    return f", {text}" if text else ""


def mostly(d: Mapping[str, Any], mode: int) -> str:
    """How a mode moves the point most: "mostly along x and about y"; empty where chains hold it.

    Args: d: `HomeModes.data`;  mode: from 0.
    """
    displacement = d["displacement"][mode]
    if None in displacement:
        return ""
    size = np.abs(np.array(displacement, dtype=float))
    size[3:] *= d["characteristic_length"]
    said = []
    for start, how in ((0, "along"), (3, "about")):
        largest = start + int(np.argmax(size[start : start + 3]))
        if size[largest] > SMALL * size.max():
            said.append(f"{how} {SCREW[largest].removeprefix('r')}")
    return f"mostly {' and '.join(said)}"


def _axis(axis: list[float]) -> str:
    k = int(np.argmax(np.abs(axis)))
    if abs(axis[k]) > 1 - 1e-6:
        return "xyz"[k]
    return f"({', '.join(f'{x:.2f}' for x in axis)})"
