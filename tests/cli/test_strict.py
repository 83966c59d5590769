"""`--strict`: a warning of any command is an error, and nothing is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from condyle.mechanism import bundled_text

Q = ("X", "Y", "alpha", "beta")
# A command that warns -> the warning.
WARNED = {
    "check": (("check", "heavy.toml"), "platform"),
    "run": (("run", "gough-stewart", "--rate", "4", "--backend", "numpy"), "trial motion"),
    "solve": (
        ("solve", "masticatory", "--states", "rest.csv", "--out", "out.csv"),
        "the states are at rest",
    ),
    "compare": (("compare", "gough-stewart", "--rate", "4", "--no-figures"), "trial motion"),
}


@pytest.mark.parametrize("name", WARNED)
def test_a_warning_is_an_error(
    condyle_command: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    Path("heavy.toml").write_text(bundled_text("masticatory").replace("mass = 0.2 ", "mass = 200 "))
    Path("rest.csv").write_text(f"{','.join(Q)}\n0,0,0,0\n")
    before = sorted(Path().rglob("*"))
    arguments, warning = WARNED[name]
    outcome = condyle_command(*arguments, "--strict", "--json")
    assert outcome.status == 2 and warning in outcome.err
    error = json.loads(outcome.out)["error"]
    assert error["kind"] == "warning" and any(warning in one for one in error["warnings"])
    assert sorted(Path().rglob("*")) == before
    if name in ("check", "solve"):  # quick ones
        outcome = condyle_command(*arguments)
        assert outcome.status == 0 and outcome.err.startswith("condyle: warning: ")


@pytest.mark.parametrize(("damping", "status"), [(0.03, 0), (3.0, 1)])
def test_an_unstable_loop_ends_with_a_status(
    condyle_command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    damping: float,
    status: int,
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    law = f'[controller]\nkind = "joint_pd"\nstiffness = 5\ndamping = {damping}\n'
    Path("pd.toml").write_text(f"duration = 0.002\n{law}")
    outcome = condyle_command("simulate", "--scenario", "pd.toml", "--check-gains", "--json")
    assert outcome.status == status
    assert json.loads(outcome.out)["stable"] == (status == 0)
