"""What Tab offers, that it agrees with the registries, and that it is light."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.analysis.schema import KINDS as SCHEMAS
from condyle.backends.choose import BACKENDS
from condyle.cli import completion
from condyle.distribution import OBJECTIVES
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.export.fmu_model import KINDS
from condyle.export.new_study import study_kinds
from condyle.mechanism import bundled_text
from condyle.motion import parse_units
from condyle.report.figures import PLOTS
from condyle.report.figures.style import STYLES

# Loaded by the mathematics, the files and the pictures.
HEAVY = {"casadi", "numpy", "scipy", "xarray", "matplotlib", "plotly", "viser"}


def test_the_names_are_those_of_the_registries() -> None:
    assert tuple(FORMULATIONS) == completion.FORMULATIONS
    assert (completion.ROUTES, completion.BACKENDS) == (ROUTES, BACKENDS)
    assert sorted([*OBJECTIVES, "emg"]) == sorted(completion.DISTRIBUTIONS)
    assert tuple(PLOTS) == completion.FIGURES
    assert tuple(STYLES) == completion.STYLES
    assert tuple(KINDS) == completion.FMUS
    assert study_kinds() == completion.STUDIES
    assert tuple(SCHEMAS) == completion.SCHEMAS
    assert tuple(completion.bundled()) == condyle.bundled_mechanisms()
    for units in completion.UNITS:
        parse_units(units)


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("condyle che", {"check"}),
        ("condyle run mas", {"masticatory", "masticatory-curved"}),
        ("condyle check ja", {"jaw.toml"}),
        ("condyle check ./ja", {"./jaw.toml"}),
        ("condyle check robots/", {"robots/arm.toml"}),
        ("condyle run --formulation mo", {"momentum"}),
        ("condyle solve --route ", {"core", "direct"}),
        ("condyle run --backend comp", {"compiled"}),
        ("condyle solve --distribution min", {"minimum_norm", "minimax"}),
        ("condyle run --units mm", {"mm,rad", "mm,deg"}),
        ("condyle plot x.nc --figure contact", {"contact_force", "contact_track"}),
        ("condyle run --load-point right", {"right_molar"}),
        ("condyle run jaw.toml --load-point ", {"tip"}),
        ("condyle run gough-stewart --landmark ", {"payload"}),
        ("condyle run missing.toml --landmark ", set()),
        ("condyle run --rep", {"--report"}),
    ],
)
def test_what_is_offered(
    condyle_command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    offered: set[str],
) -> None:
    points = bundled_text("masticatory").partition("[platform.points]")[0]
    Path("jaw.toml").write_text(f"{points}[platform.points]\ntip = [0, 0, 0]\n")
    Path("robots").mkdir()
    for name in ("arm.toml", ".arm.toml", "arm.txt"):
        (Path("robots") / name).touch()
    monkeypatch.setenv("_CONDYLE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    outcome = condyle_command()
    assert (set(outcome.out.split()), outcome.err) == (offered, "")


@pytest.mark.parametrize(
    "environment",
    [
        {"_CONDYLE_COMPLETE": "complete_bash", "COMP_WORDS": "condyle run ", "COMP_CWORD": "2"},
        {"CONDYLE_ARGUMENTS": "--help"},
        {"CONDYLE_ARGUMENTS": "run --help"},
    ],
)
def test_help_and_completion_load_nothing_heavy(environment: dict[str, str]) -> None:
    code = (
        "import os, sys\n"
        "sys.argv = ['condyle', *os.environ.get('CONDYLE_ARGUMENTS', '').split()]\n"
        "from condyle.cli import main\n"
        "try: main()\n"
        "finally: print('loaded:', *sys.modules)\n"
    )
    got = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | environment | {"TERM": "dumb"},
        capture_output=True,
        text=True,
        check=True,
    )
    text, _, loaded = got.stdout.rpartition("loaded:")
    assert text and "typer" in loaded.split()
    assert not HEAVY & set(loaded.split())


@pytest.mark.parametrize(
    ("shell", "word"), [("bash", "complete -o"), ("zsh", "#compdef condyle"), ("fish", "--command")]
)
def test_the_script_for_a_shell(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, shell: str, word: str
) -> None:
    # Typer asks which shell started the command: of a test, any program may have.
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: shell)
    outcome = condyle_command("--show-completion")
    assert outcome.status == 0 and "_CONDYLE_COMPLETE" in outcome.out and word in outcome.out
