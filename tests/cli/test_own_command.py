"""A command defined in one file outside the package, registered by importing it."""

import importlib
import json
import sys
from typing import Any

import pytest
import typer.main

from condyle.cli.app import app  # with all commands

from .conftest import command_line


def test_a_command_of_ones_own(condyle_command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is in the help, has help, completes, answers programs, refuses; its brackets are shown."""
    monkeypatch.setattr(typer.main, "get_command", command_line.__wrapped__)
    monkeypatch.setattr(app, "registered_commands", [*app.registered_commands])
    monkeypatch.delitem(sys.modules, "cli.own_command", raising=False)
    importlib.import_module("cli.own_command")

    page = condyle_command("--help").out
    assert "weigh" in page.partition("Inspect")[2] and "Mass of the platform [kg]" in page
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
