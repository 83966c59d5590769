"""A table of muscle points as a jaw: moment arms by hand, and tables that are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import CondyleError

HEAD = "muscle,body,x [mm],y [mm],z [mm],max_force,optimal_length,tendon_length,pennation"
RNG = np.random.default_rng(6)
SKULL, JAW = (RNG.normal((0, 0, up), 30, (7, 3)) for up in (40, -20))
VIA, BEYOND = (1.0, 50.0, 12.0), JAW[2] + (0, 3.0, 4.0)


def row(name: str, body: str, at: Any, numbers: str = ",,,") -> str:
    return f"{name},{body},{','.join(repr(float(x)) for x in at)},{numbers}"


def table() -> str:
    """Muscles, of which one runs over a point and one on along the mandible, and a cable."""
    lines = [HEAD]
    for i, (a, b) in enumerate(zip(SKULL, JAW, strict=True)):
        lines.append(row(f"m{i}", "Skull", a, "120,0.03,0.04,0.1" if i else "50,,,"))
        if i == 1:
            lines.append(row("m1", "Skull", VIA))
        lines.append(row(f"m{i}", "Mandible", b))
        if i == 2:
            lines.append(row("m2", "Mandible", BEYOND))
    return "\n".join(lines)


def test_moment_arms_are_those_of_the_points(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, condyle_command: Any
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("points.csv").write_text(table(), encoding="utf-8")
    outcome = condyle_command("new", "mine", "--from", "points.csv")
    assert outcome.status == 0 and "those of human-jaw" in outcome.err
    made = condyle.load_mechanism("mine.toml")
    derived = condyle.derive(made, backend="numpy", distribution="minimum_norm")
    J = derived.derivatives("joint", "q", q=np.zeros(6))["joint", "q"]
    wanted = []
    for i, (a, b) in enumerate(zip(SKULL, JAW, strict=True)):
        line = np.subtract(VIA if i == 1 else a, b)
        pull = line / np.linalg.norm(line)
        wanted.append(np.concatenate([pull, np.cross(b / 1000, pull)]))
    np.testing.assert_allclose(np.abs(J), np.abs(wanted), rtol=0, atol=1e-12)
    assert made.chains[0].actuator.force_limit == (0.0, 50.0)
    assert made.chains[2].muscle.tendon_length == pytest.approx(0.035, abs=1e-15)


WRONG = {
    "": "has no column muscle",
    "a,b\n1,2": "column 'a' is unknown",
    HEAD.replace("x [mm]", "x,x [mm]"): "has a column twice",
    f"{HEAD}\n,skull,0,0,0,1": "row 2 names no muscle",
    f"{HEAD}\nm,skull,0,nan,0,1": r"row 2, y: expected a finite number, got 'nan'",
    f"{HEAD}\nm,skull,0,0,0,1": "0 on the platform",
    f"{HEAD}\nm,skull,0,0,0\nm,jaw,0,0,1": "no max_force",
    f"{HEAD}\nm,jaw,0,0,0,1\nm,skull,0,0,1": "comes back from the platform",
    f"{HEAD}\nm,skull,0,0,0,1,0.03\nm,jaw,0,0,1": "has optimal_length alone",
    f"{HEAD}\nm,skull,0,0,0,1,1,0.001\nm,jaw,0,0,1\nm,jaw,0,0,9": "more than its tendon is long",
    f"{HEAD}\nm,skull,0,0,0,1\nm,skull,0,0,1\nm,jaw,0,0,9": "no fibres; expected a muscle",
    f"{HEAD}\nm,skull,1e300,0,0,1\nm,jaw,0,0,9": "expected",
    'muscle,"body': "no table of values",
    "\x00": "column",
}


@pytest.mark.parametrize(("text", "said"), WRONG.items(), ids=range(len(WRONG)))
def test_what_it_cannot_be_is_said(text: str, said: str, tmp_path: Path) -> None:
    (path := tmp_path / "points.csv").write_text(text, encoding="utf-8")
    with pytest.raises(CondyleError, match=said):
        condyle.new_mechanism(str(tmp_path / "mine"), from_bundled=str(path))
    assert not (tmp_path / "mine.toml").exists()
