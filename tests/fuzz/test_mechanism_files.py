"""Mechanisms, studies, scenarios and sessions from strangers: checked tables, or a message."""

from __future__ import annotations

import json
import random
import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.analysis.design.design_study import DesignStudy
from condyle.analysis.sweep import Study
from condyle.analysis.sweep.job import prepared
from condyle.identification.calibration_study import CalibrationStudy
from condyle.identification.excite import ExcitationStudy
from condyle.identification.fit_study import FitStudy
from condyle.markers import SessionFile
from condyle.mechanism import Mechanism, dumps, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.mechanism_checks import mechanism_warnings
from condyle.optimisation.optimal_motion import OptimiseStudy
from condyle.optimisation.path_study import PathStudy
from condyle.simulation.scenario import Scenario

from . import mutations
from .mutations import readable, spoiled, tried

SIDE = "chain.masseter_"
STUDY: dict[str, Any] = {
    "motion": {"file": "trial", "rate": 4.0},
    "backend": "numpy",
    "vary": [
        {"what": "platform.mass", "range": [0.2, 0.3], "count": 2},
        {"what": f"{SIDE}left.base[2]", "mirror": f"{SIDE}right.base[2]", "values": [0.05, 0.06]},
    ],
    "sampling": {"kind": "grid", "seed": 3},
    "measure": {
        "peak": {"of": "effort", "take": "max_abs", "over": ["time", "chain"], "better": "less"},
        "force": {"of": "contact_force", "take": "min", "contact": "left_condyle"},
    },
}
SCENARIO: dict[str, Any] = {
    "duration": 0.1,
    "rate": 100.0,
    "method": "rk4",
    "step": 1e-3,
    "start": {"X": 1e-3},
    "controller": {"kind": "joint_pd", "stiffness": 1.0, "damping": 0.1, "rate": 500.0},
    "load": [
        {"kind": "food", "food": "carrot", "point": "right_molar"},
        {"kind": "constant", "force": [0.0, 0.0, -3.0], "point": "incisor"},
    ],
}
SESSION: dict[str, Any] = {
    "mechanism": "masticatory",
    "markers": {"fixed": ["a", "b", "c"], "platform": ["d", "e", "f"]},
    "home": [0.0, 0.5],
    "static": {"file": "s.c3d", "home": 0.1},
    "register": {"incisor": "I", "left_condyle": [1.0, 2.0, 3.0], "right_condyle": "R"},
    "scale": {"landmarks": ["incisor", "left_condyle"], "kind": "thin_plate"},
    "vertical": {"up": [0, 0, 1], "moving": False},
    "filter": {"markers": 10.0, "max_gap": 0.1},
    "emg": {"channels": {"masseter_left": "E1"}, "greatest": {"masseter_left": 1.0}},
    "forces": {"channels": ["Fx", "Fy", "Fz"], "zero": [0.0, 0.1]},
    "cycles": {"by": "beta", "from": "minimum", "shortest": 0.4},
    "trial": [
        {"file": "a.c3d", "labels": {"side": "left"}, "task": "chewing"},
        {"file": "b.c3d", "subject": "B", "labels": {"n": 2}, "cycles": {"by": "gape"}},
    ],
    "solve": {"distribution": "bounded", "preload": 1.0},
}


def checked(machine: Mechanism) -> Mechanism:
    """All that is said of it can be read."""
    assert isinstance(machine, Mechanism)
    readable(repr(machine))
    for warning in mechanism_warnings(machine):
        readable(str(warning))
        json.dumps(warning.data, allow_nan=False)
    return machine


def test_broken_texts_bytes_and_tables(fuzz_seeds: range, tmp_path: Path) -> None:
    path = tmp_path / "jaw.toml"

    def by_bytes(rng: random.Random) -> None:
        path.write_bytes(mutations.broken_bytes(rng))
        checked(condyle.load_mechanism(path))

    def by_tables(rng: random.Random) -> None:
        machine = checked(from_data(mutations.broken_tables(rng), "jaw.toml"))
        assert parse(dumps(machine)) == machine  # what passed is written and read as it is

    tried(fuzz_seeds, lambda rng: checked(parse(mutations.broken_text(rng), "jaw.toml")))
    tried(fuzz_seeds, by_bytes)
    tried(fuzz_seeds, by_tables)


def test_hostile_changes(fuzz_seeds: range, reference: Mechanism) -> None:
    places = ["platform.mass", "gravity[2]", "chain.masseter_left.base[1]", "name", "dependent"]
    places += ["contact.left_condyle.surface", "contact.left_condyle.bounds.x", "chain", "contact"]
    places += ["platform.points", "platform.points.tip", "chain.masseter_left.actuator"]

    def attempt(rng: random.Random) -> None:
        place = rng.choice([*places, *mutations.STRANGE])
        if rng.random() < 0.3:
            at = rng.randrange(len(place) + 1)
            place = place[:at] + rng.choice([*mutations.STRANGE, "[", "]", ".", '"']) + place[at:]
        value = rng.choice([mutations.hostile(rng), 0.3, None])
        if rng.random() < 0.2:
            checked(reference.set({place: value, rng.choice(places): 1.0}))
        else:
            checked(reference.set(place, value))

    tried(fuzz_seeds, attempt)


@pytest.mark.parametrize(
    ("original", "read"),
    [
        (STUDY, lambda tables: prepared(Study.read(tables), None, None, None)),
        (SCENARIO, Scenario.read),
        (SESSION, SessionFile.read),
    ],
    ids=["study", "scenario", "session"],
)
def test_altered_tables(
    original: dict[str, Any], read: Callable[[dict[str, Any]], Any], few_seeds: range
) -> None:
    read(original)
    tried(few_seeds, lambda rng: read(spoiled(original, rng)), quiet=True)


STUDIES: dict[str, Any] = {
    "calibration": CalibrationStudy,
    "design": DesignStudy,
    "excitation": ExcitationStudy,
    "fit": FitStudy,
    "optimise": OptimiseStudy,
    "path": PathStudy,
}


@pytest.mark.parametrize("kind", STUDIES)
def test_altered_studies(kind: str, few_seeds: range, monkeypatch: pytest.MonkeyPatch) -> None:
    """A path is planned, up to the mechanics."""
    text = (files("condyle.analysis") / "study_templates" / f"{kind}.toml").read_text(
        encoding="utf-8"
    )

    class PlannedError(Exception):
        """Far enough."""

    def stop(*_: Any, **__: Any) -> None:
        raise PlannedError

    monkeypatch.setattr("condyle.optimisation.path_study.derive", stop)

    def attempt(rng: random.Random) -> None:
        tables = spoiled(tomllib.loads(text), rng)
        STUDIES[kind].read(tables)
        if kind == "path":
            with pytest.raises((PlannedError, condyle.CondyleError)):
                condyle.plan_path("masticatory", tables)

    tried(few_seeds, attempt, quiet=True)
