"""Studies and scenarios from strangers: tables that are checked, or a message for a terminal."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from typing import Any

import pytest

import condyle
from condyle.analysis.sweep.job import prepared
from condyle.analysis.sweep.study import read_study
from condyle.markers import read_session
from condyle.mechanism import Mechanism
from condyle.simulation.scenario import scenario_from
from fuzz.mutations import STRANGE, _places, hostile, said_in_words

STUDY: dict[str, Any] = {
    "motion": {"file": "trial", "rate": 4.0},
    "backend": "numpy",
    "vary": [
        {"what": "platform.mass", "range": [0.2, 0.3], "count": 2},
        {
            "what": "chain.masseter_left.base[2]",
            "mirror": "chain.masseter_right.base[2]",
            "values": [0.05, 0.06],
        },
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
    "trial": [{"file": "a.c3d", "side": "left"}, {"file": "b.c3d", "subject": "B", "n": 2}],
    "solve": {"distribution": "bounded", "preload": 1.0},
}


def altered(tables: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """A few entries replaced, renamed, removed and doubled."""
    found = copy.deepcopy(tables)
    for _ in range(rng.choice((1, 1, 2, 3))):
        places = list(_places(found))
        if not places:
            break
        node, key = rng.choice(places)
        what = rng.randrange(5)
        if what == 0:
            del node[key]
        elif what == 1 and isinstance(node, dict):
            node[rng.choice(STRANGE)] = node.pop(key)
        elif what == 2 and isinstance(node, list):
            node.append(copy.deepcopy(node[key]))
        elif what == 3:
            node[key] = copy.deepcopy(rng.choice(places)[0])
        else:
            node[key] = hostile(rng)
    return found


@pytest.fixture(scope="module")
def machine() -> Mechanism:
    return condyle.load_mechanism("masticatory")


def attempt_study(tables: dict[str, Any], machine: Mechanism) -> None:
    prepared(read_study(tables), None, None, None)


def attempt_session(tables: dict[str, Any], machine: Mechanism) -> None:
    read_session(tables)


def attempt_scenario(tables: dict[str, Any], machine: Mechanism) -> None:
    scenario_from(tables)


@pytest.mark.parametrize(
    ("original", "attempt"),
    [(STUDY, attempt_study), (SCENARIO, attempt_scenario), (SESSION, attempt_session)],
)
def test_altered_tables(
    original: dict[str, Any],
    attempt: Callable[[dict[str, Any], Mechanism], None],
    machine: Mechanism,
    few_seeds: range,
) -> None:
    attempt(original, machine)
    good = 0
    for seed in few_seeds:
        try:
            attempt(altered(original, random.Random(seed)), machine)
        except Exception as error:
            said_in_words(error, seed)
        else:
            good += 1
    assert 0 < good < len(few_seeds)
