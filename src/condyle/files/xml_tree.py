"""XML of strangers as a tree: no document type, so no entities; bounded in size and depth."""

from __future__ import annotations

import os
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ..errors import InputError
from .limits import XML, XML_DEPTH, XML_ELEMENTS
from .reading import content_of


def read_xml(path: str | os.PathLike[str]) -> Element:
    """The outermost element of an XML file.

    Raises: InputError: for a file that cannot be read, is not XML, has a document type, or is
            beyond a limit.
    """
    text, builder, parser = content_of(path, XML), TreeBuilder(), expat.ParserCreate()
    depth = count = 0

    def no_type(*_: object) -> None:
        raise InputError(
            f"{path}: has a document type (<!DOCTYPE>), by which XML defines entities and names "
            "other files; it is not read. Remove that line"
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        XML_DEPTH.check(depth, os.fspath(path))
        XML_ELEMENTS.check(count, os.fspath(path))
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartDoctypeDeclHandler = no_type
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"{path}: is not XML ({error})") from None
    return builder.close()
