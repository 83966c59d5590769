"""Target `fmu`: a functional mock-up unit of FMI 2.0 or 3.0, for model exchange and co-simulation.

It holds its sources, and a binary for this machine where there is a C compiler.
"""

from __future__ import annotations

import os
import platform
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..backends.c.emit import text as packaged_text
from ..backends.compiler import CompilerError, find_compiler
from ..errors import InputError, as_path, brief, texts_of
from ..files.atomic import replacing
from ..mechanism import Mechanism, as_mechanism
from ..model.model import Model
from ..progress import stepping
from ..simulation.plan import Plan
from ..simulation.simulating import ScenarioLike, planned
from ..version import __version__
from .catalogue import least_norm
from .controller import controller_source
from .fmu_controller import controller_fmu
from .fmu_lifting import require_exportable
from .fmu_model import Fmu, FmuKind, FmuVariable, exponents, fmu_model
from .syntax import c_comment, packaged
from .written import Written, file_at

DEFAULT: tuple[FmuKind, ...] = ("plant", "inverse", "controller")
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
LONG_AGO = (1980, 1, 1, 0, 0, 0)  # so that the same model is the same file
# Platform -> folder of its binaries in FMI 2.0 and 3.0, and their ending.
BINARIES: dict[str, tuple[str | None, str, str]] = {
    "linux x86_64": ("linux64", "x86_64-linux", ".so"),
    "linux aarch64": (None, "aarch64-linux", ".so"),
    "darwin x86_64": ("darwin64", "x86_64-darwin", ".dylib"),
    "darwin arm64": (None, "aarch64-darwin", ".dylib"),
    "win32 amd64": ("win64", "x86_64-windows", ".dll"),
}


def export_fmu(
    model: Model | Mechanism | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    kind: FmuKind | Sequence[FmuKind] = DEFAULT,
    fmi: Literal[2, 3] = 3,
    scenario: ScenarioLike | None = None,
) -> Written:
    """Write functional mock-up units (FMI 2.0 or 3.0), each whole or not at all.

    They hold their sources, and a binary for this machine where there is a C compiler.

    Args:   model: a model, a mechanism, its file, or the name of a bundled one.
            path: a folder for NAME-KIND.fmu; or, for one kind, a file that ends in .fmu.
            kind: plant, inverse, controller, bounded, pose, joints; one or several.
            fmi: version of the standard: 2 or 3.
            scenario: as of `condyle.export_controller`: the unit `controller` is its controller,
            with states and watchdog, for co-simulation, and `plant` begins where it does, with
            contacts as its `[contacts]` says; without one `controller` is computed torque, and
            `plant` begins at home. With the kind plant alone it needs no controller.
    Returns: the files. Its `data` says whether they hold a binary.
    Raises: InputError: for another kind or version, or a file that cannot be written;
            UnsupportedError: for a mechanism that cannot be exported to C, and contacts that lift
            together with drives;
            both: as of `condyle.export_controller`.
    """
    mechanism = as_mechanism(model)
    kinds = list(dict.fromkeys(texts_of("kind", kind)))
    if not isinstance(fmi, int) or fmi not in (2, 3):
        raise InputError(f"fmi: expected 2 or 3, got {brief(fmi)}")
    if as_path(path, expected="the path of a file or folder").endswith(".fmu") and len(kinds) != 1:
        raise InputError(f"{path}: name a folder for the FMUs of {len(kinds)} kinds")
    if scenario is not None and not {"controller", "plant"} & {*kinds}:
        raise InputError(
            "scenario: it is of the kinds controller and plant, got kind "
            f"{', '.join(kinds)}; add one of them"
        )
    notes, plan, source, left_out = list[str](), None, None, list[str]()
    if scenario is not None and "controller" in kinds:
        source = controller_source(model, scenario, None)
        plan, left_out = source.plan, source.left_out
    elif scenario is not None:
        (plan,) = planned(model, [scenario])
        left_out = [f"load {load.name}" for load in plan.loads]
    if left_out:
        notes.append(f"the units leave out: {', '.join(left_out)}")
    models = [
        controller_fmu(source)
        if one == "controller" and source is not None
        else _plant(mechanism, plan)
        if one == "plant"
        else fmu_model(mechanism, one)
        for one in kinds
    ]
    files = [file_at(path, f"{mechanism.name}-{one}", ".fmu") for one in kinds]
    pairs = stepping("building FMUs", [*zip(models, files, strict=True)])
    binary = all([_write(fmu, fmi, file) for fmu, file in pairs])
    if not binary:
        notes.append("no binary for this machine: the FMUs hold sources only")
    chosen = {"inverse"} if scenario is not None else {"inverse", "controller"}
    if chosen & set(kinds) and least_norm(mechanism):
        notes.append("efforts in FMUs are of least norm, without limits: a cable may be pushed")
    return Written(files, notes, {"mechanism": mechanism.name, "fmi": fmi, "binary": binary})


