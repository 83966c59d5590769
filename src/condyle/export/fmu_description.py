"""modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml of 3.0."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..version import __version__
from .fmu_model import Fmu, Scalar

# Powers of kg, m, s, rad in units of ours.
BASE = {
    "m": {"m": 1},
    "rad": {"rad": 1},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "s": {"s": 1},
}
HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n'


def description(fmu: Fmu, version: int) -> str:
    """The XML of an FMU."""
    three = version == 3
    token = {"instantiationToken" if three else "guid": fmu.token}
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "3.0" if three else "2.0",
            "modelName": fmu.name,
            **token,
            "description": fmu.text,
            "generationTool": f"condyle {__version__}",
            "variableNamingConvention": "structured",
            **({} if three else {"numberOfEventIndicators": "0"}),
        },
    )
    state = "State" if three else "state"
    abilities = {
        "modelIdentifier": fmu.name,
        f"canGetAndSetFMU{state}": "true",
        f"canSerializeFMU{state}": "true",
    }
    step = {"canHandleVariableCommunicationStepSize": "true"}
    exchange = SubElement(root, "ModelExchange", abilities)
    together = SubElement(root, "CoSimulation", abilities | step)
    if not three:
        for one in (exchange, together):
            files = SubElement(one, "SourceFiles")
            SubElement(files, "File", {"name": "fmu.c"})
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in fmu.variables} | {"s"}):
        unit = SubElement(units, "Unit", {"name": name})
        powers = {base: str(n) for base, n in exponents(name).items() if n}
        SubElement(unit, "BaseUnit", powers)
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": "0.001"})
    variables = SubElement(root, "ModelVariables")
    (_three if three else _two)(variables, fmu)
    structure = SubElement(root, "ModelStructure")
    (_structure_3 if three else _structure_2)(structure, fmu)
    indent(root)
    return HEAD + tostring(root, encoding="unicode") + "\n"


def build_description(fmu: Fmu) -> str:
    """How the sources are compiled: FMI 3.0."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": fmu.name})
    files = SubElement(build, "SourceFileSet", {"language": "C99"})
    SubElement(files, "SourceFile", {"name": "fmu.c"})
    indent(root)
    return HEAD + tostring(root, encoding="unicode") + "\n"


def exponents(unit: str) -> dict[str, int]:
    """Powers of the base units: "kg m^2", "N m", "m/s^2", "1/s"."""
    found: dict[str, int] = {}
    above, _, below = unit.partition("/")
    for part, sign in ((above, 1), (below, -1)):
        for word in part.split():
            name, _, power = word.partition("^")
            if re.fullmatch(r"\d+", name):
                continue
            for base, n in BASE[name].items():
                found[base] = found.get(base, 0) + sign * n * int(power or 1)
    return found


def _kind(v: Scalar) -> dict[str, str]:
    causality = {"input": "input", "parameter": "parameter"}.get(v.role, "output")
    said = {"causality": causality}
    said["variability"] = "tunable" if v.role == "parameter" else "continuous"
    if v.role in ("state", "parameter"):
        said["initial"] = "exact"
    elif v.role != "input":
        said["initial"] = "calculated"
    return said


def _named(v: Scalar) -> dict[str, str]:
    return {"name": v.name, "valueReference": str(v.index), "description": v.text}


def _start(v: Scalar) -> dict[str, str]:
    return {} if v.start is None else {"start": repr(v.start)}


def _two(parent: Element, fmu: Fmu) -> None:
    for v in fmu.variables:
        scalar = SubElement(parent, "ScalarVariable", _named(v) | _kind(v))
        of = {} if v.of is None else {"derivative": str(v.of + 1)}
        SubElement(scalar, "Real", {"unit": v.unit} | of | _start(v))
    time = {"name": "time", "valueReference": str(len(fmu.variables)), "causality": "independent"}
    scalar = SubElement(parent, "ScalarVariable", time | {"variability": "continuous"})
    SubElement(scalar, "Real", {"unit": "s"})


def _three(parent: Element, fmu: Fmu) -> None:
    for v in fmu.variables:
        of = {} if v.of is None else {"derivative": str(v.of)}
        SubElement(parent, "Float64", _named(v) | _kind(v) | {"unit": v.unit} | of | _start(v))
    time = {"name": "time", "valueReference": str(len(fmu.variables)), "causality": "independent"}
    SubElement(parent, "Float64", time | {"variability": "continuous", "unit": "s"})


def _structure_2(parent: Element, fmu: Fmu) -> None:
    outputs = [v for v in fmu.variables if v.role not in ("input", "parameter")]
    rates = [v for v in outputs if v.role == "rate"]
    unknown = [v for v in outputs if v.role != "state"]
    for tag, found in (("Outputs", outputs), ("Derivatives", rates), ("InitialUnknowns", unknown)):
        if found:
            listed = SubElement(parent, tag)
            for v in found:
                SubElement(listed, "Unknown", {"index": str(v.index + 1)})


def _structure_3(parent: Element, fmu: Fmu) -> None:
    outputs = [v for v in fmu.variables if v.role not in ("input", "parameter")]
    rates = [v for v in outputs if v.role == "rate"]
    unknown = [v for v in outputs if v.role != "state"]
    for tag, found in (
        ("Output", outputs),
        ("ContinuousStateDerivative", rates),
        ("InitialUnknown", unknown),
    ):
        for v in found:
            SubElement(parent, tag, {"valueReference": str(v.index)})
