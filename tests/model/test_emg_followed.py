"""Activations from EMG: their dynamics, what they leave unbalanced, and least deviation from them.

Dynamics by SciPy's integrator, contact forces by its least squares, deviations by quadprog.
"""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear
from typer.testing import CliRunner

import condyle
from condyle.cli.app import app
from condyle.kinematics.chain.muscle import activated
from condyle.markers import MeasuredChannels
from condyle.mechanism.home import characteristic_length
from condyle.results.emg_followed import emg_lags
from condyle.results.summary import summarize
from condyle.status import Status

from .test_muscles import JAW, Balance, states, tensions

LOAD = (0, 0, -60.0, 0, 0, 0)


def test_activation_follows_excitation():
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.002, 0.05, 60))
    u = rng.uniform(0, 1, 60)
    u[20:24] = 0.4
    found = activated(u, t, 0.015, 0.06)

    def rate(at, a):
        more = np.interp(at, t, u) - a
        return more / np.where(more > 0, 0.015, 0.06)

    a = u[:1]
    for i in range(len(t) - 1):
        a = solve_ivp(rate, t[i : i + 2], a, rtol=1e-9, atol=1e-11, max_step=1e-3).y[:, -1]
        assert found[i + 1] == pytest.approx(a[0], abs=1e-7)


def followed(name, activation, count, **choice):
    chosen = condyle.Distribution(name, **choice)
    model = condyle.derive(JAW, distribution=chosen, backend="numpy")
    q, v, a = states(count)
    more = {"outputs": "all", "activation": activation}
    found = model.inverse_dynamics(q, v, a, LOAD, at="right_molar", **more)
    ports = {n: getattr(found, n) for n in ("pose", "pose_rate", "pose_acceleration")}
    ports |= {"force": np.tile(LOAD[:3], (count, 1)), "moment": np.zeros((count, 3))}
    ports["point"] = np.tile(model.mechanism.platform.points["right_molar"], (count, 1))
    s = {k: np.moveaxis(x, -1, 0) for k, x in model.kernel("balance").run(ports).values.items()}
    return model.mechanism, found, s


def measured(count, known=14):
    """Activations of some muscles, more than any balance asks for, so that the joints are pressed;
    NaN of the others."""
    activation = np.random.default_rng(8).uniform(0.0, 0.5, (count, 24))
    activation[:, known:] = np.nan
    return activation


def test_emg_alone_leaves_a_wrench():
    activation = measured(30)
    mechanism, found, s = followed("emg", activation, 30)
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    effort = passive + active * np.nan_to_num(activation)
    assert (found.status == Status.ok).all()
    np.testing.assert_allclose(found.effort, effort, atol=1e-7)
    scale = np.repeat([1.0, 1 / characteristic_length(mechanism)], 3)
    bearing = 0
    for i in range(30):
        left = s["Q"][i] - s["J"][i] @ effort[i]
        ends = [(0, np.inf) if c.push > 0 else (-np.inf, 0) for c in mechanism.contacts]
        N = s["normal"][i].T
        best = lsq_linear(scale[:, None] * N, scale * left, np.transpose(ends), tol=1e-14)
        np.testing.assert_allclose(found.contact_force[i], best.x, atol=1e-4)
        expected = left - N @ found.contact_force[i]
        np.testing.assert_allclose(found.residual_wrench[i], expected, atol=1e-7)
        bearing += int((np.abs(found.contact_force[i]) > 1).sum())
    assert bearing > 20


def test_the_efforts_that_balance_leave_nothing():
    model = condyle.derive(JAW, backend="numpy")
    q, v, a = states(20)
    own = model.inverse_dynamics(q, v, a, LOAD, at="right_molar", outputs="all")
    passive, active, *_ = tensions(model.mechanism, own.pose, own.pose_rate)
    good = own.status == Status.ok
    activation = np.where(good[:, None], (own.effort - passive) / active, 0.0).clip(0)
    for name in ("emg", "emg_assisted"):
        _, found, _ = followed(name, activation, 20)
        np.testing.assert_allclose(found.effort[good], own.effort[good], atol=1e-4)
        forces = found.contact_force[good], own.contact_force[good]
        np.testing.assert_allclose(*forces, atol=1e-4)
        np.testing.assert_allclose(found.residual_wrench[good], 0, atol=1e-4)


