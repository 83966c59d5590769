"""Recordings: where markers were, frame by frame, and what else was sampled; from C3D files."""

from __future__ import annotations

import os
import struct
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

from ..errors import CondyleError, InputError, as_name, brief, did_you_mean, join, quoted, short
from ..extras import require
from ..files.reading import content_of, digest
from ..motion.column_units import LENGTH_UNITS
from .plates import Plate, read_plates

ASSUMED = "mm"  # what laboratories mean that name no unit
_WORDS = {"millimet": "mm", "centimet": "cm", "micromet": "um", "met": "m"}
SLOWEST, FASTEST = 1e-3, 1e6  # Hz


@dataclass(frozen=True, eq=False)
class Recording:
    """What a file of markers holds.

    Attributes:
        source: the file's name, for messages;  sha256: its hash.
        rate: frames a second [Hz];  first_frame: its number, as the file counts, from 1.
        t: (F,) [s]; frame 1 is at 0.
        unit: of lengths in the file;  metres: so much it is.
        labels: of the markers, (L,), as they stand in the file.
        points: (F, L, 3) [m] in the laboratory's frame; NaN where a marker was not seen.
        channels: labels of what else was sampled, (C,);  channel_units: theirs, as in the file.
        samples: (F, n, C), n samples a frame, in the channel's unit.
        plates: force plates, in the file's order.
        warnings: what had to be assumed.
        up: axis of the laboratory that points upwards, (3,): Z, or what the file says.
    """

    source: str
    sha256: str | None
    rate: float
    first_frame: int
    t: np.ndarray
    unit: str
    metres: float
    labels: tuple[str, ...]
    points: np.ndarray
    channels: tuple[str, ...]
    channel_units: tuple[str, ...]
    samples: np.ndarray
    plates: tuple[Plate, ...] = ()
    warnings: tuple[str, ...] = ()
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def analog(self) -> np.ndarray:
        """The mean of each frame's samples, (F, C)."""
        return self.samples.mean(axis=1)

    @property
    def channel_rate(self) -> float:
        """Samples a second of a channel [Hz]."""
        return self.rate * self.samples.shape[1]


def read_c3d(
    path: str | os.PathLike[str], unit: str | None = None, *, markers: bool = True
) -> Recording:
    """Read a C3D file.

    Args:   unit: of its lengths, in place of what it says itself: m, cm, mm or um.
            markers: it has to hold some.
    Raises: InputError: for another file, a truncated one, or one that contradicts itself.
            MissingExtraError: if the reader is not installed.
    """
    require("c3d", "c3d")
    check_unit(unit)
    content = _content(path)
    try:
        # The reader warns of parameters that nobody needs here, and casts NaN.
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return _read(content, path, unit, markers)
    except CondyleError:
        raise
    except Exception as error:  # whatever broken bytes make of a reader
        said = short(str(error)) or type(error).__name__
        raise InputError(f"{path}: is broken, or no C3D file ({said})") from error


def check_unit(unit: str | None) -> None:
    """Raises: InputError: if there is no such unit of lengths."""
    if unit is not None and as_name(unit, "unit") not in LENGTH_UNITS:
        raise InputError(f"unit: expected {', '.join(LENGTH_UNITS)}, got {brief(unit)}")


def _content(path: str | os.PathLike[str]) -> bytes:
    content = content_of(path)
    if len(content) < 1024 or content[1] != 0x50:
        raise InputError(
            f"{path}: is no C3D file: its second byte is not 80, or it is shorter than a header. "
            "Export the recording as C3D"
        )
    return content


