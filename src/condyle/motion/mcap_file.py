"""Logs as MCAP, the container of ROS 2 and Foxglove: a topic of JSON messages, one for each row.

A column is a property of the message's JSON schema, so that Foxglove plots `/log.tau_left`. A gap
is a property that is left out. The message's time is the row's t.
"""

from __future__ import annotations

import json
import math
import os
import re
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from itertools import islice
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ..errors import InputError, brief, join, quoted, short
from ..extras import require
from ..files import limits
from ..files.reading import printable_path, require_file
from .column_names import Header, read_header
from .number_table import Known, NumberTable, table_of

if TYPE_CHECKING:
    from mcap.records import Channel, Chunk, McapRecord, Message, Schema

TOPIC, SCHEMA = "/log", "condyle.Log"
_TIME = re.compile(r"t(imes?)?\s*([(\[]|$)", re.IGNORECASE)  # a column's name, unit or not
_MAGIC = b"\x89MCAP0\r\n"
_LAST = 2**64 * 1e-9  # s, beyond which no message's time reaches


def is_mcap(path: str | os.PathLike[str]) -> bool:
    """Whether the name of a file says MCAP."""
    return os.fspath(path).lower().endswith(".mcap")


def require_mcap() -> None:
    """Raises MissingExtraError where the library is not installed."""
    require("mcap", "mcap")


class McapRows:
    """Writes rows of numbers as messages of one topic.

    Args: names: of the columns, t among them.
    """

    def __init__(self, file: BinaryIO, names: Sequence[str]) -> None:
        from mcap.writer import Writer

        self._names, self._at = list(names), list(names).index("t")
        self._since: float | None = None
        self._writer = Writer(file)
        self._writer.start(library="condyle")
        schema = {
            "title": SCHEMA,
            "type": "object",
            "properties": {name: {"type": "number"} for name in names},
        }
        registered = self._writer.register_schema(SCHEMA, "jsonschema", json.dumps(schema).encode())
        self._channel = self._writer.register_channel(TOPIC, "json", registered)

    def write(self, row: Sequence[float]) -> None:
        """Append a row. Its t is finite, and no less than the first row's.

        Raises: InputError: for a t that no message can have.
        """
        t = row[self._at]
        if self._since is None:
            self._since = min(t, 0.0)
        if not 0 <= t - self._since < _LAST:
            raise InputError(f"t: got {t:g} s, expected less than {_LAST:.3g} s, as MCAP counts")
        time = round((t - self._since) * 1e9)
        message = {n: x for n, x in zip(self._names, row, strict=True) if math.isfinite(x)}
        self._writer.add_message(self._channel, time, json.dumps(message).encode(), time)

    def flush(self) -> None:
        """End the chunk, and hand it to the system."""
        self._writer.flush()

    def finish(self) -> None:
        """Write the index of the file, which ends it."""
        self._writer.finish()


def iter_mcap(
    path: str | os.PathLike[str], chunk_rows: int, known: Known | None, gaps: bool = False
) -> Iterator[tuple[NumberTable, int]]:
    """Tables of up to `chunk_rows` messages, and how many bytes of the file each of them took.

    Columns are the numbers of the schema, or without one of the first message; t is the message's
    time since the first one, where no column is called so. A file that ends early, as that of a
    process that was killed, is read up to its last complete chunk, with a note.

    Args:   gaps: a number that is left out, or null, is NaN, and no error.
    Raises: InputError: for what is no MCAP file of one topic of JSON messages, or is damaged.
    """
    require_mcap()
    require_file(path)
    source, first, done = printable_path(path), 1, 0
    try:
        with open(path, "rb") as file:
            log = _Messages(file, os.path.getsize(path), source)
            rows = log.rows(known, gaps)
            while some := list(islice(rows, chunk_rows)):
                lines = np.arange(first, first + len(some))
                table = table_of(source, log.header, np.array(some).T, lines, "message", gaps)
                at = file.tell()
                yield replace(table, notes=log.notes), at - done
                first, done = first + len(some), at
    except OSError as error:
        raise InputError(f"{source}: cannot be read ({error.strerror or error})") from error


class _CutShortError(Exception):
    """The file ends within a record."""


