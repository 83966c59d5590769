"""modelDescription.xml of FMI 2.0 and 3.0, and buildDescription.xml of 3.0."""

from __future__ import annotations

import re
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .. import __version__
from .fmu_model import Fmu, Scalar

# Powers of kg, m, s, rad in units of ours.
BASE = {
    "m": {"m": 1},
    "rad": {"rad": 1},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "s": {"s": 1},
}
STEP = {"canHandleVariableCommunicationStepSize": "true"}


def description(fmu: Fmu, version: int) -> str:
    """The XML of an FMU."""
    three = version == 3
    about = {
        "fmiVersion": f"{version}.0",
        "modelName": fmu.name,
        "instantiationToken" if three else "guid": fmu.token,
        "description": fmu.text,
        "generationTool": f"condyle {__version__}",
        "variableNamingConvention": "structured",
        **({} if three else {"numberOfEventIndicators": "0"}),
    }
    root = Element("fmiModelDescription", about)
    state = "State" if three else "state"
    able = {"modelIdentifier": fmu.name}
    able |= {f"can{what}FMU{state}": "true" for what in ("GetAndSet", "Serialize")}
    for kind, more in (("ModelExchange", {}), ("CoSimulation", STEP)):
        interface = SubElement(root, kind, able | more)
        if not three:
            SubElement(SubElement(interface, "SourceFiles"), "File", {"name": "fmu.c"})
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in fmu.variables} | {"s"}):
        powers = {base: str(n) for base, n in exponents(name).items() if n}
        SubElement(SubElement(units, "Unit", {"name": name}), "BaseUnit", powers)
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": "0.001"})
    variables = SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": str(len(fmu.variables)), "causality": "independent"}
    for said, quantity in (
        *((_said(v), _quantity(v, three)) for v in fmu.variables),
        (time | {"variability": "continuous"}, {"unit": "s"}),
    ):
        if three:
            SubElement(variables, "Float64", said | quantity)
        else:
            SubElement(SubElement(variables, "ScalarVariable", said), "Real", quantity)
    _structure(SubElement(root, "ModelStructure"), fmu, three)
    return _text(root)


def build_description(fmu: Fmu) -> str:
    """How the sources are compiled: FMI 3.0."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": fmu.name})
    files = SubElement(build, "SourceFileSet", {"language": "C99"})
    SubElement(files, "SourceFile", {"name": "fmu.c"})
    return _text(root)


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


def _said(v: Scalar) -> dict[str, str]:
    said = {"name": v.name, "valueReference": str(v.index), "description": v.text}
    said["causality"] = v.role if v.role in ("input", "parameter") else "output"
    said["variability"] = "tunable" if v.role == "parameter" else "continuous"
    if v.role != "input":
        said["initial"] = "exact" if v.role in ("state", "parameter") else "calculated"
    return said


def _quantity(v: Scalar, three: bool) -> dict[str, str]:
    """Versions count variables from 0 and from 1."""
    of = {} if v.of is None else {"derivative": str(v.of + (not three))}
    return {"unit": v.unit} | of | ({} if v.start is None else {"start": repr(v.start)})


def _structure(parent: Element, fmu: Fmu, three: bool) -> None:
    outputs = [v for v in fmu.variables if v.role not in ("input", "parameter")]
    rates = [v for v in outputs if v.role == "rate"]
    unknown = [v for v in outputs if v.role != "state"]
    for tag, state, found in (
        ("Output", "", outputs),
        ("Derivative", "ContinuousState", rates),
        ("InitialUnknown", "", unknown),
    ):
        if three:
            for v in found:
                SubElement(parent, f"{state}{tag}", {"valueReference": str(v.index)})
        elif found:
            listed = SubElement(parent, f"{tag}s")
            for v in found:
                SubElement(listed, "Unknown", {"index": str(v.index + 1)})


def _text(root: Element) -> str:
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
