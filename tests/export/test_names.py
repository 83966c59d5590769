"""Names, order, options and refusals."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.tools import need, run

import condyle
from condyle.cli import completion
from condyle.errors import InputError, UnsupportedError
from condyle.export import CATALOGUE, export
from condyle.export.c_names import identifier, identifiers, picked, require_prefix
from condyle.mechanism.contact import Friction
from condyle.mechanism.surface.plane import Plane
from condyle.questions.law import CONTROLLERS


@pytest.mark.parametrize(
    "name, wanted",
    [("left", "left"), ("left-1", "left_1"), ("2nd", "n2nd"), ("int", "int_"), ("class", "class_")],
)
def test_identifiers(name: str, wanted: str) -> None:
    assert identifier(name) == wanted


def test_no_two_names_meet() -> None:
    found = identifiers(["a-b", "a_b", "A_B", "a_b_2"])
    assert len({name.lower() for name in found.values()}) == 4


@pytest.mark.parametrize("prefix", ["", "1a", "a-b", "int", "x" * 41, "a b", "é", "main", "Check"])
def test_prefixes_that_c_does_not_take(prefix: str) -> None:
    with pytest.raises(InputError, match="prefix"):
        require_prefix(prefix)


def test_names_that_change_are_listed() -> None:
    machine = condyle.load_mechanism("masticatory")
    chains = [c.model_copy(update={"name": f"chain-{i}"}) for i, c in enumerate(machine.chains)]
    renamed = machine.model_copy(update={"chains": tuple(chains), "name": "3-jaw"})
    e = export(renamed, ("motion",))
    assert e.prefix == "n3_jaw" and e.names["chain-4"] == "chain_4"
    assert "chain-4 is chain_4" in e.header and "N3_JAW_CHAIN_chain_4 = 4" in e.header


def test_every_argument_is_documented() -> None:
    e = export(condyle.load_mechanism("masticatory"), ("motion", "pose"))
    for f in e.functions:
        for a in f.arguments:
            assert f"{a.name}[{a.size}]  {'in' if a.given else 'out'}: {a.text} [" in e.header
            assert a.size == len(a.units) == len(a.labels)
    assert e["pose"].inputs[0].labels == tuple(
        c.name for c in condyle.load_mechanism("masticatory").chains
    )
    assert e.prototype(e["pose"]).startswith("int masticatory_pose(const double joint[6], ")


@pytest.mark.parametrize(
    "options, said",
    [
        ({"questions": ("invers",)}, "inverse"),
        ({"questions": ()}, "no question"),
        ({"precision": "half"}, "precision"),
        ({"constants": "outside"}, "struct"),
        ({"lanes": 3}, "lanes"),
        ({"questions": ("bounded",), "precision": "float"}, "in double"),
        ({"questions": ("closure",)}, "degrees of freedom"),
        ({"questions": ("closure",), "landmark": "nose"}, "landmark"),
    ],
)
def test_refusals_say_what_is_wrong(options: dict[str, Any], said: str) -> None:
    refusal = UnsupportedError if said == "in double" else InputError
    with pytest.raises(refusal, match=said):
        export(condyle.load_mechanism("masticatory"), **{"questions": ("motion",), **options})


@pytest.mark.parametrize("question", ["inverse", "bounded"])
def test_friction_at_many_contacts_has_no_closed_form(question: str) -> None:
    machine = condyle.load_mechanism("masticatory")
    rough = [c.model_copy(update={"friction": Friction(coefficient=0.1)}) for c in machine.contacts]
    flat = Plane(kind="plane", slope=(0.0, 0.0), offset=0.0)
    other = {"name": "third", "point": (0.05, 0.0, 0.0), "surface": flat}
    many = machine.model_copy(update={"contacts": (*rough, rough[0].model_copy(update=other))})
    with pytest.raises(UnsupportedError, match="at most 2"):
        export(many, (question,))


def test_the_command(condyle_command: Any, tmp_path: Path) -> None:
    done = condyle_command(
        "export", "c", "gough-stewart", "--question", "motion", "--out", "x", "--json"
    )
    assert done.status == 0, done.err
    told = json.loads(done.out)
    assert told["functions"] == ["gough_stewart_motion"]
    assert {Path(f).name for f in told["files"]} == {f.name for f in (tmp_path / "x").iterdir()}
    refused = condyle_command("export", "c", "gough-stewart", "--prefix", "a-b", "--out", "y")
    assert refused.status == 2 and "prefix" in refused.err and not (tmp_path / "y").exists()


def test_completion_knows_every_question() -> None:
    assert {*CATALOGUE, *CONTROLLERS} - {"none"} == set(completion.EXPORTS)


def test_only_what_is_used_is_taken() -> None:
    text = (
        "static int b(void) { return 1; }\n\n/* A. */\nstatic int a(void) {\n    return b();\n}\n"
    )
    assert picked(text, "x = b();") == "static int b(void) { return 1; }\n"
    assert "/* A. */" in picked(text, "x = a();") and "int b(" in picked(text, "x = a();")
    assert picked(text, "x").strip() == ""


def test_names_that_look_like_c_are_only_words(
    condyle_command: Callable[..., Any], tmp_path: Path
) -> None:
    """What ends a comment or begins a format elsewhere does nothing here."""
    need("gcc", "make")
    machine = condyle.load_mechanism("gough-stewart").set({"name": "a */ int x /* b"})
    machine = machine.set({f"chain.{machine.chain_names[0]}.name": "50 % ?? \\ leg */"})
    condyle.dump(machine, tmp_path / "odd.toml")
    done = condyle_command("export", "c", "odd.toml", "--question", "inverse", "--out", "odd")
    assert done.status == 0, done.err
    for what in ("check", "example"):
        told = run("make", "-s", what, "CC=gcc -Werror", folder=tmp_path / "odd")
        assert what == "example" or ": ok" in told
    assert "effort 50 % ?? \\ leg */: " in run("./example", folder=tmp_path / "odd")
