"""A command, and an export target, in one file outside the package, registered by importing it."""

import ast
import importlib
import json
import sys
from pathlib import Path
from typing import Any

import pytest
import typer.main

import condyle
from condyle.cli.app import app  # with all commands
from condyle.cli.export import export

from .conftest import command_line


def test_a_command_of_ones_own(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is in the help, has help, completes, answers programs, refuses; its brackets are shown."""
    monkeypatch.setattr(typer.main, "get_command", command_line.__wrapped__)
    monkeypatch.setattr(app, "registered_commands", [*app.registered_commands])
    monkeypatch.delitem(sys.modules, "cli.own_command", raising=False)
    importlib.import_module("cli.own_command")

    page = condyle_command("--help").out
    assert "weigh" in page.partition("Maintenance")[2] and "Mass of the platform [kg]" in page
    page = condyle_command("weigh", "--help").out
    for said in ("kg or [g].", "--twice", "--strict", "bundled", "weigh jaw.toml --unit g"):
        assert said in page
    outcome = condyle_command("weigh", "masticatory", "--unit", "g", "--twice")
    assert outcome.out == "400 g\nNext: condyle check masticatory\n"
    assert json.loads(condyle_command("weigh", "masticatory", "--json").out) == {"mass": 0.2}
    assert condyle_command("weigh", "masticatory", "--unit", "t").status == 2
    monkeypatch.setenv("_CONDYLE_COMPLETE", "complete_bash")
    for line, offered in (("wei", "weigh"), ("weigh hexa", "hexaglide"), ("weigh --tw", "--twice")):
        monkeypatch.setenv("COMP_WORDS", f"condyle {line}")
        monkeypatch.setenv("COMP_CWORD", str(1 + line.count(" ")))
        assert condyle_command().out.split() == [offered]


def test_an_export_target_of_ones_own(
    condyle_command: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One block of the documentation: a command of `export`, whose files say the name safely."""
    monkeypatch.setattr(typer.main, "get_command", command_line.__wrapped__)
    family: typer.Typer = export.keywords["of"]
    monkeypatch.setattr(family, "registered_commands", [*family.registered_commands])
    monkeypatch.delitem(sys.modules, "cli.own_target", raising=False)
    importlib.import_module("cli.own_target")

    assert "A module that calls the functions in C." in condyle_command("export", "--help").out
    odd = condyle.load_mechanism("gough-stewart").replace(name="a\\N '''")
    condyle.dump(odd, tmp_path / "odd.toml")
    asked = ("export", "ctypes", str(tmp_path / "odd.toml"), "--out", str(tmp_path / "own"))
    told = json.loads(condyle_command(*asked, "--json").out)
    assert [Path(f).name for f in told["files"]] == [f"a_n____.{end}" for end in ("c", "h", "py")]
    tree = ast.parse((tmp_path / "own" / "a_n____.py").read_text())
    assert (ast.get_docstring(tree) or "").startswith("a\\N '''")
