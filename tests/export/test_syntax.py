"""Hostile names: in no language that is exported does one say anything.

Each function by another reader of its language; and whole exports, whose code without comments and
words in quotes is that of a mechanism with plain names.
"""

from __future__ import annotations

import ast
import random
import re
import subprocess
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
import yaml
from pydantic import TypeAdapter, ValidationError
from support.tools import need, run

import condyle
from condyle.export import c_package, export, fmu
from condyle.export.syntax import (
    c_comment,
    c_format,
    c_string,
    filled,
    identifier,
    identifiers,
    line_comment,
    markdown,
    matlab_string,
    python_string,
    xml_comment,
    xml_text,
)
from condyle.mechanism.quantities import Name

_TEXT = r"""
*/ /* // \ \n \N \N{ \u12 \x ' ''' %d %s %% %{ ??/ ??= ? -- - ---> <!-- --> ]]> <![CDATA[ </body>
<include file='../other.xml'/> & &lt; &#10; < > # $(id) ${PATH} `id` | @name@ @prefix@ @keep@
@gains@ @source@ @ {{ }} {% { } [ ] ( ) ... : - : ! * _ ~ ^ = é ß 咬肌 𝛼 int if main fmu model mex
math base load platform 2nd NUL
"""
PARTS = _TEXT.split()
ALONE = ["m---><include file='../other.xml'/>", "a\\", "x\\N", "@gains@", "/*/", "Int", "--", "-"]
LAW = {"kind": "joint_pd", "stiffness": 5.0, "damping": 0.1, "rate": 500.0}
SCENARIO: dict[str, Any] = {"duration": 0.02, "controller": LAW, "sensors": {}}


def hostile_names(count: int = 300) -> list[str]:
    """Names that a mechanism file may have, no two alike."""
    rng, check, found = random.Random(41), TypeAdapter(Name), dict.fromkeys(ALONE)
    while len(found) < count:
        name = rng.choice(("", " ")).join(rng.choices(PARTS, k=rng.randint(1, 6)))
        try:
            found[check.validate_python(name)] = None
        except ValidationError:
            continue
    return list(found)


NAMES = hostile_names()


def test_c_and_markdown(tmp_path: Path) -> None:
    """A compiler drops the comments, and prints each name as it is; identifiers are those of C."""
    rows = [f'/* {c_comment(n)} */ // "{c_comment(n)}"\n    puts("{c_string(n)}");' for n in NAMES]
    rows += [f'printf("{c_format(n)}\\n");' for n in NAMES]
    words = identifiers(NAMES)
    assert len({word.lower() for word in words.values()}) == len(NAMES)
    rows += [f"int {word} = 0; (void){word};" for word in words.values()]
    text = "\n".join(["#include <stdio.h>", "int main(void) {", *rows, "return 0; }"])
    (tmp_path / "names.c").write_text(text, encoding="utf-8")
    flags = ("-Wall", "-Wextra", "-Werror", "-Wno-misleading-indentation", "-O0")
    run("gcc", "-std=c99", "-Wno-comment", *flags, "names.c", "-o", "names", folder=tmp_path)
    assert run("./names", folder=tmp_path).splitlines() == NAMES * 2
    for name in NAMES:
        assert re.sub(r"\\([\\`*_\[\]<>|&!])", r"\1", markdown(name)) == name
        assert not re.search(r"(?<!\\)(\\\\)*[<>`|\[]", markdown(name))


def test_xml_yaml_and_python() -> None:
    for name in NAMES:
        root = ElementTree.fromstring(
            f'<r a="{xml_text(name)}"><!-- {xml_comment(name)} --><b>{xml_text(name)}</b></r>',
            ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)),
        )
        comment, (b,) = root[0], root[1:]
        assert root.get("a") == b.text == name and len(root) == 2 and not len(b)
        assert (comment.text or "").replace(" ", "") == name.replace(" ", "")
        assert ast.literal_eval(f'"""{python_string(name)}"""') == name
        assert yaml.safe_load(f'# "{line_comment(name)}"\na: 1') == {"a": 1}
        assert filled("@a@ @b@", {"a": name, "b": name}) == f"{name} {name}"
    assert line_comment("a\n# b\r") == "a # b "


def test_matlab(tmp_path: Path) -> None:
    need("octave-cli")
    rows = [f"x{{end + 1}} = '{matlab_string(name)}'; % {line_comment(name)}" for name in NAMES]
    rows += ["fid = fopen('out', 'w'); fprintf(fid, '%s\\n', x{:}); fclose(fid);"]
    (tmp_path / "names.m").write_text("\n".join(["x = {};", *rows, ""]), encoding="utf-8")
    run("octave-cli", "--quiet", "--no-init-file", "names.m", folder=tmp_path)
    out = (tmp_path / "out").read_text(encoding="utf-8").splitlines()
    assert [re.sub(r"\\([\\_^{}])", r"\1", line) for line in out] == NAMES


