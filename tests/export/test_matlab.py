"""MEX functions, compiled and called by Octave."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.io import loadmat, savemat
from support.machines import model
from support.tools import need, run

import condyle


def test_every_function_has_a_gateway_and_a_help_text(tmp_path: Path) -> None:
    files = condyle.export_matlab("gough-stewart", tmp_path, question="inverse")
    stem = "gough_stewart"
    assert {path.name for path in files} == {
        *(f"{stem}.c", f"{stem}.h", f"{stem}_inverse.m", f"{stem}_inverse_mex.c"),
        *("build.m", f"{stem}_example.m"),
    }
    text = (tmp_path / f"{stem}_inverse.m").read_text()
    assert "leg_1, leg_2" in text and "[N]" in text and "independent coordinates" in text


def test_octave_computes_what_condyle_does(tmp_path: Path) -> None:
    """Samples in columns; the example runs; a bad sample is a status, or an error without one."""
    need("octave-cli", "mkoctfile")  # Debian's octave comes without the latter
    condyle.export_matlab("masticatory", tmp_path, question=("contact", "forward"))
    rng, scale = np.random.default_rng(2), np.array([1e-3, 1e-3, 0.02, 0.05])
    q, q1, q2 = (rng.uniform(-1, 1, (5, 4)) * scale * s for s in (1, 10, 100))
    q[3, 0] = 0.5  # out of reach
    force, point = rng.uniform(-10, 10, (5, 3)), np.full(3, 0.01)
    given = {"q": q.T, "q1": q1.T, "q2": q2.T, "force": force.T, "point": point[:, None]}
    savemat(tmp_path / "in.mat", given)
    code = """
        build; masticatory_example;
        load('in.mat'); none = zeros(3, 1);
        [effort, contact, status] = masticatory_contact(q, q1, q2, force, none, point);
        try masticatory_contact(q, q1, q2, force, none, point); said = '';
        catch e, said = e.message; end
        try masticatory_contact(q(1:3, :), q1, q2, force, none, point); wrong = '';
        catch e, wrong = e.message; end
        save('-v7', 'out.mat', 'effort', 'contact', 'status', 'said', 'wrong');
    """
    run("octave-cli", "--quiet", "--no-init-file", "--eval", code, folder=tmp_path)
    out = loadmat(tmp_path / "out.mat", simplify_cells=True)
    wrench = np.hstack([force, np.zeros((5, 3))])
    found = model("masticatory").inverse_dynamics(q, q1, q2, wrench, point, outputs="all")
    good = found.status == 0
    assert list(out["status"]) == [0, 0, 0, 1, 0] and good.sum() == 4
    assert np.isnan(out["effort"][:, 3]).all()
    for got, right in ((out["effort"], found.effort), (out["contact"], found.contact_force)):
        bound = 1e-12 * np.abs(right[good]).max()
        np.testing.assert_allclose(got.T[good], right[good], rtol=0, atol=bound)
    assert "sample 4 has status 1" in out["said"]
    assert "q: expected a real matrix of 4 rows" in out["wrong"]
