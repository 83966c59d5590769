"""Activations from EMG: their dynamics, what they leave unbalanced, and least deviation from them.

Dynamics by SciPy's integrator, contact forces by its least squares.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear
from support.machines import model as shared

import condyle
from condyle.kinematics.chain.muscle import activated
from condyle.markers import MeasuredChannels
from condyle.mechanism.home import characteristic_length
from condyle.motion import write_table
from condyle.results.emg_followed import emg_lags, emg_match
from condyle.results.summary import summarize
from condyle.status import Status

from .test_muscles import JAW, LOAD, recruited, solved, states, tensions

pytestmark = pytest.mark.slow


def test_activation_follows_excitation():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.002, 0.05, 40))
    u = rng.uniform(0, 1, 40)
    u[20:24] = 0.4
    found = activated(u, t, 0.015, 0.06)

    def rate(at, a):
        more = np.interp(at, t, u) - a
        return more / np.where(more > 0, 0.015, 0.06)

    a = u[:1]
    for i in range(len(t) - 1):
        a = solve_ivp(rate, t[i : i + 2], a, rtol=1e-9, atol=1e-11, max_step=1e-3).y[:, -1]
        assert found[i + 1] == pytest.approx(a[0], abs=1e-7)


def followed(name, activation, **choice):
    chosen = condyle.Distribution(name, **choice)
    return solved(JAW, len(activation), chosen, activation=activation)


def measured(count, known=14):
    """Activations of some muscles, more than any balance asks for, so that the joints are pressed;
    NaN of the others."""
    activation = np.random.default_rng(8).uniform(0.0, 0.5, (count, 24))
    activation[:, known:] = np.nan
    return activation


def test_emg_alone_leaves_a_wrench():
    """The contacts bear what they can of it, in the sense of least squares."""
    activation = measured(15)
    mechanism, found, s = followed("emg", activation)
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    effort = passive + active * np.nan_to_num(activation)
    assert (found.status == Status.ok).all()
    np.testing.assert_allclose(found.effort, effort, atol=1e-7)
    scale = np.repeat([1.0, 1 / characteristic_length(mechanism)], 3)
    ends = [(0, np.inf) if c.push > 0 else (-np.inf, 0) for c in mechanism.contacts]
    for i in range(15):
        left, N = s["Q"][i] - s["J"][i] @ effort[i], s["normal"][i].T
        best = lsq_linear(scale[:, None] * N, scale * left, np.transpose(ends), tol=1e-14)
        np.testing.assert_allclose(found.contact_force[i], best.x, atol=1e-4)
        expected = left - N @ found.contact_force[i]
        np.testing.assert_allclose(found.residual_wrench[i], expected, atol=1e-7)
    assert (np.abs(found.contact_force) > 1).sum() > 10


def test_the_efforts_that_balance_leave_nothing():
    model = shared(JAW)
    q, v, a = states(20)
    own = model.inverse_dynamics(q, v, a, LOAD, at="right_molar", outputs="all")
    passive, active, *_ = tensions(model.mechanism, own.pose, own.pose_rate)
    good = own.status == Status.ok
    activation = np.where(good[:, None], (own.effort - passive) / active, 0.0).clip(0)
    for name in ("emg", "emg_assisted"):
        _, found, _ = followed(name, activation)
        np.testing.assert_allclose(found.effort[good], own.effort[good], atol=1e-4)
        forces = found.contact_force[good], own.contact_force[good]
        np.testing.assert_allclose(*forces, atol=1e-4)
        np.testing.assert_allclose(found.residual_wrench[good], 0, atol=1e-4)


@pytest.mark.parametrize("count", [25, pytest.param(150, marks=pytest.mark.ci)])
def test_least_deviation(count):
    activation = measured(count)
    weight, target = np.where(np.isfinite(activation[0]), 9.0, 1.0), np.nan_to_num(activation)
    given = followed("emg_assisted", activation, emg_weight=9.0)
    recruited(*given, lambda a, i: weight * (a - target[i]))


@pytest.fixture(scope="module")
def motion():
    return condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=50)


@pytest.fixture(scope="module")
def plain(motion):
    return shared(JAW).solve(motion)


def channels(plain, lag=0.0):
    t, names = plain["time"].values, plain["chain"].values[:9]
    emg = {str(n): np.interp(t + lag, t, plain["activation"].sel(chain=n)) for n in names}
    return MeasuredChannels(t, emg={n: a / a.max() for n, a in emg.items()})


def test_a_solution_keeps_emg_its_activation_and_the_wrench(motion, plain):
    table = channels(plain)
    model = shared(JAW, distribution="emg")
    found = model.solve(motion, measured=table)
    for i, chain in enumerate(model.mechanism.chains):
        own, active = (found[x].values[:, i] for x in ("emg_activation", "activation"))
        if chain.name not in table.emg:
            assert np.isnan(own).all() and (active < 1e-9).all()
            continue
        m = chain.muscle
        expected = activated(table.emg[chain.name], table.t, m.activation_time, m.deactivation_time)
        np.testing.assert_allclose(own, expected, atol=1e-9)
        np.testing.assert_allclose(active, own, atol=1e-9)
    assert found["residual"].dims == ("time", "component") and found["residual"].units.startswith(
        "N, "
    )
    assert np.abs(found["residual"].values).max() > 1
    assert json.loads(found.attrs["options"])["distribution"] == "emg"
    late = plain.condyle.with_measured(channels(plain, lag=0.08))
    lags = emg_lags(late)
    assert len(lags) >= 5
    for one in lags.values():
        assert one["lag"] == pytest.approx(0.08, abs=0.006) and one["correlation"] > 0.95
    assert "EMG" in str(summarize(late)) and "80 ms" in str(summarize(late))


def test_a_cycle_is_held_against_emg_that_began_before_it():
    """A bump and its late image, by closed form; noise, by trying every lag."""
    t = np.arange(0, 3, 0.01)
    bump = np.exp(-(((t - 1.3) / 0.15) ** 2))
    late = 0.1 + 0.8 * np.exp(-(((t - 1.36) / 0.15) ** 2))
    match = emg_match(t, bump, late, 1.0, 1.7)
    assert match.lag == pytest.approx(0.06, abs=1e-9) and match.correlation > 0.9999
    s = np.arange(1.0, 1.7, 0.005)
    left = 0.1 - 0.2 * np.exp(-(((s - 1.36) / 0.15) ** 2))
    assert match.rmse == pytest.approx(np.sqrt(np.mean(left**2)), rel=1e-3)
    x, y = np.random.default_rng(1).normal(size=(2, len(t)))
    y[160:] += 2 * x[156:-4]  # 0.04 s late
    match = emg_match(t, x, y, 2.0, 2.8)
    inside = (t >= 2.0) & (t < 2.8)
    tried = {k: np.corrcoef(np.roll(x, k)[inside], y[inside])[0, 1] for k in range(-19, 20)}
    assert match.lag == pytest.approx(0.01 * max(tried, key=tried.get), abs=6e-3) == 0.04
    # What is later than the lags that are searched is held against EMG as it stands.
    later = np.exp(-(((t - 1.7) / 0.15) ** 2))
    match = emg_match(t, bump, later, 1.4, 2.1)
    assert match.lag is None and emg_match(t, bump, -bump, 1.0, 1.7).lag is None
    s = s + 0.4
    apart = np.exp(-(((s - 1.7) / 0.15) ** 2)) - np.exp(-(((s - 1.3) / 0.15) ** 2))
    assert match.rmse == pytest.approx(np.sqrt(np.mean(apart**2)), rel=6e-3)  # a sample of 140
    assert emg_match(t, 0 * t, late, 1.0, 1.7) is emg_match(t, bump, late, 1.0, 1.2) is None


def test_run_follows_a_table_of_emg(condyle_command, plain):
    write_table(Path("emg.csv"), channels(plain).columns())
    asked = ["run", JAW, "--rate", "50", "--distribution", "emg_assisted", "--backend", "numpy"]
    asked += ["--emg-weight", "5", "--out", "out", "--json"]
    done = condyle_command(*asked, "--measured", "emg.csv")
    assert done.status == 0 and json.loads(done.out)["emg_lag"]
    assert "residual" not in condyle.open_solution(next(Path("out").glob("*.nc")))
    assert "--measured" in condyle_command(*asked).err


def test_what_cannot_be_followed_is_said(motion, plain):
    model = shared(JAW, distribution="emg")
    q, v, a = states(2)
    with pytest.raises(condyle.InputError, match="follows activations from EMG"):
        model.inverse_dynamics(q, v, a)
    with pytest.raises(condyle.InputError, match="follows EMG, and there is none"):
        model.solve(motion)
    table = channels(plain)
    short = MeasuredChannels(table.t[:50], emg={n: a[:50] for n, a in table.emg.items()})
    with pytest.raises(condyle.InputError, match="ends before the motion"):
        model.solve(motion, measured=short)
    gap = measured(2)
    gap[1, 3] = np.nan
    for wrong in (gap, -np.abs(measured(2)), measured(3)):
        with pytest.raises(condyle.InputError, match="activation"):
            model.inverse_dynamics(q, v, a, activation=wrong)
    with pytest.raises(condyle.InputError, match="follows no measured"):
        model.with_distribution("cubic").inverse_dynamics(q, v, a, activation=measured(2))
    with pytest.raises(condyle.InputError, match="does not weigh EMG"):
        model.with_distribution(condyle.Distribution("cubic", emg_weight=2.0))
