"""What people install: the sdist and the wheel made of it, in an environment of their own.

Takes minutes and a package registry, so it runs only where it is asked for: `make install`, and CI.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(
        os.environ.get("CONDYLE_INSTALL") != "required",
        reason="builds and installs from a registry: make install",
    ),
]
# No setting of this environment may help the new one.
CLEAN = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "CONDYLE_", "VIRTUAL"))}


def run(*call: object, cwd: Path) -> str:
    done = subprocess.run(
        [str(word) for word in call], cwd=cwd, env=CLEAN, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{call}: {done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the sdist, and the wheel that was built from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", folder, ROOT, cwd=folder)
    return folder


@pytest.fixture(scope="module")
def installed(built: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a fresh environment with the wheel in it."""
    home = tmp_path_factory.mktemp("home")
    venv.create(home / "venv", with_pip=True)
    programs = home / "venv" / "bin"
    wheel = next(built.glob("*.whl"))
    run(programs / "python", "-m", "pip", "install", "--quiet", wheel, cwd=home)
    return programs


def test_wheel_has_what_the_program_reads(built: Path) -> None:
    path = next(built.glob("*.whl"))
    assert path.name.endswith("-py3-none-any.whl")  # nothing is compiled at install
    with zipfile.ZipFile(path) as wheel:
        names = wheel.namelist()
    source = ROOT / "src" / "condyle"
    files = {
        f"condyle/{path.relative_to(source)}"
        for path in source.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert files <= set(names)
    assert not [name for name in names if name.startswith(("tests/", "docs/"))]


def test_sdist_has_what_the_tests_read(built: Path) -> None:
    with tarfile.open(next(built.glob("*.tar.gz"))) as sdist:
        inside = {name.partition("/")[2] for name in sdist.getnames()}
    wanted = {"README.md", "LICENSE", "CITATION.cff", "mkdocs.yml", "docs/hooks.py", "Makefile"}
    assert wanted | {"tests/conftest.py", "examples/reference.py"} <= inside


def test_command_runs(installed: Path, tmp_path: Path) -> None:
    said = run(installed / "condyle", "run", "--quiet", "--out", "results", cwd=tmp_path)
    assert said == ""
    assert {path.suffix for path in (tmp_path / "results").iterdir()} == {".nc", ".csv"}
    version = re.search(
        r'__version__ = "(.+)"', (ROOT / "src/condyle/version.py").read_text(encoding="utf-8")
    )
    assert version is not None and version[1] in run(
        installed / "condyle", "--version", cwd=tmp_path
    )


def test_library_counts(installed: Path, tmp_path: Path) -> None:
    script = (
        "import condyle, importlib.resources as r\n"
        "s = condyle.derive(condyle.load_mechanism('masticatory')).solve(\n"
        "    condyle.reference_motion(), condyle.reference_load())\n"
        "print(float(abs(s['effort']).max()))\n"
    )
    printed = run(installed / "python", "-c", script, cwd=tmp_path)
    assert float(printed) == pytest.approx(0.925334, abs=2e-6)
