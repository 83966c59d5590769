"""Files that people write, by kind: one entry each, for schemas, templates and the command line.

STUDIES["spring"] = StudyKind("my_package.spring:SpringStudy", "my_package.spring:tuned_spring")

A package elsewhere names the module that does so as an entry point of the group `condyle.studies`.
The command line has a command of each kind: `condyle spring study.toml`.
Light: nothing here imports the mathematics.
"""

from __future__ import annotations

import inspect
import os
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from ..errors import InputError, as_name, brief, did_you_mean

if TYPE_CHECKING:
    from pydantic import BaseModel

    from ..mechanism.study_file import StudyFile

GROUP = "condyle.studies"
# What an editor knows; kinds of other packages work too.
StudyName = Literal[
    "calibration", "design", "excitation", "fit", "optimise", "path", "session", "study"
]
FileKind = Literal["mechanism", "scenario", StudyName]


@dataclass(frozen=True)
class StudyKind:
    """A kind of study, by what makes its tables and its answer: itself, or "module:name".

    tables: a `StudyFile`; its docstring says in a line what it is for.
    answer: a function of a study, or of a mechanism and one, that returns a `StudyAnswer`.
    figures: of the answer's page: caption -> function of the answer.
    command: that answers it; default: one of the kind's own name.
    """

    tables: str | type[StudyFile]
    answer: str | Callable[..., Any]
    figures: str | Mapping[str, Callable[..., Any]] | None = None
    command: str = ""

    @property
    def file(self) -> type[StudyFile]:
        found: type[StudyFile] = _at(self.tables)
        return found

    @property
    def drawn(self) -> Mapping[str, Callable[..., Any]]:
        """Its figures."""
        return _at(self.figures) or {}

    @property
    def solve(self) -> Callable[..., Any]:
        """The function that answers a study."""
        return _at(self.answer)  # type: ignore[no-any-return]


def _at(place: Any) -> Any:
    if not isinstance(place, str):
        return place
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


STUDIES: dict[str, StudyKind] = {
    "calibration": StudyKind(
        "condyle.identification.calibration_study:CalibrationStudy",
        "condyle.identification.calibrate:calibrate",
        command="calibrate",
    ),
    "design": StudyKind(
        "condyle.analysis.design:DesignStudy",
        "condyle.analysis.design:design",
        "condyle.report.figures.design_figures:FIGURES",
    ),
    "excitation": StudyKind(
        "condyle.identification.excite:ExcitationStudy",
        "condyle.identification.excite:excite",
        command="excite",
    ),
    "fit": StudyKind(
        "condyle.identification.fit_study:FitStudy",
        "condyle.identification.identify:identify",
        "condyle.report.figures.identification_figures:FIGURES",
        command="identify",
    ),
    "optimise": StudyKind(
        "condyle.optimisation.optimal_motion:OptimiseStudy",
        "condyle.optimisation.optimal_motion:optimise",
    ),
    "path": StudyKind(
        "condyle.optimisation.path_study:PathStudy", "condyle.optimisation.path_study:plan_path"
    ),
    "session": StudyKind(
        "condyle.markers.session_file:SessionFile",
        "condyle.report.measured_session:measure_session",
    ),
    "study": StudyKind(
        "condyle.analysis.sweep:Study", "condyle.analysis.sweep:sweep", command="sweep"
    ),
}
OTHERS = {
    "mechanism": "condyle.mechanism:Mechanism",
    "scenario": "condyle.simulation.scenario:Scenario",
}


def studies() -> dict[str, StudyKind]:
    """All kinds by name, those of other packages too."""
    from importlib.metadata import entry_points  # which takes a while

    for point in entry_points(group=GROUP):
        point.load()
    return STUDIES


def study_kind(kind: str) -> StudyKind:
    """A kind by its name.

    Raises: InputError: for another name.
    """
    if as_name(kind, "kind") not in (known := studies()):
        raise InputError(f"kind: no study is called {brief(kind)}.{did_you_mean(kind, known)}")
    return known[kind]