class _Messages:
    """The messages of a file's one topic in JSON.

    Attributes: header: its columns, from the first row on;  notes: see `NumberTable`.
    """

    def __init__(self, file: BinaryIO, size: int, source: str) -> None:
        self.header, self.notes = Header({}, {}), list[str]()
        self._file, self._size, self._source = file, size, source
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}

    def rows(self, known: Known | None, gaps: bool) -> Iterator[list[float]]:
        """The numbers of the columns that are known, in the order of the header."""
        names, start, wanted, own_time = list[str](), 0, list[str](), False
        for at, message in enumerate(self._messages(), 1):
            where = f"{self._source}, message {at}"
            limits.MESSAGE.check(len(message.data), where)
            record = _object_of(message.data, where)
            if at == 1:
                names, start = self._names(message, record), message.log_time
                own_time = not any(_TIME.match(name) for name in names)
                names += ["t"] if own_time else []
                self.header = read_header(self._source, names, known)
                wanted = [names[i] for i in self.header.index.values()]
            if own_time:
                record["t"] = (message.log_time - start) * 1e-9
            yield [_number(record.get(name), gaps, where, name) for name in wanted]
        if not names:
            topics = [f"{c.topic} ({c.message_encoding})" for c in self._channels.values()]
            has = f"; it has {short(join(topics), 100)}" if topics else ""
            raise InputError(f"{self._source}: no messages in JSON{has}")

    def _names(self, message: Message, record: dict[str, Any]) -> list[str]:
        """The columns: numbers of the schema, or of a message without one."""
        schema = self._schemas.get(self._channels[message.channel_id].schema_id)
        if schema is not None and schema.encoding == "jsonschema":
            properties = _object_of(schema.data, f"{self._source}, schema").get("properties")
            if isinstance(properties, dict):
                return [
                    name
                    for name, kind in properties.items()
                    if isinstance(kind, dict) and kind.get("type") in ("number", "integer")
                ]
        return [name for name, x in record.items() if type(x) in (int, float)]

    def _messages(self) -> Iterator[Message]:
        from mcap.exceptions import McapError
        from mcap.records import Channel, Footer, Message, Schema

        if self._file.read(len(_MAGIC)) != _MAGIC:
            raise InputError(f"{self._source}: is no MCAP file")
        chosen, record = None, None
        try:
            for record in self._records():
                if isinstance(record, Schema):
                    self._schemas[record.id] = record
                elif isinstance(record, Channel):
                    self._channels[record.id] = record
                elif isinstance(record, Message) and self._in_json(record.channel_id):
                    chosen = chosen or record.channel_id
                    if record.channel_id != chosen:
                        topics = [self._channels[i].topic for i in (chosen, record.channel_id)]
                        raise InputError(
                            f"{self._source}: has JSON of the topics {quoted(topics)}; expected "
                            "one topic. Copy the one that is meant to a file of its own"
                        )
                    yield record
        except _CutShortError:
            record = None
        except (McapError, ValueError, struct.error) as error:
            said = short(str(error), 100)
            raise InputError(f"{self._source}: cannot be read as MCAP ({said})") from error
        if not isinstance(record, Footer):
            self.notes.append(
                f"{self._source}: has no end, as where its writer was stopped; it is read up to "
                "its last complete chunk"
            )

    def _in_json(self, channel: int) -> bool:
        if channel not in self._channels:
            raise InputError(f"{self._source}: has a message of no channel; it is damaged")
        return self._channels[channel].message_encoding == "json"

    def _records(self) -> Iterator[McapRecord]:
        """Records of the file, those of chunks among them, in turn; its footer is the last."""
        from mcap.records import Chunk, Footer

        for record in _records(self._file, self._size, self._source):
            if isinstance(record, Footer):
                yield record
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            content = _content(record, self._source)
            try:
                yield from _records(BytesIO(content), len(content), self._source)
            except _CutShortError:
                raise InputError(f"{self._source}: a chunk is damaged") from None


def _records(file: BinaryIO, size: int, source: str) -> Iterator[McapRecord]:
    """The records that rows need; others are passed over.

    Raises: _CutShortError: where one is longer than what is left.
    """
    from mcap.data_stream import ReadDataStream
    from mcap.opcode import Opcode
    from mcap.records import Channel, Chunk, Footer, Message, Schema

    kinds: dict[int, Any] = {
        Opcode.SCHEMA: Schema,
        Opcode.CHANNEL: Channel,
        Opcode.CHUNK: Chunk,
        Opcode.FOOTER: Footer,
    }
    while head := file.read(9):
        if len(head) < 9:
            raise _CutShortError
        opcode, length = struct.unpack("<BQ", head)
        if length > size - file.tell():
            raise _CutShortError
        if opcode != Opcode.MESSAGE and opcode not in kinds:
            file.seek(length, os.SEEK_CUR)
            continue
        limits.CHUNK.check(length, source)
        stream = ReadDataStream(BytesIO(file.read(length)))
        is_message = opcode == Opcode.MESSAGE
        yield Message.read(stream, length) if is_message else kinds[opcode].read(stream)


def _content(chunk: Chunk, source: str) -> bytes:
    """What a chunk holds, as far as it may.

    Raises: InputError: for too much, another compression, or a checksum that does not fit.
    """
    import lz4.frame
    import zstandard

    most = limits.CHUNK.most
    limits.CHUNK.check(chunk.uncompressed_size, source)
    try:
        if chunk.compression == "zstd":
            reader = zstandard.ZstdDecompressor(max_window_size=most).stream_reader(chunk.data)
            content = reader.read(most + 1)
        elif chunk.compression == "lz4":
            content = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, most + 1)
        elif not chunk.compression:
            content = chunk.data
        else:
            raise InputError(f'{source}: no compression "{short(chunk.compression)}" is known')
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise InputError(f"{source}: a chunk is damaged ({short(str(error), 100)})") from error
    limits.CHUNK.check(len(content), source)
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise InputError(f"{source}: a chunk is damaged: its checksum is another")
    return content


def _object_of(data: bytes, where: str) -> dict[str, Any]:
    """An object in JSON.

    Raises: InputError: for anything else.
    """
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: is no JSON ({short(str(error), 100)})") from error
    if not isinstance(found, dict):
        raise InputError(f"{where}: expected an object in JSON, got {brief(found)}")
    return found


def _number(x: Any, gaps: bool, where: str, name: str) -> float:
    column = f'{where}, column "{short(name)}"'
    if x is None:
        if not gaps:
            raise InputError(f"{column}: is left out; every message needs a number")
        return math.nan
    if type(x) not in (int, float):
        raise InputError(f"{column}: got {brief(x)}, expected a number")
    try:
        return float(x)
    except OverflowError:
        raise InputError(f"{column}: got a number that is too large") from None
