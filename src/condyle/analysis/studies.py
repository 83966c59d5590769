"""Files that people write, by kind: one entry each, for schemas, templates and the command line.

STUDIES["spring"] = StudyKind("my_package.spring:SpringStudy", "my_package.spring:tuned_spring")

A package elsewhere names the module that does so as an entry point of the group `condyle.studies`.
Light: nothing here imports the mathematics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from ..errors import InputError, as_name, did_you_mean, shown

if TYPE_CHECKING:
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
    """

    tables: str | type[StudyFile]
    answer: str | Callable[..., Any]
    figures: str | Mapping[str, Callable[..., Any]] | None = None

    @property
    def file(self) -> type[StudyFile]:
        found: type[StudyFile] = _at(self.tables)
        return found

    @property
    def drawn(self) -> Mapping[str, Callable[..., Any]]:
        """Its figures."""
        return _at(self.figures) or {}

    def solve(self, *arguments: Any, **options: Any) -> Any:
        """What `answer` says of a study."""
        return _at(self.answer)(*arguments, **options)


def _at(place: Any) -> Any:
    if not isinstance(place, str):
        return place
    module, _, name = place.partition(":")
    return getattr(import_module(module), name)


STUDIES: dict[str, StudyKind] = {
    name: StudyKind(*(f"condyle.{place}" for place in places))
    for name, *places in (
        ("calibration", "identification.calibration_study:CalibrationStudy",
         "identification.calibrate:calibrate"),
        ("design", "analysis.design:DesignStudy", "analysis.design:design",
         "report.figures.design_figures:FIGURES"),
        ("excitation", "identification.excite:ExcitationStudy", "identification.excite:excite"),
        ("fit", "identification.fit_study:FitStudy", "identification.identify:identify",
         "report.figures.identification_figures:FIGURES"),
        ("optimise", "optimisation.optimal_motion:OptimiseStudy",
         "optimisation.optimal_motion:optimise"),
        ("path", "optimisation.path_study:PathStudy", "optimisation.path_study:plan_path"),
        ("session", "markers.session_file:SessionFile", "report.measured_session:measure_session"),
        ("study", "analysis.sweep:Study", "analysis.sweep:sweep"),
    )
}  # fmt: skip
OTHERS = {
    "mechanism": "condyle.mechanism:Mechanism",
    "scenario": "condyle.simulation.scenario:complete_scenario",
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
        raise InputError(f"kind: no study is called {shown(kind)}.{did_you_mean(kind, known)}")
    return known[kind]


def schema(of: FileKind = "mechanism") -> dict[str, Any]:
    """The JSON schema of a kind of file, for editors.

    Args:   of: mechanism, scenario, session, study (of a sweep), design, optimise, path, fit,
            excitation or calibration.
    Raises: InputError: for another kind of file.
    """
    from ..mechanism.table_schema import schema_of

    places: dict[str, Any] = OTHERS | {name: kind.tables for name, kind in studies().items()}
    if not isinstance(of, str) or of not in places:
        near = did_you_mean(of, places)
        raise InputError(f"of: expected a kind of file, got {shown(of)}.{near}")
    table = _at(places[of])
    return {**schema_of(table if isinstance(table, type) else table()), "title": f"condyle {of}"}
