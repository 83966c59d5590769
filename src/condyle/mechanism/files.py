"""Mechanism files: TOML in, TOML out, the JSON schema, and the bundled mechanisms."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ..errors import InputError, MechanismError, did_you_mean
from .chain import Chain
from .home import holding_problems, home_problem
from .mechanism import COORDINATES, SIDE_OPTIONS, Contact, Mechanism, structural_problems
from .quantities import PER_METRE
from .surface import Plane, Unknown

_BUNDLED = files(__package__) / "bundled"


def bundled_mechanisms() -> tuple[str, ...]:
    """Names of the mechanisms that come with the package."""
    return tuple(sorted(f.name[:-5] for f in _BUNDLED.iterdir() if f.name.endswith(".toml")))


def bundled_text(name: str) -> str:
    """The file of a bundled mechanism, with its comments and provenance marks.

    Raises: InputError: if no bundled mechanism has that name.
    """
    if name not in bundled_mechanisms():
        raise InputError(
            f'no bundled mechanism is called "{name}".{did_you_mean(name, bundled_mechanisms())}'
        )
    return (_BUNDLED / f"{name}.toml").read_text(encoding="utf-8")


def load(source: str | Path) -> Mechanism:
    """Read a mechanism.

    Args:   source: path of a TOML file, or the name of a bundled mechanism.
    Raises: MechanismError: with every problem found in the file.
            InputError:     if there is no such file or it is not TOML.
    """
    return parse(read_text(source), str(source))


def read_text(source: str | Path) -> str:
    """The text of a mechanism file or of a bundled mechanism."""
    path = Path(source)
    if str(source) in bundled_mechanisms() and not path.is_file():
        return bundled_text(str(source))
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        near = {p.name for p in path.parent.glob("*.toml")} if path.parent.is_dir() else set()
        raise InputError(
            f"mechanism file {source} does not exist, and no bundled mechanism has that name."
            + did_you_mean(path.name, {*bundled_mechanisms(), *near})
        ) from None
    except UnicodeDecodeError:
        raise InputError(f"{source} is not a text file (UTF-8 expected)") from None
    except OSError as error:
        raise InputError(f'mechanism file "{source}" cannot be read: {error.strerror}') from None


def parse(text: str, source: str = "mechanism") -> Mechanism:
    """A mechanism from the text of a file; `source` names it in messages."""
    return from_data(read_tables(text, source), source)


def read_tables(text: str, source: str) -> dict[str, Any]:
    """The tables of a file as TOML gives them."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source} is not TOML: {error}") from None


def from_data(
    data: Mapping[str, Any],
    source: str = "mechanism",
    at_home: bool = True,
    notes: bool = False,
) -> Mechanism:
    """A mechanism from the tables of a file, lengths in its `length_unit`.

    Args: at_home: whether the contacts must be on their surfaces and hold the platform.
          notes: whether a note may stand in the place of a surface, as `record` leaves it.
    """
    data = dict(data)
    unit = data.pop("length_unit", "m")
    problems = []
    if not isinstance(unit, str) or unit not in PER_METRE:
        problems.append(f'length_unit: expected "m" or "mm", got {_shown(unit)}')
        unit = "m"
    context = {"per_metre": PER_METRE[unit], "notes": notes}
    # Names that Python has for a key of the file are no keys of the file.
    aliased = {name for name, field in Mechanism.model_fields.items() if field.alias}
    for key in aliased & data.keys():
        problems.append(f"{key}: {_message({'type': 'extra_forbidden', 'loc': (key,)})}")
        del data[key]
    mechanism = None
    try:
        mechanism = Mechanism.model_validate(data, context=context)
    except ValidationError as error:
        structural = list(structural_problems(data))
        problems += structural
        problems += [p for p in describe(error, data) if not any(s in p for s in structural)]
    problems += _contact_problems(data, context) if at_home else ()
    if problems:
        raise MechanismError(source, problems)
    assert mechanism is not None
    return mechanism