def renamed(names: list[str]) -> condyle.Mechanism:
    """The reference mechanism with ten names in turn: its own, chains', contacts', a landmark's."""
    machine = condyle.load_mechanism("masticatory")
    own, mark, *rest = names
    chains = [c.model_copy(update={"name": n}) for c, n in zip(machine.chains, rest, strict=False)]
    contacts = [
        c.model_copy(update={"name": n}) for c, n in zip(machine.contacts, rest[6:], strict=False)
    ]
    points = {mark: machine.platform.points["incisor"]}
    platform = machine.platform.model_copy(update={"points": points})
    return machine.replace(name=own, chains=chains, contacts=contacts, platform=platform)


def written(machine: condyle.Mechanism, folder: Path) -> dict[str, str]:
    """All targets of a mechanism: files by name, without what depends on names as it should."""
    mark = next(iter(machine.platform.points))
    condyle.export_c(
        machine, folder / "c", question=["pose", "closure"], landmark=mark, lanes=0, prefix="jaw"
    )
    condyle.export_c(machine, folder / "s", question="motion", constants="struct", prefix="jaw")
    condyle.export_matlab(machine, folder / "matlab", question=["inverse", "forward"])
    condyle.export_acados(machine, folder / "acados", prefix="jaw")
    condyle.export_controller(machine, SCENARIO, folder / "controller", prefix="jaw")
    condyle.export_ros2(
        machine, SCENARIO, folder / "ros2", prefix="jaw", package="jaw_ros2", solver=True
    )
    condyle.export_mjcf(machine, folder / "model.xml")
    unit = fmu.fmu_model(machine, "joints")
    texts = fmu.fmu_sources(unit, 3) | {"fmu.xml": fmu.description(unit, 3)}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    stem = export(machine, ("motion",)).prefix
    return {
        re.sub(rf"(^|/){stem}", r"\1stem", str(file.relative_to(folder))): file.read_text("utf-8")
        for file in sorted(folder.rglob("*.*"))
        if file.is_file() and file.name != "FACTS.md"
    }


def skeleton(file: str, text: str, stem: str) -> object:
    """What a file says to a reader of its language, but for names."""
    kind = file.rpartition(".")[2]
    if kind in ("xml", "urdf"):
        tree = ElementTree.fromstring(text)
        return [(e.tag, *sorted(e.attrib)) for e in tree.iter()]
    if kind == "yaml":
        return yaml.safe_load(text)
    if kind == "py":
        for node in ast.walk(tree := ast.parse(text)):
            for one in getattr(node, "body", []) if not isinstance(node, ast.Lambda) else []:
                if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant):
                    one.value.value = ""
        return ast.dump(tree)
    if kind == "m":
        text = re.sub("%.*", "", text)
    elif kind in ("c", "h", "cpp", "hpp"):
        done = subprocess.run(
            ["gcc", "-fpreprocessed", "-dD", "-E", "-P", "-x", "c++", "-"],
            input=text, capture_output=True, text=True, check=True,
        )  # fmt: skip
        text = re.sub(r'"(\\.|[^"\\])*"', '""', done.stdout)
        text = re.sub(r"\b(\w+_)?(CHAIN|CONTACT)_\w+", "INDEX", text)
        text = re.sub(r"(?<=[&{ ])n\.\w+\[\d\]", "PLACE", text)
    elif kind == "md":
        return None
    return re.sub(rf"(?i)\b{stem}(?=[_.])", "stem", re.sub(r"\s+", " ", text))


@pytest.mark.slow
@pytest.mark.parametrize("first", [0, *(pytest.param(i, marks=pytest.mark.ci) for i in (1, 2, 3))])
def test_every_target(first: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need("gcc")
    monkeypatch.setattr(c_package, "write_facts", lambda *of: ({}, []))
    monkeypatch.setattr("condyle.export.mjcf._home", lambda document: None)
    plain = [f"plain{i}" for i in range(10)]
    hostile = NAMES[10 * first : 10 * first + 10]
    found = {}
    for where, names in (("plain", plain), ("hostile", hostile)):
        texts = written(machine := renamed(names), tmp_path / where)
        stem = export(machine, ("motion",)).prefix
        found[where] = {f: skeleton(f, text, stem) for f, text in texts.items()}
    assert found["plain"].keys() == found["hostile"].keys()
    for file, right in found["plain"].items():
        assert found["hostile"][file] == right, (file, hostile)


def test_names_that_files_and_programs_have() -> None:
    """A mechanism's name is never one of theirs, nor too long for what begins with it."""
    machine = condyle.load_mechanism("gough-stewart")
    for name in ("fmu", "model", "mex", "Math", "INT", "main", "x" * 80, "咬肌"):
        own = export(machine.replace(name=name), ("motion",), lanes=0).prefix
        assert re.fullmatch("[a-z][a-z_]{0,39}", own) and own not in (name.lower(), "int", "main")
    assert identifier("-") == "x" and identifiers(["base"], ["Base"]) == {"base": "base_2"}
