"""Target `fmu`: a functional mock-up unit of FMI 2.0 or 3.0, for model exchange and co-simulation.

It holds its sources, and a binary for this machine where there is a C compiler.
"""

from __future__ import annotations

import platform
import sys
import tempfile
import zipfile
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from ..atomic import replacing
from ..backends.compiler import CompilerError, find_compiler
from ..errors import InputError
from ..mechanism import Mechanism
from .c_names import in_comment
from .fmu_description import build_description, description
from .fmu_model import Fmu, fmu_model

VERSIONS = (2, 3)
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
LONG_AGO = (1980, 1, 1, 0, 0, 0)  # so that the same model is the same file
ENDINGS = {"linux": ".so", "darwin": ".dylib", "win32": ".dll"}
# Platform -> folder in FMI 2.0 and 3.0.
FOLDERS: dict[str, dict[str, tuple[str | None, str]]] = {
    "linux": {"x86_64": ("linux64", "x86_64-linux"), "aarch64": (None, "aarch64-linux")},
    "darwin": {"x86_64": ("darwin64", "x86_64-darwin"), "arm64": (None, "aarch64-darwin")},
    "win32": {"amd64": ("win64", "x86_64-windows")},
}


def write_fmu(mechanism: Mechanism, kind: str, version: int, path: Path) -> bool:
    """Write an FMU, whole or not at all; returns whether it has a binary.

    Args:   kind: plant, inverse or controller;  version: of FMI, 2 or 3.
    Raises: InputError: for another kind or version, or a file that cannot be written;
            UnsupportedError: for a mechanism that cannot be exported to C.
    """
    if version not in VERSIONS:
        raise InputError(f"there is FMI 2 and 3; got version {version}")
    fmu = fmu_model(mechanism, kind)
    sources = fmu_sources(fmu, version)
    content = {"modelDescription.xml": description(fmu, version).encode()}
    if version == 3:
        content["sources/buildDescription.xml"] = build_description(fmu).encode()
    content |= {f"sources/{name}": text.encode() for name, text in sources.items()}
    place, library = binary_place(version), _built(sources)
    if place is not None and library is not None:
        content[f"binaries/{place}/{fmu.name}{ENDINGS[sys.platform]}"] = library
    with replacing(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, LONG_AGO)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, data)
    return place is not None and library is not None


def fmu_sources(fmu: Fmu, version: int) -> dict[str, str]:
    """fmu.c, which includes all else, and the mechanism's own."""
    includes = "math.h", "stdbool.h", "stddef.h", "stdint.h", "stdlib.h", "string.h"
    about = in_comment(fmu.text)
    text = f"/* {about}: an FMU, written by condyle. Compile this file alone. */\n"
    text += "".join(f"#include <{name}>\n" for name in includes)
    text += f'{fmu.head}\n#define MODEL_TOKEN "{fmu.token}"\n#define FMI {version}\n\n'
    room = files("condyle")
    step, rest = room / "backends" / "c" / "runge_kutta.h", room / "export" / "fmi.c"
    text += "\n".join(
        part.read_text(encoding="utf-8") for part in [step] * bool(fmu.order) + [rest]
    )
    return {"fmu.c": text, **fmu.files}


def binary_place(version: int) -> str | None:
    """The folder of this machine's binaries, None where FMI has no name for it."""
    known = FOLDERS.get(sys.platform, {}).get(platform.machine().lower())
    return None if known is None else known[version - 2]


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
