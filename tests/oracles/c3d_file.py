"""C3D files byte by byte, as the format's description has them; no library is asked."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

BLOCK = 512
UNDESCRIBED = b"\0"  # the length of a parameter's description


def c3d_bytes(
    labels: Sequence[str],
    points: np.ndarray,
    rate: float = 100.0,
    first_frame: int = 1,
    units: str | None = "mm",
    scale: float = -1.0,
    missing: str = "residual",
    channels: Sequence[tuple[str, str]] = (),
    analog: np.ndarray | None = None,
    plates: dict[str, Any] | None = None,
    y_screen: str | None = None,
    processor: str = "intel",
) -> bytes:
    """A recording of markers.

    Args: points: (F, L, 3) in `units`, NaN where not seen;  scale: -1 for single precision, above
              0 for 16-bit integers, each worth so much.
          missing: "residual" (-1), "nan" or "zero".
          channels: (label, unit);  analog: (F, samples a frame, C).
          y_screen: the axis that is drawn upwards.
          processor: whose order of bytes and floating point numbers: intel, dec or mips.
          plates: parameters of the group FORCE_PLATFORM; arrays by their dimensions in the file.
    """
    frames, count = points.shape[:2]
    per_frame = 0 if analog is None else analog.shape[1]
    groups: dict[str, dict[str, Any]] = {
        "POINT": {
            "USED": np.int16(count),
            "SCALE": np.float32(scale),
            "RATE": np.float32(rate),
            "FRAMES": np.uint16(min(frames, 65535)),
            "DATA_START": np.int16(0),
            "LABELS": list(labels),
            **({} if units is None else {"UNITS": [units]}),
            **({} if y_screen is None else {"Y_SCREEN": [y_screen]}),
        },
        "ANALOG": {"USED": np.int16(len(channels)), "RATE": np.float32(rate * per_frame)},
    }
    if channels:
        groups["ANALOG"] |= {
            "LABELS": [name for name, _ in channels],
            "UNITS": [unit for _, unit in channels],
            "GEN_SCALE": np.float32(1),
            "SCALE": np.ones(len(channels), np.float32),
            "OFFSET": np.zeros(len(channels), np.int16),
        }
    if plates is not None:
        groups["FORCE_PLATFORM"] = plates
    last = first_frame + frames - 1
    if last > 65535:  # two words each, the lower one first
        ends = {"ACTUAL_START_FIELD": first_frame, "ACTUAL_END_FIELD": last}
        words = {key: np.array([n % 65536, n // 65536], np.uint16) for key, n in ends.items()}
        groups["TRIAL"] = words
    own = (processor,)
    start = 2 + len(_parameters(groups, *own)) // BLOCK
    groups["POINT"]["DATA_START"] = np.int16(start)
    words = [count, len(channels) * per_frame, *np.minimum([first_frame, last], 65535), 10]
    header = b"\2\x50" + _words(words, *own) + _floats([scale], *own)
    header += _words([start, per_frame], *own) + _floats([rate], *own)
    data = _frames(points, scale, missing, analog, processor)
    return header.ljust(BLOCK, b"\0") + _parameters(groups, *own) + _padded(data)


def _words(numbers: Any, processor: str) -> bytes:
    return np.asarray(numbers).astype(">u2" if processor == "mips" else "<u2").tobytes("F")


def _floats(numbers: Any, processor: str) -> bytes:
    """Single precision. DEC has an exponent that is larger by 2, and the upper word first."""
    numbers = np.asarray(numbers, dtype=float)
    if processor == "dec":
        four = np.frombuffer((4 * numbers).astype("<f4").tobytes("F"), "<u2").reshape(-1, 2)
        return four[:, ::-1].tobytes()
    return numbers.astype(">f4" if processor == "mips" else "<f4").tobytes("F")


def _frames(
    points: np.ndarray, scale: float, missing: str, analog: np.ndarray | None, processor: str
) -> bytes:
    gone = ~np.isfinite(points).all(axis=-1)
    four = np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=-1)
    four[gone] = {"residual": [0, 0, 0, -1], "nan": [np.nan] * 3 + [0], "zero": [0] * 4}[missing]
    if scale > 0:
        four[..., :3] = np.round(four[..., :3] / scale)
    rows = four.reshape(len(points), -1)
    if analog is not None:
        rows = np.hstack([rows, analog.reshape(len(points), -1)])
    flat = rows.ravel()
    return _floats(flat, processor) if scale < 0 else _words(flat.astype(np.int16), processor)


def _parameters(groups: dict[str, dict[str, Any]], processor: str = "intel") -> bytes:
    out, byte = b"", ">" if processor == "mips" else "<"
    for number, (name, entries) in enumerate(groups.items(), 1):
        out += (
            struct.pack("<bb", len(name), -number) + name.encode() + struct.pack(f"{byte}hB", 3, 0)
        )
        for key, value in entries.items():
            body = _value(value, processor) + UNDESCRIBED
            head = struct.pack("<bb", len(key), number) + key.encode()
            out += head + struct.pack(f"{byte}h", len(body) + 2) + body
    out += b"\0\0"
    blocks = -(-(len(out) + 4) // BLOCK)
    kind = {"intel": 84, "dec": 85, "mips": 86}[processor]
    return _padded(struct.pack("<BBBB", 1, 0x50, blocks, kind) + out)


def _value(value: Any, processor: str) -> bytes:
    """Length of an element, dimensions, elements."""
    if isinstance(value, list):
        texts = [text.encode() for text in value]
        width = max(map(len, texts), default=0)
        joined = b"".join(text.ljust(width) for text in texts)
        return struct.pack("<bBBB", -1, 2, width, len(texts)) + joined
    array = np.asarray(value)
    content = (_floats if array.dtype.kind == "f" else _words)(array, processor)
    return struct.pack("<bB", array.itemsize, array.ndim) + bytes(array.shape) + content


def _padded(content: bytes) -> bytes:
    return content + b"\0" * (-len(content) % BLOCK)
