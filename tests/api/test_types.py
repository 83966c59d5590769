"""What an editor knows: choices, what README and tutorials call, and the types of all names."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.analysis.studies import OTHERS, STUDIES, FileKind, StudyName
from condyle.dynamics import FORMULATIONS, FormulationName
from condyle.export.fmu_model import KINDS, FmuKind
from condyle.frameworks.jax_functions import METHODS, JaxMethod
from condyle.model.distributing import NAMED, ObjectiveName
from condyle.model.model_result import GROUPS, ModelResult
from condyle.quantities import QUANTITIES

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("tutorial*.md")))
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
TYPED = 0.95  # of the names of the package
SLIPS = {
    'condyle.derive("masticatory", formulation="momentu")': "arg-type",
    'condyle.derive("masticatory", distribution="bonded")': "arg-type",
    'condyle.new_study("mine", "fitt")': "arg-type",
    'condyle.schema("scenarios")': "arg-type",
    'condyle.derive("masticatory").sovle(condyle.reference_motion())': "attr-defined",
    'condyle.dervie("masticatory")': "attr-defined",
}


@pytest.mark.parametrize(
    "choice, registry",
    [
        (FormulationName, FORMULATIONS),
        (ObjectiveName, NAMED),
        (FmuKind, KINDS),
        (StudyName, STUDIES),
        (FileKind, {**OTHERS, **STUDIES}),
        (JaxMethod, METHODS),
    ],
)
def test_a_choice_is_its_registry(choice: Any, registry: Collection[str]) -> None:
    assert sorted(get_args(choice)) == sorted(registry)


def test_results_declare_what_they_have() -> None:
    """So that an editor completes `result.effort`."""
    own = model("masticatory")
    still, joint = np.zeros(len(own.independent)), np.zeros(len(own.mechanism.chains))
    inverse = own.inverse_dynamics(still, still, still, outputs="all")
    soft = {f"chain.{name}.actuator.stiffness": 400.0 for name in own.mechanism.chain_names}
    giving = condyle.derive(own.mechanism.set(soft))
    law = {"kind": "linear", "stiffness": 1e6}
    pads = {f"contact.{name}.compliance": law for name in own.mechanism.contact_names}
    yielding = condyle.derive(own.mechanism.set(pads))
    results = (
        inverse,
        own.forward_dynamics(still, still, inverse.effort, outputs="all"),
        own.inverse_kinematics(still, still, still),
        own.forward_kinematics(joint),
        own.jacobians(still),
        own.linearise(still, still, inverse.effort),
        giving.stiffness(still),
        giving.modes(still),
        yielding.inverse_dynamics(still, still, still, contacts="compliant"),
    )
    declared = get_type_hints(ModelResult)
    assert declared.keys() <= QUANTITIES.keys() | GROUPS.keys()
    assert declared == {name: type(value) for one in results for name, value in vars(one).items()}


@pytest.mark.ci
def test_readme_and_tutorials_are_typed_and_slips_are_marked(tmp_path: Path) -> None:
    for page in PAGES:
        text = "\n".join(BLOCK.findall(page.read_text(encoding="utf-8")))
        assert "condyle." in text
        (tmp_path / f"{page.stem.replace('-', '_')}.py").write_text(text, encoding="utf-8")
    (tmp_path / "slips.py").write_text("\n".join(["import condyle", *SLIPS]), encoding="utf-8")
    how = ("--strict", "--follow-imports=silent", "--no-pretty", "--hide-error-context")
    found = ran(tmp_path, "mypy", *how, *sorted(path.name for path in tmp_path.glob("*.py")))
    marks = [line for line in found.splitlines() if ": error: " in line]
    assert [mark[: mark.index(" error")] for mark in marks] == [
        f"slips.py:{i}:" for i in range(2, 2 + len(SLIPS))
    ], found
    assert [mark.rpartition("[")[2][:-1] for mark in marks] == [*SLIPS.values()]


@pytest.mark.ci
def test_names_are_typed(tmp_path: Path) -> None:
    if find_spec("pyright") is None:
        pytest.skip("pyright is not installed")
    how = ("--pythonpath", sys.executable, "--ignoreexternal", "--outputjson")
    found = json.loads(ran(tmp_path, "pyright", *how, "--verifytypes", "condyle"))
    assert found["typeCompleteness"]["completenessScore"] >= TYPED


def ran(folder: Path, program: str, *arguments: str) -> str:
    """What a type checker says."""
    call = [sys.executable, "-m", program, *arguments]
    sources = dict.fromkeys(("MYPYPATH", "PYTHONPATH"), str(ROOT / "src"))
    return subprocess.run(
        call, cwd=folder, env=os.environ | sources, capture_output=True, text=True
    ).stdout