def file_kinds() -> dict[str, Any]:
    """The tables of every kind of file, by name, as `StudyKind.tables` has them."""
    return OTHERS | {name: kind.tables for name, kind in studies().items()}


def tables_of(kind: str) -> Any:
    """The class of a kind of file.

    Raises: InputError: for another kind of file.
    """
    places = file_kinds()
    if not isinstance(kind, str) or kind not in places:
        near = did_you_mean(kind, places)
        raise InputError(f"of: expected a kind of file, got {brief(kind)}.{near}")
    return _at(places[kind])


def read_study(
    path: str | os.PathLike[str], kind: str | None = None
) -> tuple[str, StudyFile | None]:
    """A file of any kind: its kind and its tables, None of a mechanism.

    Args:   kind: default: that to which most of the file's keys belong; of several, the first
            of which it is without mistakes.
    Raises: InputError: with every problem found.
    """
    from ..mechanism.toml import read_tables, read_text

    kinds = _kinds_of(read_tables(read_text(path), str(path))) if kind is None else [kind]
    refused = []
    for candidate in kinds or ["mechanism"]:
        if candidate == "mechanism":
            return candidate, None
        try:
            return candidate, tables_of(candidate).read(path)
        except InputError as error:
            refused.append(error)
    raise refused[0]


def _kinds_of(data: Mapping[str, Any]) -> list[str]:
    """Kinds of file whose tables have most of these keys and lack fewest, the smallest first."""
    if "chain" in data:  # quickly
        return ["mechanism"]
    fits, sizes = {}, {}
    for kind in file_kinds():
        known, required = _keys_of(kind)
        fits[kind] = len(data.keys() & known), -len(required - data.keys())
        sizes[kind] = len(known)
    best = max(fits.values())
    alike = [kind for kind, fit in fits.items() if fit == best]
    return sorted(alike, key=sizes.__getitem__) if best[0] else []


def _keys_of(kind: str) -> tuple[set[str], set[str]]:
    """Keys that a kind of file may have, and those that it must have."""
    from ..mechanism.table_schema import schema_of

    schema = schema_of(tables_of(kind))
    return {*schema["properties"]}, {*schema.get("required", ())}


def misplaced(data: Mapping[str, Any], tables: type[BaseModel], source: str) -> str | None:
    """What a file is that is none of the kind `tables`, and the command that takes it; None where
    it may be one with mistakes.

    It is of another kind if it has more of that one's keys and all that are required, or as many
    and no mistake.
    """
    kinds = _kinds_of(data)
    own = next((kind for kind in file_kinds() if issubclass(tables, tables_of(kind))), None)
    for kind in kinds if kinds != [own] else ():
        missing = _keys_of(kind)[1] - data.keys()
        if kind != own and not missing and (own not in kinds or _complete(kind, data)):
            expected = f', expected "{own}"' if own else ""
            return f'is a file of kind "{kind}"{expected}; {_taken_by(kind, source)} takes it'
    return None


def _complete(kind: str, data: Mapping[str, Any]) -> bool:
    """Whether the tables have no mistake as a kind of study."""
    from pydantic import ValidationError

    try:
        return bool(tables_of(kind).model_validate(dict(data), context={"per_metre": 1.0}))
    except ValidationError:
        return False


def _taken_by(kind: str, source: str) -> str:
    """The command that takes a file of a kind."""
    if kind in OTHERS:
        words = ["run"] if kind == "mechanism" else ["simulate", "MECHANISM", "--scenario"]
    else:
        entry = study_kind(kind)
        words = [entry.command or kind]
        if next(iter(inspect.signature(entry.solve).parameters)) == "mechanism":
            words += ["MECHANISM", "--study"]
    return shlex.join(["condyle", *words, source])


def schema(of: FileKind = "mechanism") -> dict[str, Any]:
    """The JSON schema of a kind of file, for editors.

    Args:   of: mechanism, scenario, session, study (of a sweep), design, optimise, path, fit,
            excitation or calibration.
    Raises: InputError: for another kind of file.
    """
    from ..mechanism.table_schema import schema_of

    return {**schema_of(tables_of(of)), "title": f"condyle {of}"}
