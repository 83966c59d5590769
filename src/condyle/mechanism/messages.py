"""Messages of pydantic's errors in the words of the file: where, what was got, what is right."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from ..errors import brief, did_you_mean, nearest, shortened
from .table_schema import keys_at

# Families of chains by the names that others give them: a joint U where here it is S.
ALSO_CALLED = {"RUS": "RSS", "PUS": "PSS", "UPS": "SPS", "SPU": "SPS"}


def describe(error: ValidationError, data: Any, root: type[BaseModel]) -> list[str]:
    """One line per problem: where it is, by the names of the file, and what would be right.

    Args: data: what was validated;  root: the kind of table that it is not.
    """
    by_place: dict[str, list[str]] = {}
    problems: list[Any] = error.errors(include_url=False)
    meant = {_meant(detail, root) for detail in problems}
    for problem in problems:
        if _follows(problem) or (problem["type"] == "missing" and problem["loc"] in meant):
            continue
        place = place_of(problem["loc"], data)
        by_place.setdefault(place, []).append(_message(problem, root))
    return [
        f"{place}: {text}" if place else text
        for place, texts in by_place.items()
        for text in _alternatives(list(dict.fromkeys(texts)))
    ]


def _alternatives(texts: list[str]) -> list[str]:
    """The problems of one place; alternatives of what one value may be are joined into one."""
    parts = [text.rpartition(", got ") for text in texts]
    alike = len({got for _, _, got in parts}) == 1
    if len(texts) < 2 or not alike or not all(text.startswith("expected ") for text in texts):
        return texts
    ways = dict.fromkeys(said.removeprefix("expected ") for said, _, _ in parts)
    return [f"expected {' or '.join(ways)}, got {parts[0][2]}"]


def of_file(
    problems: list[str], data: Mapping[str, Any], root: type[BaseModel], source: str
) -> list[str]:
    """The problems of a file, or only that it is a file of another kind.

    Args: data: the file's tables;  root: the kind that was expected;  source: names the file.
    """
    from ..analysis.studies import misplaced

    other = misplaced(data, root, source)
    return [other] if other else problems


def _follows(problem: Any) -> bool:
    """Whether a problem follows from others: entries that were refused are not missing, and what
    may be a number or several is judged as what it is."""
    if any(_is_member(part) for part in problem["loc"]):
        several = isinstance(problem.get("input"), list | tuple)
        if problem["type"] == ("float_type" if several else "tuple_type"):
            return True
    if problem["type"] != "too_short":
        return False
    given, context = problem.get("input"), problem["ctx"]
    return isinstance(given, list | tuple) and len(given) >= context["min_length"]


def _meant(problem: Any, root: type[BaseModel]) -> tuple[str, ...]:
    """Place of the key that an unknown one is most like: that is misspelt then, not missing."""
    if problem["type"] != "extra_forbidden":
        return ()
    *place, key = problem["loc"]
    return (*place, *nearest(str(key), keys_at(root, place))[:1])


def place_of(location: Iterable[Any], data: Any) -> str:
    """'chain "masseter_left".coupler.mass' for ("chain", 2, "RSS", "coupler", "mass")."""
    text, here = "", data
    for part in location:
        if isinstance(part, int):
            here = here[part] if isinstance(here, list | tuple) and part < len(here) else None
            name = entry(here, "name")
            text += f' "{shortened(name, 40)}"' if isinstance(name, str) else f"[{part}]"
        elif entry(here, part) is None and entry(here, "kind") == part:
            continue  # pydantic names the family of a union too
        elif entry(here, part) is None and _is_member(part):
            continue  # and the type of one without families
        else:
            here = entry(here, part)
            key = shortened(str(part), 40)
            text += f".{key}" if text else key
    return text


def _is_member(part: Any) -> bool:
    """Whether it is pydantic's name of a type, such as tuple[...], bool or constrained-float."""
    return isinstance(part, str) and (
        part == "bool" or part.startswith("constrained-") or (part.endswith("]") and "[" in part)
    )


def entry(table: Any, key: str) -> Any:
    """The value under a key of a table, of a file or validated; None if there is none."""
    if isinstance(table, Mapping):
        return table.get(key)
    return getattr(table, key, None) if isinstance(table, BaseModel) else None


def _message(problem: Any, root: type[BaseModel]) -> str:
    kind, got, context = problem["type"], problem.get("input"), problem.get("ctx", {})
    location, tag = problem["loc"], str(context.get("tag"))
    if kind == "extra_forbidden":
        return unknown_key(str(location[-1]), location[:-1], root)
    if kind == "tuple_type" and location in (("contact",), ("chain",), ("ligament",), ("wall",)):
        return f"expected tables, each under [[{location[0]}]], got {brief(got)}"
    expected = {
        "missing": "is missing",
        "float_type": f"expected a number, got {brief(got)}",
        "int_type": f"expected a whole number, got {brief(got)}",
        "int_from_float": f"expected a whole number, got {brief(got)}",
        "finite_number": f"expected a finite number, got {brief(got)}",
        "greater_than": f"expected a value above {context.get('gt')}, got {brief(got)}",
        "greater_than_equal": f"expected a value of at least {context.get('ge')}, got {brief(got)}",
        "less_than": f"expected a value below {context.get('lt')}, got {brief(got)}",
        "less_than_equal": f"expected a value of at most {context.get('le')}, got {brief(got)}",
        "tuple_type": f"expected a list, got {brief(got)}",
        "too_long": f"expected at most {context.get('max_length')} entries, "
        f"got {context.get('actual_length')}",
        "too_short": f"expected at least {context.get('min_length')} entries, "
        f"got {context.get('actual_length')}",
        "model_type": f"expected a table, got {brief(got)}",
        "model_attributes_type": f"expected a table, got {brief(got)}",
        "dict_type": f"expected a table, got {brief(got)}",
        "string_type": f"expected text in quotes, got {brief(got)}",
        "bool_type": f"expected true or false, got {brief(got)}",
        "value_error": str(context.get("error", "")),
        "literal_error": f"expected {context.get('expected')}, got {brief(got)}",
        "union_tag_invalid": f"the kind {brief(tag)} is unknown."
        + did_you_mean(ALSO_CALLED.get(tag.upper(), tag), _quoted(context.get("expected_tags"))),
        "union_tag_not_found": "the key `kind` is missing",
    }.get(kind)
    if expected is None:
        expected = re.sub(r"^Value error, ", "", problem["msg"]) + f", got {brief(got)}"
    return expected


def unknown_key(key: str, location: Iterable[Any], root: type[BaseModel]) -> str:
    """Advice on a key that a table at this place does not have."""
    hint = did_you_mean(key, keys_at(root, location))
    return f"is not a key of the file format; remove it or correct its spelling.{hint}"


def _quoted(text: Any) -> list[str]:
    """a, b of "'a', 'b'"."""
    return re.findall("'([^']*)'", str(text))
