"""Mass centres of platform and cranks anywhere: 60 digits, files, MuJoCo's.

Formulations and Pinocchio are asked in `test_moving_base` and `test_engines`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from oracles.digits import Machine
from oracles.random_mechanism import off_centre, random_mechanism
from support.families import close, of_raw
from support.loads import parts

import condyle
from condyle.errors import CondyleError
from condyle.mechanism.files import parse

CRANK = {"inertia": 8e-5, "mass": 0.02, "com": -0.01}
CENTRE = (1e-3, 2e-3, -3e-3)


@pytest.mark.slow
def test_sixty_digits() -> None:
    """Inverse and forward dynamics; matrices; energy, whose rate is the power of the efforts."""
    rng = np.random.default_rng(12)
    raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), contacts=1)
    c = of_raw(off_centre(rng, raw))
    model, s, load = c.model(), c.states, parts(c.load)
    machine = Machine(c.raw, model.independent)
    q, v, a = state = s["q"], s["qd"], s["qdd"]
    found = model.inverse_dynamics(*state, *load, outputs="joint_rate")
    back = model.forward_dynamics(q, v, found.effort, *load)
    for i in range(2):
        near, given = s["pose"][i], [x[i] for x in state]
        at = c.load[i, :6], c.load[i, 6:]
        theirs = machine.inverse(near, *given, *at)
        accelerations, _ = machine.forward(near, *given[:2], found.effort[i], *at)
        for ours, right, bound in (
            (found.effort[i], theirs[0], 1e-12),
            (found.contact_force[i], theirs[1], 1e-12),
            (back.acceleration[i], accelerations, 1e-11),
        ):
            close(ours, [float(x) for x in right], bound)
    M, C = model.mass_matrix(q), model.coriolis(q, v)
    close(M, M.swapaxes(1, 2), 1e-12)
    close((C @ v[..., None])[..., 0], model.bias(q, v), 1e-10)

    def energy(t: float) -> np.ndarray:
        ports = {"q": q + t * v + t * t / 2 * a, "q1": v + t * a}
        values = model.kernel("energy").run(ports).values
        return values["kinetic"] + values["potential"]

    h, unloaded = 1e-4, model.inverse_dynamics(*state, outputs="joint_rate")
    power = (8 * (energy(h) - energy(-h)) - (energy(2 * h) - energy(-2 * h))) / (12 * h)
    close(power, (unloaded.joint_rate * unloaded.effort).sum(axis=1), 1e-6)


def test_files_and_mjcf(tmp_path: Path) -> None:
    plain = condyle.load_mechanism("masticatory")
    assert "com" not in condyle.dumps(plain).split("[[contact]]")[0]
    cranks = {f"chain.{name}.crank": CRANK for name in plain.chain_names}
    changed = plain.set({"platform.com": CENTRE} | cranks)
    assert parse(condyle.dumps(changed)) == changed
    assert changed.get("platform.com") == CENTRE
    name = plain.chain_names[0]
    assert changed.get(f"chain.{name}.crank.com") == -0.01
    with pytest.raises(CondyleError, match="about the shaft"):
        plain.set(f"chain.{name}.crank", {**CRANK, "inertia": 1e-6})
    mujoco = pytest.importorskip("mujoco")
    condyle.export_mjcf(changed, tmp_path / "jaw")
    (path,) = (tmp_path / "jaw").glob("*.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    body, crank = (
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
        for body in ("platform", f"{name}_crank")
    )
    assert model.body_ipos[body] == pytest.approx(CENTRE)
    assert model.body_mass[crank] == pytest.approx(0.02)
    assert np.linalg.norm(model.body_ipos[crank]) == pytest.approx(0.01)