def _contact_problems(data: Mapping[str, Any], context: Mapping[str, Any]) -> Iterator[str]:
    """Contacts that are off their surface at home or cannot hold the platform.

    They are found also where other parts of the file are not valid yet.
    """
    contacts = _valid(Contact, data.get("contact"), context)
    chains = [chain for chain in _valid(Chain, data.get("chain"), context) if chain is not None]
    off = False
    for index, contact in enumerate(contacts):
        if contact is not None and (problem := home_problem(contact)) is not None:
            off = True
            yield f"{_place(('contact', index), data)}: {problem}"
    if off or None in contacts or len(contacts) > 5 or not chains:
        return
    given = data.get("dependent")
    names = tuple(map(str, given)) if isinstance(given, list) else ()
    valid = {*names} <= {*COORDINATES} and len({*names}) == len(names) == len(contacts)
    draft = Mechanism.model_construct(
        contacts=tuple(contacts), chains=tuple(chains), dependent=names if valid else None
    )
    yield from holding_problems(draft)


def _valid(kind: Any, tables: Any, context: Mapping[str, Any]) -> list[Any]:
    """Each table as a `kind`, None where it is none."""
    adapter, found = TypeAdapter(kind), []
    for table in tables if isinstance(tables, list) else ():
        try:
            found.append(adapter.validate_python(table, context=dict(context)))
        except ValidationError:
            found.append(None)
    return found


def describe(error: ValidationError, data: Mapping[str, Any]) -> list[str]:
    """One line a problem: where it is, by the names of the file, and what would be right."""
    lines = []
    for problem in error.errors(include_url=False):
        place = _place(problem["loc"], data)
        lines.append(f"{place}: {_message(problem)}" if place else _message(problem))
    return lines


def _place(location: Iterable[Any], data: Any) -> str:
    """'chain "masseter_left".coupler.mass' for ("chain", 2, "RSS", "coupler", "mass")."""
    text, here = "", data
    for part in location:
        if isinstance(part, int):
            here = here[part] if isinstance(here, list | tuple) and part < len(here) else None
            name = here.get("name") if isinstance(here, Mapping) else None
            text += f' "{name}"' if isinstance(name, str) else f"[{part}]"
        elif isinstance(here, Mapping) and part not in here and here.get("kind") == part:
            continue  # pydantic names the family of a union too
        else:
            here = here.get(part) if isinstance(here, Mapping) else None
            text += f".{part}" if text else str(part)
    return text


def _message(problem: Any) -> str:
    kind, got, context = problem["type"], problem.get("input"), problem.get("ctx", {})
    expected = {
        "missing": "is missing",
        "extra_forbidden": "is not a key of the file format; remove it or mend its spelling.",
        "float_type": f"expected a number, got {_shown(got)}",
        "finite_number": f"expected a finite number, got {_shown(got)}",
        "greater_than": f"expected a value above {context.get('gt')}, got {_shown(got)}",
        "greater_than_equal": f"expected a value of at least {context.get('ge')}, "
        f"got {_shown(got)}",
        "less_than_equal": f"expected a value of at most {context.get('le')}, got {_shown(got)}",
        "tuple_type": f"expected a list of numbers, got {_shown(got)}",
        "too_long": f"expected at most {context.get('max_length')} entries, "
        f"got {context.get('actual_length')}",
        "too_short": f"expected at least {context.get('min_length')} entries, "
        f"got {context.get('actual_length')}",
        "model_type": f"expected a table, got {_shown(got)}",
        "dict_type": f"expected a table, got {_shown(got)}",
        "string_type": f"expected text in quotes, got {_shown(got)}",
        "bool_type": f"expected true or false, got {_shown(got)}",
        "value_error": str(context.get("error", "")),
        "literal_error": f"expected {context.get('expected')}, got {_shown(got)}",
        "union_tag_invalid": f"the kind {_shown(context.get('tag'))} is unknown."
        + did_you_mean(str(context.get("tag")), _quoted(context.get("expected_tags"))),
        "union_tag_not_found": "the key `kind` is missing",
    }.get(kind)
    if expected is None:
        expected = re.sub(r"^Value error, ", "", problem["msg"]) + f", got {_shown(got)}"
    if kind == "extra_forbidden":
        expected += did_you_mean(str(problem["loc"][-1]), _keys(problem["loc"][:-1]))
    return expected


def _quoted(text: Any) -> list[str]:
    """a, b of "'a', 'b'"."""
    return re.findall("'([^']*)'", str(text))


def _keys(location: Iterable[Any]) -> list[str]:
    """Keys that a table may have, by its place as pydantic gives it."""
    schema = _schema()
    here = schema
    for part in location:
        here = here.get("items", {}) if isinstance(part, int) else _inside(here, part)
        here = _followed(here, schema)
    return list(here.get("properties", {}))


