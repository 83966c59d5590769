"""A ball joint: a platform point that stays where it is in {S}, in all three directions.

It is three contacts, on planes across X, Y and Z through its centre: their forces are its three
reactions, in {S}. A file has it as one table, which is read as those three.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import (
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    TypeAdapter,
    ValidationInfo,
    WrapValidator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from .contact import Contact
from .quantities import Name, Point, listed
from .table import Table

AXES = ("x", "y", "z")


class BallJoint(Table):
    """The centre of a ball that the base holds: three contacts NAME_x, NAME_y and NAME_z."""

    kind: Literal["ball"]
    name: Name = Field(
        description="of the joint; its reactions are those of NAME_x, NAME_y, NAME_z"
    )
    point: Point = Field(description="centre of the ball, in {M}, and in {S} at home")

    @model_validator(mode="before")
    @classmethod
    def _nothing_else(cls, data: Any) -> Any:
        if isinstance(data, Mapping):
            more = sorted({*map(str, data)} & {*Contact.model_fields} - {*cls.model_fields})
            if more:
                raise ValueError(
                    f"{', '.join(more)}: a ball joint has a name, its kind and a point. It holds "
                    "the point in all directions, without friction, play or a side; a contact "
                    "without `kind` has those"
                )
        return data

    @property
    def contacts(self) -> list[dict[str, Any]]:
        """Its three contacts, as a file has them."""
        return _three(self.name, self.point)


_ENTRIES: TypeAdapter[Any] = TypeAdapter(
    list[Annotated[Any, WrapValidator(lambda table, _, info: _checked(table, info))]]
)


def is_ball(table: Any) -> bool:
    """Whether a table of a file is that of a ball joint."""
    return isinstance(table, Mapping) and table.get("kind") == "ball"


def separated(tables: Any) -> Any:
    """The contacts of a file, in its unit, with every ball joint as its three contacts.

    Those that are not valid stay as they are.
    """
    if not isinstance(tables, list | tuple):
        return tables
    found: list[Any] = []
    for table in tables:
        valid = is_ball(table) and {*table} == {"kind", "name", "point"}
        point = listed(table["point"]) if valid else ()
        fits = isinstance(point, list | tuple) and len(point) == len(AXES)
        found += _three(table["name"], point) if fits else [table]
    return found


class SeparatedContacts:
    """Marks the contacts of a mechanism, which a file may have as ball joints."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.with_info_before_validator_function(_read, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        found = handler(schema)
        joint = handler(BallJoint.__pydantic_core_schema__)
        return found | {"items": {"anyOf": [found["items"], joint]}}


def _read(tables: Any, info: ValidationInfo) -> Any:
    found = separated(tables)
    return _ENTRIES.validate_python(found, context=info.context) if found is not tables else tables


def joined(contacts: Sequence[Contact]) -> list[Contact | BallJoint]:
    """Contacts as a file has them: three that are a ball joint as its table."""
    found: list[Contact | BallJoint] = []
    for contact in contacts:
        found.append(contact)
        if (joint := _joint(found[-3:])) is not None:
            found[-3:] = [joint]
    return found


def of_joints(contacts: Sequence[Contact]) -> dict[str, BallJoint]:
    """The ball joint that a contact is of, by the contact's name."""
    joints = [one for one in joined(contacts) if isinstance(one, BallJoint)]
    return {contact["name"]: joint for joint in joints for contact in joint.contacts}


def _joint(three: Sequence[Any]) -> BallJoint | None:
    """The ball joint whose three contacts these are."""
    if [getattr(getattr(one, "surface", None), "axis", None) for one in three] != [*AXES]:
        return None
    joint = BallJoint(kind="ball", name=three[0].name.removesuffix("_x"), point=three[0].point)
    return joint if [Contact(**one) for one in joint.contacts] == [*three] else None


def _three(name: Any, point: Sequence[Any]) -> list[dict[str, Any]]:
    return [
        {
            "name": f"{name}_{axis}",
            "point": point,
            "surface": {"kind": "coordinate", "axis": axis, "offset": x},
        }
        for axis, x in zip(AXES, point, strict=True)
    ]


def _checked(table: Any, info: ValidationInfo) -> Any:
    if is_ball(table):
        BallJoint.model_validate(table, context=info.context)
    return table
