"""What every table of a mechanism is: frozen, checked, and checked again where it is changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, NoReturn, Self

from pydantic import BaseModel, ConfigDict, ValidationError

from ..errors import MechanismError, ProblemsError, as_name
from .messages import describe
from .quantities import with_units


class Table(BaseModel):
    """A table of the file: frozen, and with no key that it does not know.

    A table that comes to stand in another is validated there once more, so that none can carry
    numbers in that were never looked at.
    """

    model_config: ClassVar[ConfigDict] = ConfigDict(
        extra="forbid",
        frozen=True,
        populate_by_name=True,
        revalidate_instances="always",
        json_schema_extra=with_units,
    )

    # Entries that a file does without where they are their defaults.
    implied: ClassVar[tuple[str, ...]] = ()
    refusal: ClassVar[type[ProblemsError]] = MechanismError

    def __init__(self, **entries: Any) -> None:
        """Raises: MechanismError, or a `refusal` of its own: with every problem found."""
        try:
            super().__init__(**entries)
        except ValidationError as error:
            title = type(self).__name__.lower()
            raise self.refusal(title, describe(error, entries, type(self))) from None

    # Validation of files does not go through it: it knows more than the entries.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    def entries(self) -> dict[str, Any]:
        """What stands in the table, by the keys of the file."""
        fields = type(self).model_fields
        return {field.alias or name: getattr(self, name) for name, field in fields.items()}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with some entries changed, validated as the table itself was. SI.

        Raises: MechanismError: with every problem found, unknown keys among them.
        """
        if not update:
            return super().model_copy(deep=deep)
        return self.checked(self._changed(update), self.title())

    def copy(self, *, update: Mapping[str, Any] | None = None, **options: Any) -> Self:  # type: ignore[override]
        """As `model_copy`."""
        return self.model_copy(update=update, **options)

    @classmethod
    def checked(cls, data: Mapping[str, Any], source: str) -> Self:
        """A table of `data`, SI, by the keys of the file; `source` names it in messages.

        Raises: MechanismError: with every problem found.
        """
        as_name(source, "source")
        try:
            return cls.model_validate(data, context={"at_home": False})
        except ValidationError as error:
            raise MechanismError(source, describe(error, data, cls)) from None

    def title(self) -> str:
        """What messages call it."""
        return getattr(self, "name", None) or type(self).__name__

    def derived(self, **changes: Any) -> Self:
        """A copy with entries that follow from checked ones, unchecked: such as a surface that is
        parallel to one of the file."""
        return self.model_construct(**self._changed(changes))

    def _changed(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The entries with some changed; names that Python has for keys are keys too."""
        fields = type(self).model_fields
        names = {name: field.alias or name for name, field in fields.items()}
        return self.entries() | {names.get(name, name): v for name, v in changes.items()}


class FrozenTable(dict[str, Any]):
    """A table of free keys, which stays as it was validated."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[type[FrozenTable], tuple[dict[str, Any]]]:
        return type(self), (dict(self),)

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(
            "a mechanism is frozen; make another one with mechanism.set(path, value), such as "
            'mechanism.set("platform.points.tip", (0.05, 0, 0))'
        )

    __setitem__ = __delitem__ = update = pop = popitem = clear = setdefault = _refuse
    __ior__ = _refuse  # type: ignore[assignment]
