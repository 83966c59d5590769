"""Five formulations, derived in five ways, give the same numbers on every family."""

from __future__ import annotations

from pathlib import Path

import pytest
from oracles import description
from support.families import MECHANISMS, Case, case, of_raw, same
from support.speeds import few, slow

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import load_mechanism
from condyle.questions.numbers import has_closed_form

pytestmark = pytest.mark.slow

OTHERS = [name for name in FORMULATIONS if name != "virtual_power"]
BUNDLED = Path(condyle.__file__).parent / "mechanism" / "bundled"


@pytest.mark.parametrize("formulation", OTHERS)
@pytest.mark.parametrize("name", few(MECHANISMS, "rss_k0", "pss_k1", "mixed"))
def test_formulations_agree(name: str, formulation: str) -> None:
    c = case(name)
    same(c.evaluate(formulation), c.evaluate(), 1e-10)


@slow
@pytest.mark.parametrize(
    ("name", "formulation", "tolerance"),
    [
        *((name, "virtual_power", 1e-11) for name in ("pss", "sps_k1", "mixed")),
        *(("pss_k1", "hessian", 1e-10), ("sps_k1", "newton_euler", 1e-10)),
    ],
)
def test_compiled_kernels_agree(name: str, formulation: str, tolerance: float) -> None:
    c = case(name)
    same(c.evaluate(formulation, backend="compiled"), c.evaluate(), tolerance)


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("name", few(["rss", "pss", "sps_k1", "mixed_k0_n8"], "sps_k1"))
def test_routes_agree(name: str, formulation: str) -> None:
    c = case(name)
    assert has_closed_form(c.mechanism)
    same(c.evaluate(formulation, "direct"), c.evaluate(), 1e-10)


def bundled(name: str) -> Case:
    return of_raw(description.load(BUNDLED / f"{name}.toml"))


@pytest.mark.parametrize("formulation", OTHERS)
@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_bundled_mechanisms(name: str, formulation: str) -> None:
    c = bundled(name)
    assert c.mechanism == load_mechanism(name)
    same(c.evaluate(formulation), c.evaluate(), 1e-10)