def _plant(mechanism: Mechanism, plan: Plan | None) -> Fmu:
    """The plant of a plan, whose contacts lift and land where they do so there."""
    if plan is None:
        return fmu_model(mechanism, "plant")
    freed = plan.freed
    if freed is None or freed.lifting is None:
        return fmu_model(mechanism, "plant", {"q": plan.q, "q1": plan.q1})
    require_exportable(freed.lifting)
    start = {"q": freed.q, "q1": freed.q1}
    return fmu_model(freed.model.mechanism, "plant", start, freed.lifting)


def _write(fmu: Fmu, version: int, path: Path) -> bool:
    """Write an FMU; returns whether it holds a binary."""
    sources = fmu_sources(fmu, version)
    content = {"modelDescription.xml": description(fmu, version).encode()}
    if version == 3:
        content["sources/buildDescription.xml"] = build_description(fmu).encode()
    content |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    *folders, ending = BINARIES.get(
        f"{sys.platform} {platform.machine().lower()}", (None, None, "")
    )
    place, library = folders[version - 2], _built(sources)
    binary = place is not None and library is not None
    if binary:
        content[f"binaries/{place}/{fmu.name}{ending}"] = library or b""
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, LONG_AGO)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
    return binary


def fmu_sources(fmu: Fmu, version: int) -> dict[str, str]:
    """fmu.c, which includes all else, and the mechanism's own."""
    includes = "math.h", "stdbool.h", "stddef.h", "stdint.h", "stdlib.h", "string.h"
    about = c_comment(fmu.text)
    text = f"/* {about}: an FMU, written by condyle. Compile this file alone. */\n"
    text += "".join(f"#include <{name}>\n" for name in includes)
    text += f'{fmu.head}\n#define MODEL_TOKEN "{fmu.token}"\n#define FMI {version}\n\n'
    text += f"{packaged_text('runge_kutta.h')}\n" * bool(fmu.order) + packaged("fmi.c")
    return {"fmu.c": text, **fmu.files}


