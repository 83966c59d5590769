"""What Tab offers, that it agrees with the registries, and that it is light."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.analysis.map.map_quantities import QUANTITIES
from condyle.backends.choose import BACKENDS
from condyle.cli import completion
from condyle.distribution import OBJECTIVES
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.export.fmu_model import KINDS
from condyle.mechanism import bundled_text
from condyle.motion import parse_units
from condyle.report.figures import PLOTS
from condyle.report.figures.style import STYLES

# Loaded by the mathematics, the files and the pictures.
HEAVY = {"casadi", "numpy", "scipy", "xarray", "matplotlib", "plotly", "viser"}


def test_the_names_are_those_of_the_registries() -> None:
    for option, registry in {
        "formulation": FORMULATIONS,
        "route": ROUTES,
        "backend": BACKENDS,
        "figure": PLOTS,
        "quantity": QUANTITIES,
        "style": STYLES,
        "kind": KINDS,
    }.items():
        assert completion.listed(option) == list(registry), option
    assert sorted([*OBJECTIVES, "emg"]) == sorted(completion.listed("distribution"))
    assert completion.bundled() == list(condyle.bundled_mechanisms())
    for units in completion.listed("units"):
        parse_units(units)


@pytest.fixture
def complete(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """What Tab offers behind a line, where some files are."""
    points = bundled_text("masticatory").partition("[platform.points]")[0]
    Path("jaw.toml").write_text(f"{points}[platform.points]\ntip = [0, 0, 0]\n")
    Path("robots").mkdir()
    for name in ("arm.toml", ".arm.toml", "arm.txt"):
        (Path("robots") / name).touch()
    monkeypatch.setenv("_CONDYLE_COMPLETE", "complete_bash")

    def complete(line: str) -> set[str]:
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
        outcome = condyle_command()
        assert outcome.err == "", line
        return set(outcome.out.split())

    return complete


def test_what_is_offered(complete: Any) -> None:
    for line, offered in (
        ("che", "check"), ("run mas", "masticatory masticatory-curved"), ("check ja", "jaw.toml"),
        ("check ./ja", "./jaw.toml"), ("check robots/", "robots/arm.toml"),
        ("run --formulation mo", "momentum"), ("solve --route ", "core direct"),
        ("run --backend comp", "compiled"), ("solve --distribution min", "minimum_norm minimax"),
        ("run --units mm", "mm,rad mm,deg"), ("run --rep", "--report"),
        ("plot x.nc --figure contact", "contact_force contact_track"),
        ("run --load-point right", "right_molar"), ("run jaw.toml --load-point ", "tip"),
        ("run gough-stewart --landmark ", "payload"), ("run missing.toml --landmark ", ""),
    ):  # fmt: skip
        assert complete(f"condyle {line}") == set(offered.split()), line


CODE = """
import os, sys
sys.argv = ["condyle", *os.environ.get("CONDYLE_ARGUMENTS", "").split()]
from condyle.cli import main
try: main()
finally: print("loaded:", *sys.modules)
"""


@pytest.mark.parametrize(
    "environment",
    [
        {"_CONDYLE_COMPLETE": "complete_bash", "COMP_WORDS": "condyle run ", "COMP_CWORD": "2"},
        {"CONDYLE_ARGUMENTS": "run --help"},
    ],
)
def test_help_and_completion_load_nothing_heavy(environment: dict[str, str]) -> None:
    variables = os.environ | environment | {"TERM": "dumb"}
    command = [sys.executable, "-c", CODE]
    got = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
    text, _, loaded = got.stdout.rpartition("loaded:")
    assert text and "typer" in loaded.split() and not HEAVY & set(loaded.split())


def test_the_script_for_a_shell(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Typer asks which shell started the command: of a test, any program may have."""
    words = {"bash": "complete -o", "zsh": "#compdef condyle", "fish": "--command"}
    for shell, word in words.items():
        monkeypatch.setattr("typer.completion._get_shell_name", lambda shell=shell: shell)
        outcome = condyle_command("--show-completion")
        assert outcome.status == 0 and "_CONDYLE_COMPLETE" in outcome.out and word in outcome.out