def _read(
    content: bytes, path: str | os.PathLike[str], unit: str | None, markers: bool
) -> Recording:
    file = _reader()(BytesIO(content))
    rate = float(f"{float(file.point_rate):.7g}")  # kept in single precision
    if not SLOWEST <= rate <= FASTEST:
        raise InputError(f"{path}: got a rate of {rate:g} frames a second (POINT:RATE)")
    if markers and not file.point_used:
        raise InputError(
            f"{path}: holds no markers, only {file.analog_used} analog channels; a motion needs a "
            "recording with markers"
        )
    count = file.last_frame - file.first_frame + 1
    if count < 1:
        raise InputError(f"{path}: holds no frames ({count})")
    notes = list(file.notes)
    if file.twice:
        notes.append(f"has {join(file.twice)} twice among its parameters; the first of each counts")
    if file.cut:
        notes.append(f"has {join(file.cut)} among its parameters cut short; they are left out")
    points, analog = [], []
    for _, found, samples in file.read_frames(check_nan=True):
        points.append(found)
        analog.append(samples.T if samples.size else np.zeros((1, 0)))
    if not points:
        raise InputError(f"{path}: holds not one whole frame of {count}. Copy or export it again")
    if len(points) != count:
        if len(points) != file.counted:  # of two counts the parameters' is right
            notes.append(
                f"says {count} frames and holds {len(points)}, which are read; if that is not all, "
                "copy or export it again"
            )
        count = len(points)
    (said,) = _labels(file, "POINT:UNITS", 1)  # some name it once a marker
    known, metres, assumed = unit_of(path, said, unit)
    first = max(int(file.first_frame), 1)
    channels = _labels(file, "ANALOG:LABELS", analog[0].shape[1])
    return Recording(
        source=os.path.basename(os.fspath(path)),
        sha256=digest(path),
        rate=rate,
        first_frame=first,
        t=(first - 1 + np.arange(count)) / rate,
        unit=known,
        metres=metres,
        labels=_labels(file, "POINT:LABELS", file.point_used),
        points=_seen(np.array(points)) * metres,
        channels=channels,
        channel_units=_labels(file, "ANALOG:UNITS", len(channels)),
        samples=np.array(analog),
        plates=read_plates(file, metres),
        warnings=(*assumed, *(f"{path}: {note}" for note in notes)),
        up=_up(file.get("POINT:Y_SCREEN")),
    )


def _reader() -> Any:
    import c3d

    class Reader(c3d.Reader):  # type: ignore[misc]
        """Holds a file only to what the place of its numbers depends on."""

        def __init__(self, handle: Any) -> None:
            self.notes: list[str] = []  # of what was read otherwise than it says
            self.twice: dict[str, None] = {}  # parameters
            self.cut: dict[str, None] = {}
            super().__init__(handle)

        def add_group(self, *arguments: Any, **options: Any) -> Any:
            """Add a group: the first of parameters that stand twice, none cut short."""
            group = super().add_group(*arguments, **options)
            add = group.add_param

            def first(name: str, **entries: Any) -> Any:
                if group.get(name) is not None:
                    self.twice[name] = None
                    return None
                # Some leave out the length of a description that is empty, which is a zero.
                handle = BytesIO(entries["handle"].read() + b"\0")
                try:
                    return add(name, **entries | {"handle": handle})
                except struct.error:
                    self.cut[name] = None

            group.add_param = first
            return group

        @property
        def analog_used(self) -> int:
            """Channels; the header has their samples in a frame."""
            if self.get("ANALOG:USED") is not None:
                return int(super().analog_used)
            return int(self._header.analog_count) // max(int(self._header.analog_per_frame), 1)

        @property
        def analog_per_frame(self) -> int:
            """Samples a frame, by a header that agrees with itself: unlike steps give none."""
            header = self._header
            own, used = int(header.analog_per_frame), int(self.analog_used)
            return own if own * used == header.analog_count else int(super().analog_per_frame)

        @property
        def last_frame(self) -> int:
            """Where frames are counted from 0, the header's: the parameters' is a number."""
            header = self._header
            if header.first_frame == 0 and int(header.last_frame) + 1 == self.counted:
                return int(header.last_frame)
            if self.get("TRIAL:ACTUAL_END_FIELD") is None:
                return int(super().last_frame)
            return max(self._two_words("TRIAL:ACTUAL_END_FIELD"), int(header.last_frame))

        @property
        def counted(self) -> int:
            """Frames by the parameters."""
            parameter = self.get("POINT:FRAMES")
            return 0 if parameter is None else int(parameter.uint16_value)

        def _check_metadata(self) -> None:
            """Take the parameters' count where the header has another, as other readers do."""
            header = self._header
            analog = self.analog_used * self.analog_per_frame if self.analog_used else 0
            for what, in_header, read in (
                ("markers", int(header.point_count), int(self.point_used)),
                ("analog samples", int(header.analog_count), analog),
            ):
                if in_header != read:
                    self.notes.append(
                        f"has {in_header or 'no'} {what} a frame by its header and {read} by its "
                        "parameters; those of its parameters are read"
                    )

        @property
        def first_frame(self) -> int:
            """The first frame, by two words of the parameters if there, else the header."""
            return self._two_words("TRIAL:ACTUAL_START_FIELD") or int(self._header.first_frame)

        def _two_words(self, key: str) -> int:
            """A number in two words, the lower one first, in a row or a column; 0 where none is."""
            parameter = self.get(key)
            words = np.zeros(0) if parameter is None else np.ravel(parameter.uint16_array)
            return int(words[0]) + 65536 * int(words[1]) if len(words) > 1 else 0

    return Reader


