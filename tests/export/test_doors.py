"""Four exports, one shape: a model, a path, options as keywords; the files that were written."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.export import fmu

DOORS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "c": (condyle.export_c, {"question": "motion", "lanes": 0}),
    "fmu": (condyle.export_fmu, {"kind": "inverse"}),
    "acados": (condyle.export_acados, {"step": 0.01}),
    "matlab": (condyle.export_matlab, {"question": ["motion"]}),
    "mjcf": (condyle.export_mjcf, {}),
}


@pytest.fixture(params=DOORS)
def door(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    export, options = DOORS[request.param]
    monkeypatch.setattr(fmu, "_built", lambda sources: b"")  # which takes seconds
    monkeypatch.setattr("condyle.export.mjcf._home", lambda document: None)
    return lambda model, path, **more: export(model, path, **options, **more)


def test_what_stands_for_a_mechanism(door: Callable[..., Any], tmp_path: Path) -> None:
    """A name, a mechanism, a file as text and as a path, a model: the same files."""
    mechanism = condyle.load_mechanism("gough-stewart")
    condyle.dump(mechanism, file := tmp_path / "robot.toml")
    model = condyle.derive(mechanism, backend="numpy")
    texts = []
    for k, given in enumerate(("gough-stewart", mechanism, str(file), file, model)):
        files = door(given, tmp_path / f"{k}" / "deep")
        assert isinstance(files, list) and all(path.is_file() for path in files)
        assert files.data["mechanism"] == "gough-stewart"
        there = {path.name: path.read_bytes() for path in files if path.name != "FACTS.md"}
        assert len(there) + any(path.name == "FACTS.md" for path in files) == len(files)
        texts.append(there)
    assert all(one == texts[0] for one in texts)


@pytest.mark.parametrize(
    "model, path, said",
    [
        (3, "x", "mechanism: expected a mechanism, a model, .*got int"),
        (None, "x", "mechanism: .*NoneType"),
        ("gough-stuart", "x", "gough-stewart"),
        ("gough-stewart", 3, "path: expected (a folder|the path of a file or folder), got 3"),
        ("gough-stewart", "taken", "taken: cannot be made a folder"),
    ],
)
def test_what_does_not(
    door: Callable[..., Any], model: Any, path: Any, said: str, tmp_path: Path
) -> None:
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(condyle.InputError, match=said):
        door(model, tmp_path / path if isinstance(path, str) else path)
    assert [one.name for one in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize(
    "name, options, said",
    [
        ("c", {"question": 3}, "question: expected a name or several, got 3"),
        ("c", {"coordinates": [1]}, "coordinates: expected a name or several"),
        ("c", {"prefix": 3}, "prefix"),
        ("c", {"lanes": "8"}, "lanes"),
        ("c", {"precision": 2}, "precision"),
        ("c", {"landmark": 5}, "landmark"),
        ("c", {"route": 1}, "route"),
        ("c", {"formulation": 1}, "formulation"),
        ("fmu", {"kind": 2}, "kind: expected a name or several"),
        ("fmu", {"fmi": "3"}, "fmi: expected 2 or 3"),
        ("matlab", {"question": {"motion": 1}}, "question: expected"),
    ],
)
def test_options_of_wrong_kinds(
    name: str, options: dict[str, Any], said: str, tmp_path: Path
) -> None:
    with pytest.raises(condyle.CondyleError, match=said):
        DOORS[name][0]("masticatory", tmp_path, **options)
