"""Tables that stand at one place of a file and say by their `kind` which they are."""

from __future__ import annotations

from functools import lru_cache, reduce
from operator import or_
from typing import Annotated, Any, TypeVar, get_args

from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, TypeAdapter, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from ..errors import InputError, brief
from .messages import entry
from .table import Table
from .table_schema import schema_of

T = TypeVar("T", bound=Table)


class Kinds(dict[str, type[T]]):
    """The tables of one place, by kind. As the annotation of a field it reads one of them.

    An entry adds a kind from anywhere: `SURFACES["wave"] = Wave`. Files read from then on may name
    it, and schemas, hints and every export have it. A package that names its module as an entry
    point of the `group` has its kinds added where a file first names one that is not known.
    """

    def __init__(self, group: str, *tables: type[T]) -> None:
        super().__init__({kind_of(table): table for table in tables})
        self._group, self._loaded = group, False

    def __setitem__(self, kind: str, table: type[T]) -> None:
        if kind != kind_of(table):
            raise InputError(
                f"{self._group}: expected the entry to be called {brief(kind_of(table))}, as the "
                f"table's `kind` is, got {brief(kind)}"
            )
        super().__setitem__(kind, table)
        schema_of.cache_clear()

    def __delitem__(self, kind: str) -> None:
        super().__delitem__(kind)
        schema_of.cache_clear()

    def __hash__(self) -> int:  # type: ignore[override]
        return id(self)

    def _load(self) -> None:
        """Add the kinds of installed packages, once."""
        if self._loaded:
            return
        from importlib.metadata import entry_points  # which takes a while

        self._loaded = True
        for point in entry_points(group=self._group):
            point.load()

    def _read(self, value: Any, info: ValidationInfo) -> Any:
        if isinstance(kind := entry(value, "kind"), str) and kind not in self:
            self._load()
        # Problems within keep their places: pydantic puts this one's in front.
        return _adapter(tuple(self.values())).validator.validate_python(value, context=info.context)

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        return core_schema.with_info_plain_validator_function(self._read)

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        self._load()
        return handler(_adapter(tuple(self.values())).core_schema)


def kind_of(table: type[Table]) -> str:
    """The kind by which files name a table: the one that its key `kind` may be."""
    return str(get_args(table.model_fields["kind"].annotation)[0])


@lru_cache(maxsize=32)
def _adapter(tables: tuple[type[Table], ...]) -> TypeAdapter[Any]:
    union: Any = reduce(or_, tables)  # type: ignore[arg-type]
    return TypeAdapter(Annotated[union, Field(discriminator="kind")])
