"""Values by name, as text with units: `Y=1 mm,alpha=2 deg`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..errors import InputError, brief, did_you_mean
from .column_units import dimension, unit_factor

Values = str | Mapping[str, float]


def parsed(text: str, form: str, example: str, argument: str) -> tuple[str, list[str], str]:
    """Name, numbers and unit of text such as `X=-5:5:200 mm`.

    Args: form: what is expected, with as many numbers, as in "name=low:high:count unit".
          argument: that the text is of, for messages.
    """
    name, _, rest = text.partition("=")
    *numbers, last = (part.strip() for part in rest.split(":"))
    last, _, unit = last.partition(" ")
    numbers.append(last)
    if not all([name.strip(), *numbers]) or len(numbers) != form.count(":") + 1:
        raise InputError(
            f'{argument}: expected {form}, as in "{example}", got {brief(text.strip())}'
        )
    return name.strip(), numbers, unit.strip()


def values_of(given: Values, known: Sequence[str], argument: str) -> dict[str, float]:
    """`Y=0 mm,alpha=0 deg` by name, in SI.

    Raises: InputError: for a name that is not known, one that stands twice, or no number.
    """
    if isinstance(given, Mapping):
        pairs = [
            (name, number(value, f"{argument}: {name}={value}")) for name, value in given.items()
        ]
    elif not isinstance(given, str):
        raise InputError(
            f"{argument}: expected text such as Y=1 mm, or numbers by name, got {brief(given)}"
        )
    else:
        pairs = []
        for part in given.split(",") if given.strip() else []:
            name, (value,), unit = parsed(part, "name=value unit", "Y=1 mm", argument)
            where = f"{argument}: {part.strip()}"
            pairs.append((name, number(value, where) * scale_of(name, unit, where)))
    for name in (names := [name for name, _ in pairs]):
        if name not in known:
            raise InputError(f'{argument}: unknown name "{name}".{did_you_mean(name, known)}')
        if names.count(name) > 1:
            raise InputError(f"{argument}: {name} is given twice")
    return dict(pairs)


def number(given: object, where: str) -> float:
    """A finite number; `where` begins with the argument's name."""
    try:
        value = float(given)  # type: ignore[arg-type]
    except Exception:  # of objects
        joined = isinstance(given, str) and given[:1] in "+-.0123456789"
        hint = "; a unit stands behind a space" if joined else ""
        raise InputError(f"{where}: expected a number, got {brief(given)}{hint}") from None
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {given}")
    return value


def scale_of(name: str, unit: str, where: str) -> float:
    """Factor to SI of the unit of a column's name; 1 without a unit."""
    kind = dimension(name)
    if not unit or kind is None:  # an unknown name is told of later, with what there is
        return 1.0
    return unit_factor(unit, kind, f"{where}: ")