def _inside(here: Mapping[str, Any], part: str) -> Any:
    """The schema of a key, or of one of several kinds."""
    kinds = here.get("discriminator", {}).get("mapping", {})
    return {"$ref": kinds[part]} if part in kinds else here.get("properties", {}).get(part, {})


def _followed(here: Mapping[str, Any], schema: Mapping[str, Any]) -> Any:
    """A schema with its reference, if it is one, looked up."""
    here = next((one for one in here.get("anyOf", ()) if "$ref" in one), here)
    name = str(here.get("$ref", "")).rpartition("/")[2]
    return schema["$defs"][name] if name else here


@lru_cache(maxsize=1)
def _schema() -> dict[str, Any]:
    return json_schema()


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def dumps(mechanism: Mechanism) -> str:
    """The mechanism as a TOML file in SI; `parse(dumps(m)) == m` to the last bit.

    Raises: InputError: if a surface is a Python expression, which a file cannot hold.
    """
    if names := written_in_python(mechanism):
        raise InputError(
            f"{mechanism.name}: the surface of {', '.join(names)} is a Python expression; a "
            "mechanism file holds kinds and numbers only. Use a kind of surface instead"
        )
    return _toml(_tables(mechanism))


def record(mechanism: Mechanism) -> str:
    """The mechanism as a solution keeps it: as `dumps`, with notes of surfaces from Python."""
    python = written_in_python(mechanism)
    if not python:
        return dumps(mechanism)
    stand_in = {"surface": Plane(slope=(0.0, 0.0), offset=0.0)}
    contacts = tuple(
        contact.model_copy(update=stand_in) if contact.name in python else contact
        for contact in mechanism.contacts
    )
    data = _tables(mechanism.model_copy(update={"contacts": contacts}))
    for table, contact in zip(data["contact"], mechanism.contacts, strict=True):
        if contact.name in python:
            table["surface"] = {"kind": Unknown.kind, "closed": contact.surface.closed}
    note = f"# The surface of {', '.join(python)} was written in Python; a file cannot hold it.\n"
    return note + _toml(data)


def recall(text: str, source: str = "mechanism") -> Mechanism:
    """The mechanism of a solution, from what `record` made of it.

    A surface from Python comes back as an `Unknown` one, which can be shown but not computed with.
    """
    return from_data(read_tables(text, source), source, at_home=False, notes=True)


def _tables(mechanism: Mechanism) -> dict[str, Any]:
    """The tables of a file in SI."""
    data = mechanism.model_dump(by_alias=True, exclude_none=True, exclude_defaults=False)
    return _without_empty({"length_unit": "m", **data})


def _toml(data: dict[str, Any]) -> str:
    import tomli_w

    return tomli_w.dumps(data)


def written_in_python(mechanism: Mechanism) -> list[str]:
    """Names of contacts whose surface is, or was, a Python expression."""
    return [c.name for c in mechanism.contacts if c.surface.kind == Unknown.kind]


def _without_empty(value: Any) -> Any:
    if isinstance(value, Mapping):
        kept = {key: _without_empty(item) for key, item in value.items()}
        return {key: item for key, item in kept.items() if item != {}}
    if isinstance(value, list | tuple):
        return [_without_empty(item) for item in value]
    return value


def dump(mechanism: Mechanism, path: str | Path) -> None:
    """Write the mechanism as a TOML file in SI, whole or not at all."""
    from ..atomic import write_text

    write_text(path, dumps(mechanism))


def json_schema() -> dict[str, Any]:
    """The JSON schema of mechanism files, for editors."""
    schema = Mechanism.model_json_schema(by_alias=True)
    schema["title"] = "condyle mechanism"
    unit = {
        "enum": list(PER_METRE),
        "default": "m",
        "description": "unit of every length in the file; all else is SI",
    }
    schema["properties"] = {"length_unit": unit, **schema["properties"]}
    kinds, contact = schema["$defs"], schema["$defs"]["Contact"]["properties"]
    for surface in contact["surface"]["discriminator"]["mapping"].values():
        table = kinds[surface.rpartition("/")[2]]["properties"]
        table |= {key: contact[key] for key in SIDE_OPTIONS}
    return schema
