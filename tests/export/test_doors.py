"""Every export has one shape: a model, a path, options as keywords; the files that were written.

And what all of them refuse, and the names in C.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.tools import need, run

import condyle
from condyle.cli import completion
from condyle.errors import CondyleError, InputError, UnsupportedError
from condyle.export import CATALOGUE, acados, c_package, export, fmu
from condyle.export.c_names import picked, require_prefix
from condyle.export.syntax import identifier, identifiers
from condyle.mechanism.contact import Friction
from condyle.mechanism.surface.plane import Plane
from condyle.questions.law import CONTROLLERS

DOORS: dict[str, tuple[Callable[..., Any], dict[str, Any]]] = {
    "c": (condyle.export_c, {"question": "motion", "lanes": 0}),
    "fmu": (condyle.export_fmu, {"kind": "inverse"}),
    "acados": (condyle.export_acados, {"step": 0.01}),
    "matlab": (condyle.export_matlab, {"question": ["motion"]}),
    "mjcf": (condyle.export_mjcf, {}),
}
STANDS_FOR_NONE = [
    (3, "x", "mechanism: expected a mechanism, a model, .*got int"),
    (None, "x", "mechanism: .*NoneType"),
    ("gough-stuart", "x", "gough-stewart"),
    ("gough-stewart", 3, "path: expected (a folder|the path of a file or folder), got 3"),
    ("gough-stewart", "taken", "taken: cannot be made a folder"),
]


@pytest.mark.parametrize("name", DOORS)
def test_what_stands_for_a_mechanism(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A name, a mechanism, a file as text and as a path, a model: the same files."""
    monkeypatch.setattr(fmu, "_built", lambda sources: b"")  # which takes seconds
    monkeypatch.setattr("condyle.export.mjcf._home", lambda document: None)
    monkeypatch.setattr(c_package, "write_facts", lambda *of: ({}, []))
    (door, options), made = DOORS[name], acados.export

    def known(*of: Any, **more: Any) -> Any:  # once: what is derived of a step takes seconds, too
        kept.append(kept[0] if kept else made(*of, **more))
        return kept[-1]

    kept: list[Any] = []
    monkeypatch.setattr(acados, "export", known)
    mechanism = condyle.load_mechanism("gough-stewart")
    condyle.dump(mechanism, file := tmp_path / "robot.toml")
    model = condyle.derive(mechanism, backend="numpy")
    texts = []
    for k, given in enumerate(("gough-stewart", mechanism, str(file), file, model)):
        files = door(given, tmp_path / f"{k}" / "deep", **options)
        there = [path for path in files if path.name != "FACTS.md"]
        assert isinstance(files, list) and all(path.is_file() for path in there)
        assert files.data["mechanism"] == "gough-stewart"
        texts.append({path.name: path.read_bytes() for path in there})
    assert all(one == texts[0] for one in texts)
    for k, (model, path, said) in enumerate(STANDS_FOR_NONE):
        (place := tmp_path / f"none {k}").mkdir()
        (place / "taken").write_text("a file")
        with pytest.raises(condyle.InputError, match=said):
            door(model, place / path if isinstance(path, str) else path, **options)
        assert [one.name for one in place.iterdir()] == ["taken"]


@pytest.mark.parametrize(
    "name, options, said",
    [
        ("c", {"question": 3}, "question: expected a name or several, got 3"),
        ("c", {"coordinates": [1]}, "coordinates: expected a name or several"),
        ("c", {"prefix": 3}, "prefix"),
        ("c", {"lanes": "8"}, "lanes"),
        ("c", {"lanes": 3}, "lanes"),
        ("c", {"precision": 2}, "precision"),
        ("c", {"precision": "half"}, "precision"),
        ("c", {"landmark": 5}, "landmark"),
        ("c", {"route": 1}, "route"),
        ("c", {"formulation": 1}, "formulation"),
        ("c", {"question": "invers"}, "inverse"),
        ("c", {"question": ()}, "no question"),
        ("c", {"constants": "outside"}, "struct"),
        ("c", {"question": "bounded", "precision": "float"}, "in double"),
        ("c", {"question": "closure"}, "degrees of freedom"),
        ("c", {"question": "closure", "landmark": "nose"}, "landmark"),
        ("c", {"question": "inverse", "inputs": "wind"}, "expected gravity or base"),
        ("c", {"question": "pose", "inputs": "base"}, "none of pose has gravity or inertia"),
        ("c", {"question": "inverse", "outputs": "share"}, "expected bound"),
        ("c", {"question": "pose", "outputs": "bound"}, "none of pose has a bound"),
        ("fmu", {"kind": 2}, "kind: expected a name or several"),
        ("fmu", {"fmi": "3"}, "fmi: expected 2 or 3"),
        ("fmu", {"fmi": 1}, "fmi: expected 2 or 3, got 1"),
        ("fmu", {"kind": "plants"}, "Did you mean"),
        ("matlab", {"question": {"motion": 1}}, "question: expected"),
        ("matlab", {"question": "invers"}, "inverse"),
        *(("acados", {"step": x}, "step") for x in (0.0, -1.0, float("nan"), "fast", True)),
    ],
)
def test_options_that_there_are_not(
    name: str, options: dict[str, Any], said: str, tmp_path: Path
) -> None:
    refusal = UnsupportedError if said == "in double" else CondyleError
    with pytest.raises(refusal, match=said):
        DOORS[name][0]("masticatory", tmp_path, **DOORS[name][1] | options)
    assert not any(tmp_path.iterdir())