def _seen(frames: np.ndarray) -> np.ndarray:
    """Places, (F, L, 3), of what the reader gives, (F, L, 5); NaN for markers not seen.

    They are marked by a negative residual; some write zeros instead.
    """
    points = frames[..., :3].astype(float)
    missing = (frames[..., 3] < 0) | ~np.isfinite(points).all(axis=-1) | ~points.any(axis=-1)
    points[missing] = np.nan
    return points


def unit_of(
    path: str | os.PathLike[str], stated: str, given: str | None, where: str = "POINT:UNITS"
) -> tuple[str, float, tuple[str, ...]]:
    """The unit of lengths, in metres, and what was assumed; where: the file says it."""
    if given is not None:
        return given, LENGTH_UNITS[given], ()
    if not stated:
        assumed = f"{path}: does not say its unit of length ({where}); {ASSUMED} was assumed"
        return ASSUMED, LENGTH_UNITS[ASSUMED], (assumed,)
    plain = stated.replace("\u00b5", "u").casefold()
    name = next((unit for word, unit in _WORDS.items() if plain.startswith(word)), plain)
    if name not in LENGTH_UNITS:
        raise InputError(
            f'{path}: its unit of length ({where}) is "{short(stated)}", expected '
            f"{', '.join(LENGTH_UNITS)}. If you know it, name it with --units (unit=...)"
        )
    return name, LENGTH_UNITS[name], ()


def _up(screen: Any) -> tuple[float, float, float]:
    """The axis that is drawn upwards (POINT:Y_SCREEN), such as +Z or -Y; Z where none is named."""
    said = "" if screen is None else _plain(screen.bytes).upper()
    axis = "XYZ".find(said[-1:] or "Z")
    x, y, z = np.eye(3)[axis] * (-1 if said.startswith("-") else 1)
    return float(x), float(y), float(z)


def _labels(file: Any, key: str, count: int) -> tuple[str, ...]:
    """Texts of a parameter and of those that go on from it: LABELS2, LABELS3 [255 each]."""
    labels: list[str] = []
    for number in ("", *range(2, 256)):
        param = file.get(f"{key}{number}")
        if len(labels) >= count or param is None or not (param.dimensions and param.dimensions[0]):
            break
        # Texts of one length, one after the other.
        size = param.dimensions[0]
        labels += [_plain(param.bytes[i : i + size]) for i in range(0, len(param.bytes), size)]
    return tuple((labels + [""] * count)[:count])


def _plain(content: bytes) -> str:
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.strip(" \0\t\r\n")


def find_label(name: str, labels: Sequence[str], where: str, what: str = "marker") -> int:
    """Index of the label that a name means, as "upper fl" means "Subject1:Upper_FL".

    The whole label goes before one without its prefix, and the same letters before others.

    Raises: InputError: if there is none, or several are meant.
    """
    for form in _FORMS:
        matches = [i for i, label in enumerate(labels) if label and form(label) == form(name)]
        if len(matches) == 1:
            return matches[0]
        if matches:
            several = quoted([labels[i] for i in matches])
            alike = len({labels[i] for i in matches}) < len(matches)
            cure = "rename one of them in the file" if alike else "give the whole label"
            raise InputError(f'{where}: {what} "{name}" may be any of {several}; {cure}')
    present = [label for label in labels if label and not label.startswith("*")]
    raise InputError(f'{where}: has no {what} "{name}".{did_you_mean(name, present)}')


def has_label(name: str, labels: Sequence[str]) -> bool:
    """Whether a name means one of the labels, or several of them."""
    return any(label and form(label) == form(name) for form in _FORMS for label in labels)


def _folded(label: str) -> str:
    return "_".join(label.replace("_", " ").split()).casefold()


_FORMS: tuple[Callable[[str], str], ...] = (
    str,
    lambda label: " ".join(label.split()),
    _folded,
    lambda label: " ".join(label.rpartition(":")[2].split()),
    lambda label: _folded(label.rpartition(":")[2]),
)
