"""What the cache keeps, finds, refuses and clears. Its libraries are a few bytes, never loaded."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs
import pytest
from support.cases import case

import condyle
from condyle import questions
from condyle.backends import cache, compiler
from condyle.backends.c import build
from condyle.backends.c.build import _index_key
from condyle.backends.compiler import Compiler, find_compiler
from condyle.dynamics import FORMULATIONS
from condyle.dynamics.momentum import Momentum
from condyle.errors import CondyleError
from condyle.questions import Question
from condyle.questions.structure import structure_of

RECIPE, OTHER = cache.digest("one"), cache.digest("other")
BYTES = b"a library"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_apart", {})
    return tmp_path / "cache"


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where kernels of one process go."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    return tmp_path / "tmp"


class Maker:
    """Stands for a compiler; fails where a place is not to its taste."""

    def __init__(self, fails: Callable[[Path], Exception | None] = lambda place: None) -> None:
        self.fails, self.calls = fails, 0

    def __call__(self, place: Path) -> tuple[Path, dict[str, Any]]:
        self.calls += 1
        (place / "kernel.c").write_text("source")
        library = place / "kernel.so"
        library.write_bytes(BYTES)
        if error := self.fails(place):
            raise error
        return library, {"flags": ["-O2"]}


def quiet(text: str, about: str) -> None:
    raise AssertionError(f"nothing should be said: {text}")


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def kept() -> cache.Entry:
    return cache.build(RECIPE, Maker(), quiet)


# -- what is found ----------------------------------------------------------------------------


def test_what_was_built_is_found(folder: Path) -> None:
    assert cache.find(RECIPE) is None and not folder.exists()
    built = kept()
    found = cache.find(RECIPE)
    assert found == dataclasses.replace(built, cached=True) and not built.cached
    assert found.library.read_bytes() == BYTES and found.facts["flags"] == ["-O2"]
    assert cache.find(OTHER) is None
    assert names(folder) == sorted([f"{RECIPE}.json", found.library.name])
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


SPOILED: dict[str, Callable[[Path], Any]] = {
    "truncated": lambda path: path.write_bytes(BYTES[:-1]),
    "emptied": lambda path: path.write_bytes(b""),
    "one bit": lambda path: path.write_bytes(b"A" + BYTES[1:]),
    "longer": lambda path: path.write_bytes(BYTES + b"\0"),
    "removed": Path.unlink,
    "a folder": lambda path: (path.unlink(), path.mkdir()),
    "a dead link": lambda path: (path.unlink(), path.symlink_to("nowhere")),
}


@pytest.mark.parametrize("how", SPOILED)
def test_a_library_that_is_not_the_one_built(folder: Path, how: str) -> None:
    library = kept().library
    SPOILED[how](library)
    assert cache.find(RECIPE) is None
    assert cache.contents().kernels == 0
    if library.is_dir():
        library.rmdir()
    kept()
    assert cache.find(RECIPE).library.read_bytes() == BYTES


def other_library(text: str) -> str:
    """A manifest that names a library of someone else's, by its right hash."""
    made = json.loads(text)
    made["facts"]["library"] = f"{OTHER}-{made['facts']['sha256'][:16]}.so"
    return json.dumps(made)


MANIFESTS: dict[str, Callable[[str], str | bytes]] = {
    "empty": lambda text: "",
    "truncated": lambda text: text[:-1],
    "no text": lambda text: b"\xff\xfe\0",
    "a list": lambda text: "[1, 2]",
    "nested too deeply": lambda text: "[" * 100_000,
    "null": lambda text: "null",
    "no facts": lambda text: "{}",
    "facts of no kind": lambda text: '{"seal": "", "facts": "x"}',
    "library of no kind": lambda text: '{"seal": "", "facts": {"library": 5}}',
    "other facts": lambda text: text.replace("-O2", "-O3"),
    "other library": other_library,
    "of another recipe": lambda text: text,
}


