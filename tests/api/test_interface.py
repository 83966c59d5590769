"""What users build on changes on purpose alone: `tests/interface.json` lists it.

Names and arguments of the public page, commands and their options, keys of `--json`, headers of
CSV, keys of files, statuses. Where a change is meant, write the list anew and say it in the
changelog:

    WRITE_INTERFACE=1 python -m pytest tests/api/test_interface.py
"""

from __future__ import annotations

import inspect
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli.test_answers import documented_keys
from support.machines import model

import condyle
from condyle.analysis.studies import OTHERS, schema, studies
from condyle.cli import commands  # noqa: F401 - registers them
from condyle.cli.command import registered
from condyle.status import Status

LIST = Path(__file__).parents[1] / "interface.json"
MACHINES = ("masticatory", "human-jaw", "cable-robot")


@pytest.mark.slow
def test_it_is_what_the_list_says(tmp_path: Path) -> None:
    found = {
        "names": dict(names()),
        "commands": dict(options()),
        "json": {name: sorted(keys) for name, keys in documented_keys().items()},
        "csv": dict(headers(tmp_path)),
        "files": {kind: dict(keys(schema(kind))) for kind in {**OTHERS, **studies()}},
        "statuses": {status.name: int(status) for status in Status},
    }
    if "WRITE_INTERFACE" in os.environ:
        LIST.write_text(written(found), encoding="utf-8")
    wanted = json.loads(LIST.read_text(encoding="utf-8"))
    for part, entries in found.items():
        assert entries == wanted[part], part
    assert found.keys() == wanted.keys()


def written(of: Mapping[str, Any], indent: str = "") -> str:
    """JSON with a line an entry, so that a change is a line."""
    rows = []
    for name, entry in sorted(of.items()):
        nested = isinstance(entry, dict)
        value = written(entry, indent + " ") if nested else json.dumps(entry)
        rows.append(f"{indent} {json.dumps(name)}: {value.rstrip()}")
    return "{\n" + ",\n".join(rows) + f"\n{indent}}}\n"


def names() -> Iterator[tuple[str, Any]]:
    """Arguments of functions and methods with their defaults, as a call has them; properties."""
    for name in condyle.__all__:
        thing = getattr(condyle, name)
        yield name, arguments(thing)
        if inspect.isclass(thing):
            ours = [k for k in thing.__mro__ if k.__module__.startswith("condyle")]
            for own in {own for kind in ours for own in vars(kind) if not own.startswith("_")}:
                if not own.startswith("model_"):  # pydantic's
                    yield f"{name}.{own}", arguments(inspect.getattr_static(thing, own))


def arguments(thing: Any) -> str:
    """`(q, v=None, *, at='incisor')`, or what else it is."""
    thing = getattr(thing, "__func__", thing)
    if not callable(thing):
        return "property" if inspect.isdatadescriptor(thing) else "attribute"
    try:
        given = inspect.signature(thing).parameters.values()
    except ValueError:  # built in
        return "callable"
    empty = inspect.Parameter.empty
    bare = [one.replace(annotation=empty) for one in given if one.name not in ("self", "cls")]
    return re.sub(r"<object object at \w+>", "...", str(inspect.Signature(bare)))


def options() -> Iterator[tuple[str, list[str]]]:
    """Of every command: arguments and options, each with its default."""
    for name, command in registered():
        yield (
            name,
            [
                f"{'/'.join((*p.opts, *p.secondary_opts))} = {p.default!r}"
                for p in command.params
                if p.name != "help"
            ],
        )


def headers(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """Of every kind of table, for machines that have torques, muscles and cables."""
    for name in MACHINES:
        own = model(name)
        t, still = np.arange(6.0), np.zeros((6, len(own.independent)))
        motion = condyle.Motion.from_arrays(t, still, own.independent)
        own.solve(motion).condyle.save(folder / "solution.csv")
        yield f"{name}: solution", header(folder / "solution.csv")
        coordinates = [d + c for d in ("", "d", "dd") for c in own.independent]
        efforts = [f"tau_{chain}" for chain in own.mechanism.chain_names]
        joints = [f"joint_{chain}" for chain in own.mechanism.chain_names]
        for kind, columns, solve in (
            ("states", coordinates, condyle.solve_states),
            ("forward", [*coordinates[: 2 * still.shape[1]], *efforts], condyle.forward_states),
            ("derivatives", coordinates, condyle.derivative_states),
            ("pose", joints, condyle.pose_states),
        ):
            rows = folder / "rows.csv"
            rows.write_text(f"{','.join(columns)}\n{','.join('0' for _ in columns)}\n")
            solve(own, rows, folder / f"{kind}.csv")
            yield f"{name}: {kind}", header(folder / f"{kind}.csv")


def header(file: Path) -> list[str]:
    with file.open(encoding="utf-8") as lines:
        return next(lines).rstrip("\n").split(",")


def keys(of: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Keys of every table of a file, by the name that its schema gives the table."""
    for name, table in sorted({"": of, **of.get("$defs", {})}.items()):
        if "properties" in table:
            needed = table.get("required", ())
            yield (
                name,
                sorted(f"{key}{' (needed)' * (key in needed)}" for key in table["properties"]),
            )