def test_friction_at_many_contacts_has_no_closed_form() -> None:
    machine = condyle.load_mechanism("masticatory")
    rough = [c.model_copy(update={"friction": Friction(coefficient=0.1)}) for c in machine.contacts]
    flat = Plane(kind="plane", slope=(0.0, 0.0), offset=0.0)
    other = {"name": "third", "point": (0.05, 0.0, 0.0), "surface": flat}
    many = machine.model_copy(update={"contacts": (*rough, rough[0].model_copy(update=other))})
    for question in ("inverse", "bounded"):
        with pytest.raises(UnsupportedError, match="at most 2"):
            export(many, (question,))


def test_names_in_c() -> None:
    """They are identifiers, and no two meet; prefixes are refused; and the header says it all."""
    given = {"left": "left", "left-1": "left_1", "2nd": "n2nd", "int": "int_", "class": "class_"}
    assert {name: identifier(name) for name in given} == given
    found = identifiers(["a-b", "a_b", "A_B", "a_b_2"])
    assert len({name.lower() for name in found.values()}) == 4
    for prefix in ("", "1a", "a-b", "int", "x" * 41, "a b", "é", "main", "Check"):
        with pytest.raises(InputError, match="prefix"):
            require_prefix(prefix)
    machine = condyle.load_mechanism("masticatory")
    chains = [c.model_copy(update={"name": f"chain-{i}"}) for i, c in enumerate(machine.chains)]
    renamed = machine.model_copy(update={"chains": tuple(chains), "name": "3-jaw"})
    e = export(renamed, ("motion", "pose"))
    assert e.prefix == "n3_jaw" and e.names["chain-4"] == "chain_4"
    assert "chain-4 is chain_4" in e.header and "N3_JAW_CHAIN_chain_4 = 4" in e.header
    for f in e.functions:
        for a in f.arguments:
            assert f"{a.name}[{a.size}]  {'in' if a.given else 'out'}: {a.text} [" in e.header
            assert a.size == len(a.units) == len(a.labels)
    assert e["pose"].inputs[0].labels == renamed.chain_names
    assert e.prototype(e["pose"]).startswith("int n3_jaw_pose(const double joint[6], ")
    text = (
        "static int b(void) { return 1; }\n\n/* A. */\nstatic int a(void) {\n    return b();\n}\n"
    )
    assert picked(text, "x = b();") == "static int b(void) { return 1; }\n"
    assert "/* A. */" in picked(text, "x = a();") and "int b(" in picked(text, "x = a();")
    assert picked(text, "x").strip() == ""


def test_the_command_and_names_that_look_like_c(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    """What ends a comment or begins a format elsewhere does nothing here."""
    assert {*CATALOGUE, *CONTROLLERS} - {"none"} == set(completion.listed("question"))
    need("gcc", "make")
    machine = condyle.load_mechanism("gough-stewart").set({"name": "a */ int x /* b"})
    machine = machine.set({f"chain.{machine.chain_names[0]}.name": "50 % ?? \\ leg */"})
    condyle.dump(machine, tmp_path / "odd.toml")
    asked = ("export", "c", "odd.toml", "--question", "inverse", "--out", "odd")
    done = condyle_command(*asked, "--json")
    assert done.status == 0, done.err
    told = json.loads(done.out)
    assert {Path(f).name for f in told["files"]} == {f.name for f in (tmp_path / "odd").iterdir()}
    for what in ("check", "example"):
        told = run("make", "-s", what, "CC=gcc -Werror", "CFLAGS=-O0", folder=tmp_path / "odd")
        assert what == "example" or ": ok" in told
    assert "effort 50 % ?? \\ leg */: " in run("./example", folder=tmp_path / "odd")
    refused = condyle_command(*asked[:-1], "y", "--prefix", "a-b")
    assert refused.status == 2 and "prefix" in refused.err and not (tmp_path / "y").exists()