@pytest.mark.parametrize("how", MANIFESTS)
def test_a_manifest_that_is_not_the_one_written(folder: Path, how: str) -> None:
    cache.build(OTHER, Maker(), quiet)
    text = (folder / f"{OTHER}.json").read_text()
    if how != "of another recipe":
        kept()
        text = (folder / f"{RECIPE}.json").read_text()
    made = MANIFESTS[how](text)
    data = made if isinstance(made, bytes) else made.encode()
    (folder / f"{RECIPE}.json").write_bytes(data)
    assert cache.find(RECIPE) is None and cache.find(OTHER) is not None
    assert cache.contents().kernels == 1
    kept()
    assert cache.find(RECIPE) is not None and cache.contents().kernels == 2
    assert len(names(folder)) == 4


def test_a_folder_that_others_can_write_is_not_looked_at(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()
    for mode in (0o720, 0o702):
        folder.chmod(mode)
        assert cache.find(RECIPE) is None
    folder.chmod(0o755)
    assert cache.find(RECIPE) is not None
    monkeypatch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
    assert cache.find(RECIPE) is None


# -- recipes ----------------------------------------------------------------------------------


def test_parts_of_a_recipe_stand_apart() -> None:
    parts = [("ab", "c"), ("a", "bc"), ("abc",), ("abc", ""), ("", "abc"), ("c", "ab")]
    assert len({cache.digest(*p) for p in parts}) == len(parts)


def test_everything_that_matters_is_in_the_index_key(monkeypatch: pytest.MonkeyPatch) -> None:
    structure = structure_of(case("masticatory").mechanism)
    question = Question.about(structure, "inverse", ("contact",))
    tool = Compiler(("cc",), ("-O2",), "gcc 13 AVX2", 4)
    structures = [
        dataclasses.replace(structure, **change)
        for change in (
            {"formulation": "momentum"},
            {"route": "direct"},
            {"chains": (("PSS", 6),)},
            {"chains": (("RSS", 7),)},
            {"contacts": (("quadric", 10), ("plane", 5))},
            {"dependent": ("X", "gamma")},
            {"parallel": not structure.parallel},
            {"zeros": frozenset({(-1, 0)})},
            {"zeros": frozenset({(0, 0)})},
        )
    ]
    asked = [
        question,
        *(Question.about(s, "inverse", ("contact",)) for s in structures),
        Question.about(structure, "inverse", ()),
        Question.about(structure, "inverse", ("joint",)),
        Question.about(structure, "matrices"),
        Question.about(structure, "motion"),
        *(Question.about(structure, "closure", n) for n in ((), ("X", "Y"))),
    ]
    tools = [
        dataclasses.replace(tool, **change)
        for change in (
            {"command": ("gcc",)},
            {"command": ("cc", "-m32")},
            {"flags": ("-O3",)},
            {"flags": ("-O2", "-march=native")},
            {"identity": "gcc 14 AVX2"},
            {"identity": "gcc 13 AVX512"},
            {"lanes": 8},
        )
    ]
    keys = [_index_key(q.key, tool) for q in asked] + [_index_key(question.key, t) for t in tools]
    with monkeypatch.context() as patch:
        patch.setattr(questions, "_casadi", lambda: "0.0")
        keys.append(_index_key(question.key, tool))
        patch.setattr(questions, "_sources", lambda: "other sources")
        keys.append(_index_key(question.key, tool))
        patch.setattr(build, "_generator", lambda: "another generator")
        keys.append(_index_key(question.key, tool))
    assert len(set(keys)) == len(keys)
    again = Question.about(dataclasses.replace(structure), "inverse", ("contact",))
    assert _index_key(again.key, dataclasses.replace(tool)) == keys[0]


def test_a_key_leads_to_a_recipe(folder: Path) -> None:
    """Only as it was written down, and only while the folder can be trusted."""
    cache.index(OTHER, RECIPE)
    assert cache.indexed(OTHER) is None and not folder.exists()
    kept()
    cache.index(OTHER, RECIPE)
    assert cache.indexed(OTHER) == RECIPE and cache.indexed(RECIPE) is None
    (folder / f"{OTHER}.index").write_text(f"{OTHER} {cache.digest(OTHER, RECIPE)}")
    assert cache.indexed(OTHER) is None
    (folder / f"{OTHER}.index").write_bytes(b"\xff")
    assert cache.indexed(OTHER) is None
    cache.index(OTHER, RECIPE)
    folder.chmod(0o777)
    assert cache.indexed(OTHER) is None
    folder.chmod(0o700)
    cache.clear()
    assert names(folder) == []


@pytest.mark.usefixtures("compiler_command")
def test_the_same_equations_are_built_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Other sources of the same graph build nothing; another body of a user's class does."""

    def kernel(formulation: str = "virtual_power") -> Any:
        model = condyle.derive("gough-stewart", formulation=formulation, backend="compiled")
        return model.kernel("inverse", ())

    assert not kernel().cached and kernel().cached
    with monkeypatch.context() as patch:
        patch.setattr(questions, "_sources", lambda: "a docstring")
        assert kernel().cached
        patch.setattr(build, "emit", None)  # the index leads there
        assert kernel().cached
    efforts = []
    for drag in (0.5, 0.5, 0.7):

        class Viscous(Momentum):
            name = "viscous"

            def platform(self, state: Any, body: Any, g: Any, drag: float = drag) -> Any:
                return super().platform(state, body, g) + drag * state.rate

        monkeypatch.setitem(FORMULATIONS, "viscous", Viscous())
        own = kernel("viscous")
        values = own.run(case("gough-stewart").inputs).values["effort"]
        efforts.append((own.cached, np.abs(values).sum()))
    (first, a), (second, b), (third, c) = efforts
    assert (first, second, third) == (False, True, False) and a == b != c


def test_formulation_and_route_make_no_difference_to_geometry() -> None:
    mechanism = case("masticatory").mechanism
    for name in questions.GEOMETRY:
        keys = {
            Question.about(structure_of(mechanism, *choice), name).key
            for choice in (("virtual_power", "core"), ("momentum", "direct"))
        }
        assert len(keys) == 1


def test_what_is_known_of_a_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its place, version and instruction sets; the lanes go by these or by `CONDYLE_LANES`."""

    def found(macros: str, lanes: str = "") -> Compiler:
        command = tmp_path / cache.digest(macros, lanes)
        command.write_text(f"#!/bin/sh\nprintf '%s\\n' {macros}\n")
        command.chmod(0o755)
        monkeypatch.setenv("CC", str(command))
        monkeypatch.setenv("CONDYLE_LANES", lanes)
        return find_compiler()

    version = "__VERSION__=1"
    assert found(version).lanes == 2
    assert found(f"{version} __AVX2__").lanes == 4
    assert found(f"{version} __AVX2__ __AVX512F__").lanes == 8
    assert found(f"{version} __AVX2__ __AVX512F__", "2").lanes == 2
    assert "__VERSION__=7" in found("__VERSION__=7").identity
    assert str(tmp_path) in found(version).identity
    with pytest.raises(compiler.CompilerError, match=r"CONDYLE_LANES is '3'; expected 2, 4 or 8"):
        found(version, "3")


# -- where nothing can be kept ----------------------------------------------------------------


def full(*arguments: object, **options: object) -> Any:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def check_apart(folder: Path, temporary: Path, maker: Maker, why: str) -> None:
    """Built for this process alone, said in one notice, found again by this process only."""
    said: list[tuple[str, str]] = []
    entry = cache.build(RECIPE, maker, lambda *words: said.append(words))
    assert entry.library.read_bytes() == BYTES and temporary in entry.library.parents
    assert cache.find(RECIPE) == entry
    [(text, about)] = said
    assert about == "cache" and f"({why})" in text and str(folder) in text
    assert "this process alone" in text and "CONDYLE_CACHE" in text
    if folder.is_dir():
        assert names(folder) == []


def test_a_full_disk_while_compiling(folder: Path, temporary: Path) -> None:
    maker = Maker(lambda place: OSError(errno.ENOSPC, "full") if folder in place.parents else None)
    check_apart(folder, temporary, maker, "full")


@pytest.mark.parametrize("step", ["mkdtemp", "write_text", "replace"])
def test_a_full_disk_while_keeping(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    """When the place is made, when the manifest is written, when the library is moved."""
    owner = {"mkdtemp": tempfile, "write_text": Path, "replace": os}[step]
    real = getattr(owner, step)

    def spoiled(*arguments: Any, **options: Any) -> Any:
        words = [str(x) for x in (*arguments, *options.values())]
        ours = any(w == str(folder) or w.endswith(("manifest.json", ".so")) for w in words)
        return (full if ours else real)(*arguments, **options)

    monkeypatch.setattr(owner, step, spoiled)
    check_apart(folder, temporary, Maker(), os.strerror(errno.ENOSPC))


def test_a_full_disk_that_fails_the_compiler(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "TemporaryFile", full)
    maker = Maker(lambda place: CondyleError("ld\nmore") if folder in place.parents else None)
    check_apart(folder, temporary, maker, "ld")


def test_a_compiler_that_fails_by_itself_is_not_asked_twice(folder: Path, temporary: Path) -> None:
    maker = Maker(lambda place: CondyleError("wrong"))
    with pytest.raises(CondyleError, match="wrong"):
        cache.build(RECIPE, maker, quiet)
    assert maker.calls == 1 and names(folder) == names(temporary) == []


def test_no_folder(folder: Path, temporary: Path) -> None:
    folder.write_text("a file")
    check_apart(folder, temporary, Maker(), os.strerror(errno.EEXIST))
    assert folder.read_text() == "a file"
    assert cache.contents() == cache.clear() == cache.Contents(folder, 0, 0)


def test_no_folder_above(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    below = tmp_path / "file" / "cache"
    monkeypatch.setenv("CONDYLE_CACHE", str(below))
    check_apart(below, temporary, Maker(), os.strerror(errno.ENOTDIR))
    assert cache.contents() == cache.Contents(below, 0, 0)


def test_a_folder_of_others(folder: Path, temporary: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)
    check_apart(folder, temporary, Maker(), "it belongs to or can be written by others")


def test_no_home(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Then the user's folders are not resolved: no folder named ~ is made here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CONDYLE_CACHE")
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: f"~/.cache/{name}")
    check_apart(Path("~/.cache/condyle/kernels"), temporary, Maker(), "there is no home folder")
    assert not (tmp_path / "~").exists()


def test_a_folder_below_home(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CONDYLE_CACHE", "~/kernels")
    assert cache.cache_folder() == tmp_path / "kernels"
    monkeypatch.setenv("CONDYLE_CACHE", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert tmp_path in cache.cache_folder().parents


def test_no_place_at_all(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "mkdtemp", full)
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        cache.build(RECIPE, Maker(), quiet)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError(), ValueError("x")])
def test_a_build_that_stops_leaves_nothing(
    folder: Path, temporary: Path, error: BaseException
) -> None:
    maker = Maker(lambda place: error)
    for way in (lambda: cache.build(RECIPE, maker, quiet), lambda: cache.build_apart("x", maker)):
        with pytest.raises(type(error)):
            way()
    assert names(folder) == names(temporary) == []


# -- what killed builds leave -----------------------------------------------------------------


def leave_rubbish(folder: Path, hours: float = 0) -> list[Path]:
    """A half-built kernel, and one whose manifest was never written."""
    place = folder / f"{cache.BUILD}killed"
    place.mkdir(parents=True)
    folder.chmod(0o700)
    (place / "kernel.c").write_text("sour")
    library = folder / f"{OTHER}-{'0' * 16}.so"
    library.write_bytes(b"half")
    then = place.stat().st_mtime - hours * 3600
    os.utime(place, (then, then))
    return [place, library]


def test_the_next_build_clears_up(folder: Path) -> None:
    leave_rubbish(folder)
    kept()
    assert len(names(folder)) == 2 and cache.find(RECIPE) is not None


def test_a_library_whose_manifest_names_another_goes(folder: Path) -> None:
    """Two built one kernel, not the same to the byte: the manifest decides."""
    library = kept().library
    twin = library.with_name(f"{RECIPE}-{'0' * 16}.so")
    twin.write_bytes(b"twin")
    cache.build(OTHER, Maker(), quiet)
    assert not twin.exists() and library.exists() and len(names(folder)) == 4


def test_nobody_clears_up_while_others_build(folder: Path) -> None:
    """But what is older than any build goes."""
    folder.mkdir(mode=0o700)
    with cache._held(folder):
        fresh = leave_rubbish(folder)
        old = folder / f"{cache.BUILD}old"
        shutil.copytree(fresh[0], old)
        os.utime(old, (0, 0))
        kept()
        assert all(path.exists() for path in fresh) and not old.exists()
        assert cache.clear().kernels == 1
        assert fresh[0].exists() and cache.find(RECIPE) is None
    cache.clear()
    assert names(folder) == []


def test_clearing_does_not_disturb_builds(folder: Path) -> None:
    def clear(place: Path) -> None:
        cache.build(OTHER, Maker(), quiet)
        assert cache.clear().kernels == 1

    cache.build(RECIPE, Maker(clear), quiet)
    assert cache.find(RECIPE) is not None and cache.find(OTHER) is None


def test_a_file_system_without_locks(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then only age tells what is left over."""

    def no_lock(handle: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr(cache.fcntl, "flock", no_lock)
    place, library = leave_rubbish(folder)
    kept()
    assert place.exists() and library.exists() and cache.find(RECIPE) is not None
    os.utime(place, (0, 0))
    cache.build(OTHER, Maker(), quiet)
    assert not place.exists()


def test_a_system_without_locks(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "fcntl", None)
    leave_rubbish(folder, hours=2)
    kept()
    assert cache.find(RECIPE) is not None
    assert not any(name.startswith(cache.BUILD) for name in names(folder))


# -- condyle cache ----------------------------------------------------------------------------


def test_show_and_clear(condyle_command: Callable[..., Any], folder: Path) -> None:
    outcome = condyle_command("cache")
    assert outcome.status == 0
    assert outcome.out.splitlines()[0] == f"{folder}: 0 kernels, 0.0 MB"
    assert not folder.exists()
    kept()
    cache.build(OTHER, Maker(), quiet)
    (folder / "notes.txt").write_text("not ours")
    (folder / f"{OTHER}.json").write_text("broken")
    rubbish = leave_rubbish(folder.with_name("aside"))
    rubbish[0].rename(folder / rubbish[0].name)
    (folder / rubbish[0].name / "kernel.so").write_bytes(bytes(3_000_000))
    shown = condyle_command("cache")
    assert shown.status == 0 and f"{folder}: 1 kernel, 3.0 MB\n" in shown.out
    assert "condyle cache --clear" in shown.out
    cleared = condyle_command("cache", "--clear")
    assert cleared.status == 0
    assert cleared.out.splitlines()[0] == f"Removed 1 kernel, 3.0 MB from {folder}"
    assert names(folder) == ["notes.txt"]
    assert condyle_command("cache", "--clear").out.startswith("Removed 0 kernels, 0.0 MB")


def test_shown_while_others_build(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A workplace that goes while it is looked at is no error."""
    kept()
    real = Path.glob

    def gone(path: Path, pattern: str) -> Any:
        found = list(real(path, pattern))
        return [*found, folder / f"{cache.BUILD}gone"] if path == folder else found

    monkeypatch.setattr(Path, "glob", gone)
    monkeypatch.setattr(Path, "is_dir", lambda path: True)
    assert cache.contents().kernels == 1


def test_what_cannot_be_cleared(
    condyle_command: Callable[..., Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept()

    def read_only(path: Path, missing_ok: bool = False) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "unlink", read_only)
    outcome = condyle_command("cache", "--clear")
    monkeypatch.undo()
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err == f"condyle: {folder} cannot be cleared: Read-only file system\n"


def test_folders_in_the_way(folder: Path) -> None:
    """A folder where a file should be is replaced."""
    library, manifest = kept().library, folder / f"{RECIPE}.json"
    for path in (manifest, library):
        path.unlink()
        (path / "below").mkdir(parents=True)
    assert cache.find(RECIPE) is None
    kept()
    assert cache.find(RECIPE) is not None
    manifest.unlink()
    (manifest / "below").mkdir(parents=True)
    cache.clear()
    assert names(folder) == []


def test_a_library_that_others_can_write_is_not_loaded(folder: Path, temporary: Path) -> None:
    """It may stand in a folder that is trusted, which was not always."""
    library = cache.build(RECIPE, Maker(), lambda *words: None).library
    assert cache.find(RECIPE) is not None
    library.chmod(0o666)
    assert cache.find(RECIPE) is None
    library.chmod(0o600)
    assert cache.find(RECIPE) is not None
    other = temporary / library.name
    library.rename(other)
    library.symlink_to(other)
    assert cache.find(RECIPE) is None
