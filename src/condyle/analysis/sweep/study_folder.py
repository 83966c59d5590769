"""The folder of a sweep: its study, and its rows, a Parquet dataset in a folder of their own.

While a sweep runs these are parts, each whole or absent; at its end they are made one file.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import xarray as xr
from pydantic import BaseModel, Field, JsonValue

from ...errors import InputError, as_path, short
from ...files.atomic import make_folder, replacing, write_text
from ...files.limits import TEXT
from ...files.memory import require_memory
from ...files.reading import text_of
from ...mechanism.toml import read_tables
from ...mechanism.writing import record
from ...version import __version__
from .job import MOTION, REASON, SECONDS, STATUS, VARIANT, Job
from .part import PartRows
from .share import SLURM, Share, ranges

STUDY, ROWS, SOLUTIONS = "study.json", "rows", "solutions"
PART, ALL = "part-{:06d}.parquet", "all.parquet"
_MANY = 5  # differences that a message shows


class Store:
    """The rows of a job on disk, and which of its parts are written."""

    def __init__(self, job: Job, folder: str | os.PathLike[str], resume: bool) -> None:
        """Make the folder, or continue in it.

        Raises: InputError: if it holds another study, or this one and `resume` was not asked for.
        """
        self.folder: Path = Path(as_path(folder, "out", "a folder"))
        self._job = job
        study = described(job)
        stored = _recorded_study(self.folder)
        if stored is not None:
            if differences := list(_differences(stored, study)):
                more = len(differences) - _MANY
                text = "; ".join(differences[:_MANY]) + (f"; and {more} more" if more > 0 else "")
                raise InputError(
                    f"{folder} holds another study: {text}. Continue the old one, or choose "
                    "another folder"
                )
            if not resume:
                raise InputError(
                    f"{folder} holds this study already: continue with --resume (in Python "
                    "resume=True), or choose another folder"
                )
            return
        if any(_files(self.folder)):
            raise InputError(
                f"{folder} holds rows of a study, but {STUDY} is missing; choose another folder"
            )
        make_folder(self.folder / ROWS)
        write_text(self.folder / STUDY, json.dumps(study, indent=1))

    def missing(self, parts: Sequence[int]) -> list[int]:
        """Numbers of parts that are not written yet."""
        return _missing(self.folder, parts)

    def write(self, part: int, rows: PartRows) -> None:
        """Write a part, whole or not at all; solutions first, so that a row has its own.

        Raises: InputError: if that fails, on a full disk for one.
        """
        for (variant, motion), solution in rows.solutions.items():
            (self.folder / SOLUTIONS).mkdir(exist_ok=True)
            with replacing(self.folder / SOLUTIONS / f"{variant:09d}-{motion}.nc") as temporary:
                temporary.write_bytes(solution)
        with replacing(self.folder / ROWS / PART.format(part)) as temporary:
            pq.write_table(rows.table, temporary)

    def join(self) -> None:
        """Make one file of all parts, a part after the other.

        Raises: InputError: if that fails; the parts stay.
        """
        parts = [self.folder / ROWS / PART.format(p) for p in range(self._job.parts)]
        if not (self.folder / ROWS / ALL).is_file():
            with (
                replacing(self.folder / ROWS / ALL) as temporary,
                pq.ParquetWriter(temporary, pq.read_schema(parts[0])) as writer,
            ):
                for part in parts:
                    writer.write_table(pq.read_table(part))
        for part in parts:
            part.unlink(missing_ok=True)


def open_sweep(folder: str | os.PathLike[str], part: str | None = None) -> xr.Dataset:
    """The rows of a sweep from its folder, in the order of the study, along `row`.

    Attributes: study (JSON), rows (of the whole study), parameters, measures, missing: numbers of
    the files of rows that are not there, "3,7-9".

    Args:   part: "i/n": the rows of one part alone.
    Raises: InputError: for a folder that holds no study, or no row of it yet.
    """
    study = _recorded_study(Path(as_path(folder, "folder", "the folder of a sweep")))
    if study is None:
        raise InputError(f"{folder} is not the folder of a sweep: {STUDY} is missing")
    numbers: Sequence[int] = _parts(study)
    parts = _files(Path(folder))
    if part is not None:
        numbers = Share.read(part).of(numbers)
        own = {PART.format(number) for number in numbers}
        parts = [path for path in parts if path.name in {*own, ALL}]
    if not parts:
        raise InputError(
            f"{folder} has no rows yet; continue with --resume (in Python resume=True)"
        )
    try:
        _check_size(folder, parts, study)
        texts = [MOTION, STATUS, REASON]  # which many rows may share
        table = pa.concat_tables(pq.read_table(path, read_dictionary=texts) for path in parts)
        variables = {}
        for name in table.column_names:
            column = table.column(name).unify_dictionaries()
            for chunk in column.chunks if pa.types.is_dictionary(column.type) else ():
                lengths = pc.binary_length(chunk.dictionary)
                TEXT.check(pc.max(lengths).as_py() or 0, f"{folder}: {name}")
            variables[name] = "row", np.asarray(column.to_pandas())
    except (OSError, MemoryError, ValueError, pa.ArrowException) as error:
        raise InputError(f"{folder}: a part cannot be read ({error})") from None
    facts = {name: json.dumps(study[name]) for name in ("study", "units", "better")}
    lists = {name: list(study[name]) for name in ("parameters", "measures")}
    attributes = {"rows": study["rows"], "condyle_version": study["condyle"], **facts, **lists}
    attributes["missing"] = ranges(_missing(Path(folder), numbers))
    found = xr.Dataset(variables, attrs=attributes)
    if part is None:
        return found
    return found.isel(row=np.isin(found[VARIANT].values // study["part"], numbers))


def missing_shares(folder: str | os.PathLike[str], part: str) -> list[int]:
    """Every i of "i/n" of which a part is missing in the folder of a sweep; all, if it is none yet.

    Raises: InputError: for another text, or more shares than parts.
    """
    count = Share.read(part, {SLURM: "1"}).count
    kept = _recorded_study(Path(as_path(folder, "out", "a folder")))
    if kept is None:
        return list(range(1, count + 1))
    numbers = _parts(kept)
    shares = (Share(i, count) for i in range(1, count + 1))
    missing = {*_missing(Path(folder), numbers)}
    return [share.number for share in shares if not missing.isdisjoint(share.of(numbers))]


def _parts(kept: Mapping[str, Any]) -> range:
    """Numbers of the parts of a recorded study."""
    variants = kept["rows"] // max(len(kept["motions"]), 1)
    return range(-(-variants // kept["part"]))


def _missing(folder: Path, parts: Sequence[int]) -> list[int]:
    """Numbers of parts without a file."""
    there = {path.name for path in _files(folder)}
    return [] if ALL in there else [p for p in parts if PART.format(p) not in there]


def _check_size(
    folder: str | os.PathLike[str], parts: Sequence[Path], study: Mapping[str, Any]
) -> None:
    """Check the size of all rows as arrays, by the parts' ends, before any row is read.

    Raises: InputError: for rows or columns that the study does not have, or too many.
    """
    columns = [VARIANT, MOTION, *study["parameters"], *study["measures"], STATUS, REASON, SECONDS]
    rows = 0
    for path in parts:
        about = pq.read_metadata(path)
        names = about.schema.to_arrow_schema().names
        if not {VARIANT, STATUS, REASON} <= {*names} <= {*columns}:
            raise InputError(f"{folder}: {path.name} has columns that its study does not have")
        rows += about.num_rows
    if rows > study["rows"]:
        raise InputError(f"{folder} has {rows} rows, and its study {study['rows']}")
    require_memory(8 * rows * len(columns), f"{folder}: its rows take")


def _files(folder: Path) -> list[Path]:
    """The files of rows: the one of all, or parts in their order."""
    joined = folder / ROWS / ALL
    return [joined] if joined.is_file() else sorted((folder / ROWS).glob("part-*.parquet"))


def described(job: Job) -> dict[str, Any]:
    """Everything that determines the rows, as JSON."""
    units = {name: one.units for one in job.readings for name in one.names}
    measures = zip(job.study.measure.values(), job.readings, strict=True)
    better = {n: m.better for m, one in measures for n in one.names if m.better is not None}
    return {
        "condyle": __version__,
        "study": job.study.data(),
        "mechanism": read_tables(record(job.mechanism), "mechanism"),
        "motions": [_sha256(m.t, m.value, m.rate, m.acceleration) for m in job.motions],
        "load": _sha256(*job.wrenches),
        "rows": job.rows,
        "part": job.part,
        "parameters": list(job.parameters),
        "measures": list(job.measures),
        "units": units,
        "better": better,
    }


def _sha256(*arrays: np.ndarray) -> str:
    found = hashlib.sha256()
    for a in arrays:
        found.update(np.ascontiguousarray(a).tobytes())
    return found.hexdigest()


class StudyRecord(BaseModel):
    """What the file of a study says, as far as it is read."""

    condyle: str
    study: dict[str, JsonValue]
    rows: int = Field(ge=0)
    part: int = Field(ge=1)
    motions: list[str]
    parameters: list[str]
    measures: list[str]
    units: dict[str, str]
    better: dict[str, str]


def _recorded_study(folder: Path) -> dict[str, Any] | None:
    """What a folder says of its study; None if it holds none."""
    if not (folder / STUDY).exists():
        return None
    try:
        found = json.loads(text_of(folder / STUDY))
        StudyRecord.model_validate(found)
        return found
    except (ValueError, RecursionError) as error:
        why = short(" ".join(str(error).split()), 200)
        raise InputError(f"{folder / STUDY} cannot be read ({why})") from None


def _differences(kept: Mapping[str, Any], asked: Mapping[str, Any]) -> Iterator[str]:
    """'study.vary[0].range[1] was 0.045, is 0.05' for each that differs."""
    old, new = dict(_leaves(kept)), dict(_leaves(json.loads(json.dumps(asked))))
    for path in {**old, **new}:
        if old.get(path) == new.get(path):
            continue
        if path.startswith(("motions", "load")):
            yield f"the samples of {path} differ"
        else:
            was, now = (json.dumps(d[path]) if path in d else "absent" for d in (old, new))
            yield f"{path} was {was}, is {now}"


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}.{key}" if path else key)
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from _leaves(inner, f"{path}[{i}]")
    else:
        yield path, value