def _built(sources: dict[str, str]) -> bytes | None:
    """A shared library, or None without a compiler."""
    try:
        compiler = find_compiler()
    except CompilerError:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in sources.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        library = Path(folder, "fmu.bin")
        replace(compiler, flags=FLAGS).build(library, Path(folder, "fmu.c"))
        return library.read_bytes()


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
        **({} if three else {"numberOfEventIndicators": str(len(fmu.indicators))}),
    }
    root = Element("fmiModelDescription", about)
    state = "State" if three else "state"
    able = {"modelIdentifier": fmu.name}
    able |= {f"providesDirectionalDerivative{'s' * three}": "true"} if fmu.differentiable else {}
    able |= {f"can{what}FMU{state}": "true" for what in ("GetAndSet", "Serialize")}
    steps = {"canHandleVariableCommunicationStepSize": "false" if fmu.period else "true"}
    steps |= {"fixedInternalStepSize": repr(fmu.period)} if fmu.period and three else {}
    completed = {"needsCompletedIntegratorStep": "true"} if three and fmu.indicators else {}
    for kind, more in (("ModelExchange", completed), ("CoSimulation", steps)):
        if kind == "ModelExchange" and fmu.period:
            continue
        interface = SubElement(root, kind, able | more)
        if not three:
            SubElement(SubElement(interface, "SourceFiles"), "File", {"name": "fmu.c"})
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({v.unit for v in fmu.variables} | {"s"}):
        powers = {base: str(n) for base, n in exponents(name).items() if n}
        SubElement(SubElement(units, "Unit", {"name": name}), "BaseUnit", powers)
    experiment = {"stopTime": f"{fmu.duration:g}", "stepSize": repr(fmu.period or 1e-3)}
    SubElement(root, "DefaultExperiment", {"startTime": "0"} | experiment)
    variables = SubElement(root, "ModelVariables")
    changes = "discrete" if fmu.period else "continuous"
    time = {"name": "time", "valueReference": str(len(fmu.variables)), "causality": "independent"}
    for attributes, quantity in (
        *((_attributes(v, changes), _quantity(v, three)) for v in fmu.variables),
        (time | {"variability": "continuous"}, {"unit": "s"}),
    ):
        if three:
            SubElement(variables, "Float64", attributes | quantity)
        else:
            SubElement(SubElement(variables, "ScalarVariable", attributes), "Real", quantity)
    _structure(SubElement(root, "ModelStructure"), fmu, three)
    return _xml(root)


def build_description(fmu: Fmu) -> str:
    """How the sources are compiled: FMI 3.0."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": fmu.name})
    sources = SubElement(build, "SourceFileSet", {"language": "C99"})
    SubElement(sources, "SourceFile", {"name": "fmu.c"})
    return _xml(root)


def _attributes(v: FmuVariable, changes: str) -> dict[str, str]:
    """Args: changes: how variables other than parameters do: continuous or discrete."""
    attributes = {"name": v.name, "valueReference": str(v.index), "description": v.text}
    other = {"rate": "local", "state": "output", "fixed": "parameter"}
    other |= {"mode": "output", "indicator": "local"}
    attributes["causality"] = other.get(v.role, v.role)
    seldom = {"parameter": "tunable", "fixed": "fixed", "mode": "discrete"}
    attributes["variability"] = seldom.get(v.role, changes)
    if v.role != "input":
        calculated = v.role in ("output", "rate", "mode", "indicator")
        attributes["initial"] = "calculated" if calculated else "exact"
    return attributes


def _quantity(v: FmuVariable, three: bool) -> dict[str, str]:
    """Versions count variables from 0 and from 1."""
    of = {} if v.of is None else {"derivative": str(v.of + (not three))}
    return {"unit": v.unit} | of | ({} if v.start is None else {"start": repr(v.start)})


def _structure(parent: Element, fmu: Fmu, three: bool) -> None:
    outputs = [v for v in fmu.variables if v.role in ("state", "output", "mode")]
    rates = [v for v in fmu.variables if v.role == "rate"]
    unknown = [v for v in fmu.variables if v.role in ("output", "rate", "mode")]

    first = 0 if three else 1  # of references and of places

    def dependencies(v: FmuVariable, initial: bool) -> dict[str, str]:
        """Nothing in FMI 2.0 where all count."""
        roles = {"input", "state"} | ({"parameter", "fixed"} if initial else set())
        if v.name.partition(".")[0] in fmu.following and not (initial and fmu.period):
            roles -= {"input"}
        elif not three:
            return {}
        known = [w for w in fmu.variables if w.role in roles] if v.role != "state" else [v]
        return {"dependencies": " ".join(str(w.index + first) for w in known)}

    for tag, state, members in (
        ("Output", "", outputs),
        ("Derivative", "ContinuousState", rates),
        ("InitialUnknown", "", unknown),
    ):
        listed = SubElement(parent, f"{tag}s") if members and not three else parent
        for v in members:
            at = {"valueReference" if three else "index": str(v.index + first)}
            name = f"{state}{tag}" if three else "Unknown"
            SubElement(listed, name, at | dependencies(v, tag == "InitialUnknown"))
    for index in fmu.indicators if three else ():
        SubElement(parent, "EventIndicator", {"valueReference": str(index)})


def _xml(root: Element) -> str:
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"
