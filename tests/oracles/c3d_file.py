"""C3D files byte by byte, as the format's description has them; no library is asked."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

BLOCK = 512


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
) -> bytes:
    """A recording of markers, in Intel's order of bytes.

    Args: points: (F, L, 3) in `units`, NaN where not seen;  scale: -1 for single precision, above
              0 for 16-bit integers, each worth so much.
          missing: "residual" (-1), "nan" or "zero".
          channels: (label, unit);  analog: (F, samples a frame, C).
          y_screen: the axis that is drawn upwards.
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
    size = len(_parameters(groups)) // BLOCK
    start = 2 + size
    groups["POINT"]["DATA_START"] = np.int16(start)
    header = struct.pack(
        "<BBHHHHHfHHf",
        *(2, 0x50, count, len(channels) * per_frame, *np.minimum([first_frame, last], 65535), 10),
        *(scale, start, per_frame, rate),
    )
    data = _frames(points, scale, missing, analog)
    return header.ljust(BLOCK, b"\0") + _parameters(groups) + _padded(data)


def _frames(points: np.ndarray, scale: float, missing: str, analog: np.ndarray | None) -> bytes:
    gone = ~np.isfinite(points).all(axis=-1)
    four = np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=-1)
    four[gone] = {"residual": [0, 0, 0, -1], "nan": [np.nan] * 3 + [0], "zero": [0] * 4}[missing]
    if scale > 0:
        four[..., :3] = np.round(four[..., :3] / scale)
    kind = "<f4" if scale < 0 else "<i2"
    rows = four.reshape(len(points), -1)
    if analog is not None:
        rows = np.hstack([rows, analog.reshape(len(points), -1)])
    return rows.astype(kind).tobytes()


def _parameters(groups: dict[str, dict[str, Any]]) -> bytes:
    out = b""
    for number, (name, entries) in enumerate(groups.items(), 1):
        out += struct.pack("<bb", len(name), -number) + name.encode() + struct.pack("<hB", 3, 0)
        for key, value in entries.items():
            body = _value(value) + b"\0"
            head = struct.pack("<bb", len(key), number) + key.encode()
            out += head + struct.pack("<h", len(body) + 2) + body
    out += b"\0\0"
    blocks = -(-(len(out) + 4) // BLOCK)
    return _padded(struct.pack("<BBBB", 1, 0x50, blocks, 84) + out)


def _value(value: Any) -> bytes:
    """Length of an element, dimensions, elements."""
    if isinstance(value, list):
        texts = [text.encode() for text in value]
        width = max(map(len, texts), default=0)
        joined = b"".join(text.ljust(width) for text in texts)
        return struct.pack("<bBBB", -1, 2, width, len(texts)) + joined
    array = np.asarray(value)
    return struct.pack("<bB", array.itemsize, array.ndim) + bytes(array.shape) + array.tobytes("F")


def _padded(content: bytes) -> bytes:
    return content + b"\0" * (-len(content) % BLOCK)
