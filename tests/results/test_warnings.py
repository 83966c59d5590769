"""Warnings as data: kinds, owners and bounds, whole or block by block."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.kinematics.singularities import Singularity
from condyle.mechanism import bundled_text, parse
from condyle.mechanism.chain import limits
from condyle.motion import Motion
from condyle.results.derived import Derived
from condyle.results.summary import summarize
from condyle.results.warnings import KINDS, Watch


def made_up(mechanism: condyle.Mechanism, count: int) -> Any:
    """An evaluation of random numbers that breaks every rule somewhere."""
    rng = np.random.default_rng(4)
    n, k = len(mechanism.chains), len(mechanism.contacts)
    sigma = -np.sort(-(10 ** rng.uniform(-5, 0, (count, 4))), axis=1)
    transmission = rng.uniform(0.1, 1, (count, n))
    extremes = np.stack([transmission.min(axis=1), transmission.max(axis=1)])
    configuration = SimpleNamespace(
        contact_point=rng.normal(0, 0.1, (count, k, 3)),
        cos_gamma=rng.uniform(0, 0.05, (count, n)),
        discriminant=rng.uniform(-0.2, 1, (count, n)),
        singularity=Singularity.of(transmission, transmission, sigma, extremes, 0.1),
    )
    return SimpleNamespace(
        pose=np.zeros((count, 6)),
        effort=rng.normal(0, 3, (count, n)),
        joint_rate=rng.normal(0, 6, (count, n)),
        contact_force=rng.normal(0, 1, (count, k)),
        configuration=configuration,
        status=rng.choice([0, 0, 0, 1, 2, 3], count).astype(np.int8),
        ambiguous=rng.uniform(size=count) > 0.9,
        bound=10 ** rng.uniform(-12, -5, count),
    )


def part(value: Any, rows: slice) -> Any:
    if isinstance(value, np.ndarray):
        return value[rows]
    if isinstance(value, float):
        return value
    if isinstance(value, Singularity):
        return Singularity(**{name: part(v, rows) for name, v in vars(value).items()})
    return SimpleNamespace(**{name: part(v, rows) for name, v in vars(value).items()})


@pytest.fixture(scope="module")
def one_sided() -> condyle.Mechanism:
    """Its left contact is a layer so soft that it is squeezed out at times."""
    text = bundled_text("masticatory")
    made = parse(re.sub(r"(\[\[contact\]\]\n)", r'\1one_sided = true\nside = "below"\n', text))
    layer = {"modulus": 1e4, "poisson": 0.0, "thickness": 1e-3, "radius": 5e-3}
    layer |= {"kind": "foundation", "large_strain": True}
    return made.set("contact.left_condyle.compliance", layer)


def test_blocks_say_what_the_whole_says(one_sided: condyle.Mechanism) -> None:
    whole = made_up(one_sided, 1000)
    at = np.arange(1, 1001)
    together, apart = Watch(one_sided, rows=True), Watch(one_sided, rows=True)
    together.see(Derived(one_sided, whole), at)
    for start in range(0, 1000, 130):
        rows = slice(start, start + 130)
        apart.see(Derived(one_sided, part(whole, rows)), at[rows])
    assert apart.notices() == together.notices()
    kinds = {notice.kind for notice in together.notices()}
    other = {"home_residual", "given_pose_residual", "implausible", "ended", "failed_variants"}
    assert kinds == {*KINDS} - other - {"slack"}
    ok = whole.status == 0
    for i, chain in enumerate(one_sided.chains):
        peak = np.abs(whole.effort[ok, i]).max()
        mine = [n for n in together.notices() if (n.kind, n.owner) == ("effort_limit", chain.name)]
        limit = limits(chain).high
        assert len(mine) == (peak > limit)
        for notice in mine:
            over = np.abs(whole.effort[:, i]) > limit
            assert (notice.value, notice.bound, notice.unit) == (peak, limit, "N m")
            assert notice.count == (over & ok).sum() and notice.row == at[over & ok][0]


def test_limits_of_every_family() -> None:
    machines = map(condyle.load_mechanism, ("hexaglide", "gough-stewart", "masticatory"))
    chains = [chain for machine in machines for chain in machine.chains]
    for chain in chains:
        stated = chain.actuator.model_dump()
        effort = stated.get("torque_limit", stated.get("force_limit"))
        effort, speed = (np.inf if v is None else v for v in (effort, stated["speed_limit"]))
        assert limits(chain) == (-effort, effort, speed)


def test_rounding_is_no_alarm() -> None:
    """A contact point at its bound to the last bit but one."""
    names = model("masticatory").independent
    motion = Motion.from_arrays(np.linspace(0, 1, 9), np.zeros((9, 4)), names=names)
    solution = model("masticatory").solve(motion)
    margin = solution["bound_margin"].values.copy()
    margin[3, 0] = -3.469e-18
    solution["bound_margin"] = solution["bound_margin"].copy(data=margin)
    text = str(summarize(solution))
    assert "OUTSIDE" not in text and "e-15" not in text
    assert "closest to the bounds: left_condyle, 0 mm inside" in text