@pytest.mark.parametrize("count", [25, pytest.param(500, marks=pytest.mark.ci)])
def test_least_deviation_is_that_of_quadprog(count):
    pytest.importorskip("quadprog", reason="quadprog is in the `bench` extra")
    activation = measured(count)
    mechanism, found, s = followed("emg_assisted", activation, count, emg_weight=9.0)
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    push = np.array([c.push for c in mechanism.contacts], dtype=float)
    weight, fine = np.where(np.isfinite(activation[0]), 3.0, 1.0), 0
    for i in range(count):
        balance = Balance.of(s, i, passive[i], active[i], push)
        needed = balance.most()
        assert found.shortfall[i] == pytest.approx(max(needed, 1.0), rel=1e-7)
        if needed > 1:
            assert found.status[i] == Status.infeasible
            continue
        a = balance.squares(weight, np.nan_to_num(activation[i]))
        np.testing.assert_allclose(found.effort[i], passive[i] + active[i] * a, atol=1e-7)
        fine += 1
    assert 0.4 * count < fine < count


@pytest.fixture(scope="module")
def motion():
    return condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=50)


@pytest.fixture(scope="module")
def plain(motion):
    return condyle.derive(JAW, backend="numpy").solve(motion)


def channels(plain, lag=0.0):
    t, names = plain["time"].values, plain["chain"].values[:9]
    emg = {str(n): np.interp(t + lag, t, plain["activation"].sel(chain=n)) for n in names}
    return MeasuredChannels(t, emg={n: a / a.max() for n, a in emg.items()})


def test_a_solution_keeps_emg_its_activation_and_the_wrench(motion, plain):
    table = channels(plain)
    model = condyle.derive(JAW, distribution="emg", backend="numpy")
    found = model.solve(motion, measured=table)
    for i, chain in enumerate(model.mechanism.chains):
        own = found["emg_activation"].values[:, i]
        if chain.name not in table.emg:
            assert np.isnan(own).all() and (found["activation"].values[:, i] < 1e-9).all()
            continue
        m = chain.muscle
        expected = activated(table.emg[chain.name], table.t, m.activation_time, m.deactivation_time)
        np.testing.assert_allclose(own, expected, atol=1e-9)
        np.testing.assert_allclose(found["activation"].values[:, i], own, atol=1e-9)
    assert found["residual"].dims == ("time", "component") and found["residual"].units == "N, N m"
    assert np.abs(found["residual"].values).max() > 1
    assert json.loads(found.attrs["options"])["distribution"] == "emg"
    assisted = model.with_distribution("emg_assisted").solve(motion, measured=table)
    assert "residual" not in assisted and (assisted["status"] == 0).all()


def test_the_lag_is_found(motion, plain):
    late = plain.condyle.with_measured(channels(plain, lag=0.08))
    lags = emg_lags(late)
    assert len(lags) >= 5
    for one in lags.values():
        assert one["lag"] == pytest.approx(0.08, abs=0.006) and one["correlation"] > 0.95
    assert "EMG" in str(summarize(late)) and "80 ms" in str(summarize(late))


def test_run_follows_a_table_of_emg(tmp_path, plain):
    table = channels(plain)
    columns = table.columns()
    text = [",".join(columns), *(",".join(map(repr, map(float, row))) for row in
                                 np.column_stack([*columns.values()]))]  # fmt: skip
    (tmp_path / "emg.csv").write_text("\n".join(text))
    asked = ["run", JAW, "--rate", "50", "--distribution", "emg_assisted", "--backend", "numpy"]
    asked += ["--emg-weight", "5", "--out", str(tmp_path / "out"), "--json"]
    done = CliRunner().invoke(app, [*asked, "--measured", str(tmp_path / "emg.csv")])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["emg_lag"]
    bare = CliRunner().invoke(app, asked)
    assert "--measured" in str(bare.exception)


def test_what_cannot_be_followed_is_said(motion, plain):
    model = condyle.derive(JAW, distribution="emg", backend="numpy")
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
