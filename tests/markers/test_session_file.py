"""The session file: what it means, and what is wrong with one, all at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.errors import InputError, ProblemsError
from condyle.markers import MarkerFile, SessionFile

ROLES = {"fixed": ["a", "b", "c"], "platform": ["d", "e", "f"]}
GOOD: dict[str, Any] = {
    "mechanism": "human-jaw",
    "markers": ROLES,
    "home": [0.0, 0.5],
    "register": {"incisor": "I", "left_condyle": [1, 2, 3], "right_condyle": [1, 2, 4]},
    "trial": [
        {"file": "chewing1.c3d", "labels": {"side": "right", "bolus": 3}},
        {"file": "b/2.c3d"},
    ],
}


def test_a_session_says_what_a_marker_file_says() -> None:
    session = SessionFile.read(GOOD | {"weights": {"d": 2.0}, "cycles": {"by": "beta"}})
    same = {k: GOOD[k] for k in ("home", "register")} | ROLES | {"weights": {"d": 2.0}}
    markers = MarkerFile.read(same)
    for name in type(markers).model_fields:
        assert getattr(session, name) == getattr(markers, name)
    flat = SessionFile.read(GOOD | {"markers": {}} | ROLES)
    assert flat.fixed == session.fixed and SessionFile.read(session) is session
    assert MarkerFile.read(session) is session
    assert session.cycles is not None and session.cycles.turn == "minimum"
    assert session.filter.cutoff == "auto" and session.words == ["side", "bolus"]
    assert [t.name for t in session.trials] == ["chewing1", "2"]
    assert session.trials[0].words == {"side": "right", "bolus": 3}


def test_paths_start_at_the_file(tmp_path: Path) -> None:
    lines = [
        'mechanism = "jaw.toml"\nfixed = ["a", "b", "c"]\nplatform = ["d", "e", "f"]',
        'static = { file = "s.c3d", home = 0.1 }\nsolve = { vary = "bands.toml" }',
        'register = { incisor = "I", x = "J", y = "K" }',
        '[[trial]]\nfile = "b/2.c3d"\nlabels = { side = "left" }',
    ]
    (tmp_path / "session.toml").write_text("\n".join(lines))
    found = SessionFile.read(tmp_path / "session.toml")
    assert found.static is not None
    assert found.static.file == str(tmp_path / "s.c3d") and found.static.home == (0.1, 0.1)
    assert found.trials[0].file == str(tmp_path / "b/2.c3d")
    assert found.trials[0].words == {"side": "left"} and found.trials[0].name == "2"
    assert found.mechanism == str(tmp_path / "jaw.toml")
    assert found.solve.vary == str(tmp_path / "bands.toml")


def test_everything_wrong_is_said_at_once(tmp_path: Path) -> None:
    bad = {
        "cycle": {},
        "scale": {"landmarks": ["incisor"], "kin": 1},
        "filter": {"markers": -1, "max_gap": "long"},
        "cycles": {"by": "beta", "from": "middle", "shortest": 0},
        "solve": {"preload": -1.0},
        "trial": [{"task": "x"}, {"file": "a.c3d", "labels": {"peak_x": 1}}],
    }
    with pytest.raises(ProblemsError) as caught:
        SessionFile.read(GOOD | bad)
    for text in (
        "cycle: is not a key of the file format; remove it or correct its spelling. Did you mean",
        "scale.kin: is not a key of the file format; remove it or correct its spelling. Did you",
        'filter.markers: expected a frequency above 0 [Hz], "auto" or "none", got -1',
        "filter.max_gap: expected a number, got 'long'",
        "cycles.from: expected 'minimum' or 'maximum', got 'middle'",
        "cycles.shortest: expected a value above 0.0, got 0",
        "solve.preload: expected a value of at least 0.0, got -1.0",
        "trial[0].file: is missing",
        "peak_x is a column of the tables; choose another word",
    ):
        assert any(text in problem for problem in caught.value.problems), text


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"trial": [{"file": "x/a.c3d"}, {"file": "A.c3d"}]}, "a, A would be one file of results"),
    ({"trial": [{"file": "mean.c3d"}]}, "mean is a file of the session's own"),
    ({"trial": []}, "at least 1"),
    ({"trial": {"file": "a.c3d"}}, r"expected tables, each under \[\[trial\]\]"),
    (
        {"trial": [{"file": "a.c3d", "hom": 3, "side": "L"}]},
        r"hom, side: no key of a trial.*write labels = { hom = 3, side = \"L\" }",
    ),
    ({"trial": [{"file": "a.c3d", "labels": {"words": [1]}}]}, r"labels\.words"),
    ({"trial": [{"file": "a.c3d", "labels": {"a,b": 1}}]}, "a,b"),
    ({"trial": [{"file": "a.c3d", "labels": {"trial": "b"}}]}, "trial is a column of the tables"),
    ({"trial": [{"file": "a.c3d", "cycles": {"by": "X", "leest": 3}}]}, "cycles.leest: is not a"),
    ({"cycles": {"by": "X", "within": [2, 1]}}, r"within: expected \[from, to\] in order"),
    ({"group_by": ["bolus", "side", "food"]}, "group_by: food is no label of the trials; they"),
    ({"markers": {"fixd": []}}, "fixd is not a key of it; it has fixed, platform, weights"),
    ({"markers": 3}, "expected a table of fixed, platform, weights, got 3"),
    ({"fixed": ["a", "b", "c"]}, r"fixed is given twice: at the top and in \[markers\]"),
    ({"scale": {"landmarks": ["chin"]}}, r"\[register\] gives no place for chin"),
    ({"cycles": {"by": "beta", "shortest": 1.0, "longest": 0.5}}, "more than shortest, 1 s"),
    ({"home": None}, "home: is missing"),
]


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    for change, text in WRONG:
        given = {k: v for k, v in (GOOD | change).items() if v is not None}
        with pytest.raises(ProblemsError, match=text):
            SessionFile.read(given)
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    said = {3: "session: expected the path of a session file", "b.toml": "not a text file"}
    for given, text in (said | {"none.toml": "no such file"}).items():
        with pytest.raises(InputError, match=text):
            SessionFile.read(tmp_path / given if isinstance(given, str) else given)  # type: ignore


def test_the_schema_has_both_places() -> None:
    schema = condyle.schema("session")
    assert {*ROLES} <= {*schema["properties"]} & {*schema["properties"]["markers"]["properties"]}
    assert {"mechanism", "register", "trial"} == {*schema["required"]}
