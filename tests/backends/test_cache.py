"""What the cache keeps, finds, refuses and clears. Its libraries are a few bytes, never loaded."""

from __future__ import annotations

import errno
import json
import os
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
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
FULL = os.strerror(errno.ENOSPC)


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

    def __init__(self, fails: Callable[[Path], BaseException | None] = lambda place: None) -> None:
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


def kept(recipe: str = RECIPE) -> cache.CachedLibrary:
    return cache.build(recipe, Maker(), quiet)


# -- what is found ----------------------------------------------------------------------------


def test_what_was_built_is_found_in_a_folder_of_ones_own(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a folder nor a library that others can write, or that is theirs, is looked at."""
    assert cache.find(RECIPE) is None and not folder.exists()
    built = kept()
    found = cache.find(RECIPE)
    assert found == replace(built, cached=True) and not built.cached
    assert found.library.read_bytes() == BYTES and found.facts["flags"] == ["-O2"]
    assert cache.find(OTHER) is None
    assert names(folder) == sorted([f"{RECIPE}.json", found.library.name])
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for path, mode, good in (
        *((folder, 0o720, False), (folder, 0o702, False), (folder, 0o755, True)),
        *((found.library, 0o666, False), (found.library, 0o600, True)),
    ):
        path.chmod(mode)
        assert (cache.find(RECIPE) is not None) == good
    with monkeypatch.context() as patch:
        patch.setattr(os, "getuid", lambda: folder.stat().st_uid + 1)
        assert cache.find(RECIPE) is None
    other = temporary / found.library.name
    found.library.rename(other)
    found.library.symlink_to(other)
    assert cache.find(RECIPE) is None


def test_what_was_built_is_found_whatever_the_umask(folder: Path) -> None:
    """Of a group whose members may write each other's files, too."""
    before = os.umask(0o002)
    try:
        kept()
    finally:
        os.umask(before)
    assert cache.find(RECIPE) is not None and cache.contents().kernels == 1


def spoiled_library(library: Path) -> Iterator[Any]:
    yield library.write_bytes(BYTES[:-1])
    yield library.write_bytes(b"")
    yield library.write_bytes(b"A" + BYTES[1:])
    yield library.write_bytes(BYTES + b"\0")
    yield library.unlink()
    library.unlink()
    yield library.symlink_to("nowhere")
    library.unlink()
    yield (library / "below").mkdir(parents=True)


def test_a_library_that_is_not_the_one_built(folder: Path) -> None:
    """It is built again, also where there is a folder in its place."""
    for _ in spoiled_library(kept().library):
        assert cache.find(RECIPE) is None and cache.contents().kernels == 0
        kept()
        found = cache.find(RECIPE)
        assert found is not None and found.library.read_bytes() == BYTES


def spoiled_manifests(text: str, other: str) -> list[str | bytes]:
    """Of a kernel, given its own and another's."""
    stranger = json.loads(text)
    stranger["facts"]["library"] = f"{OTHER}-{stranger['facts']['sha256'][:16]}.so"
    return [
        *("", text[:-1], b"\xff\xfe\0", "[1, 2]", "[" * 100_000, "null", "{}"),
        '{"seal": "", "facts": "x"}',
        '{"seal": "", "facts": {"library": 5}}',
        *(text.replace("-O2", "-O3"), json.dumps(stranger), other),
    ]


def test_a_manifest_that_is_not_the_one_written(folder: Path) -> None:
    """Also another's, or one that names a library of another's, by its right hash."""
    for recipe in (RECIPE, OTHER):
        kept(recipe)
    manifest = folder / f"{RECIPE}.json"
    for made in spoiled_manifests(manifest.read_text(), (folder / f"{OTHER}.json").read_text()):
        manifest.write_bytes(made if isinstance(made, bytes) else made.encode())
        assert cache.find(RECIPE) is None and cache.find(OTHER) is not None
        assert cache.contents().kernels == 1
        kept()
        assert cache.find(RECIPE) is not None and cache.contents().kernels == 2
        assert len(names(folder)) == 4
    manifest.unlink()
    (manifest / "below").mkdir(parents=True)
    cache.clear()
    assert names(folder) == []


# -- recipes ----------------------------------------------------------------------------------


def test_parts_of_a_recipe_stand_apart() -> None:
    parts = [("ab", "c"), ("a", "bc"), ("abc",), ("abc", ""), ("", "abc"), ("c", "ab")]
    assert len({cache.digest(*p) for p in parts}) == len(parts)


def test_everything_that_matters_is_in_the_index_key(monkeypatch: pytest.MonkeyPatch) -> None:
    """And nothing else: formulation and route make no difference to geometry."""
    mechanism = case("masticatory").mechanism
    structure = structure_of(mechanism)
    question = Question.about(structure, "inverse", ("contact",))
    tool = Compiler(("cc",), ("-O2",), "gcc 13 AVX2", 4)
    structures: dict[str, tuple[Any, ...]] = {
        "formulation": ("momentum",),
        "route": ("direct",),
        "chains": ((("PSS", 6),), (("RSS", 7),)),
        "contacts": ((("quadric", 10), ("plane", 5)),),
        "dependent": (("X", "gamma"),),
        "parallel": (not structure.parallel,),
        "zeros": (frozenset({(-1, 0)}), frozenset({(0, 0)})),
    }
    tools: dict[str, tuple[Any, ...]] = {
        "command": (("gcc",), ("cc", "-m32")),
        "flags": (("-O3",), ("-O2", "-march=native")),
        "identity": ("gcc 14 AVX2", "gcc 13 AVX512"),
        "lanes": (8,),
    }
    asked = [("inverse", ()), ("inverse", ("joint",)), ("matrices",), ("motion",)]
    asked += [("closure", names) for names in ((), ("X", "Y"))]
    about = [question, *(Question.about(structure, *one) for one in asked)]  # type: ignore[arg-type]
    about += [
        Question.about(replace(structure, **{name: value}), "inverse", ("contact",))
        for name, values in structures.items()
        for value in values
    ]
    keys = [_index_key(one.key, tool) for one in about]
    keys += [
        _index_key(question.key, replace(tool, **{name: value}))
        for name, values in tools.items()
        for value in values
    ]
    with monkeypatch.context() as patch:
        for owner, name in ((questions, "_casadi"), (questions, "_sources"), (build, "_generator")):
            patch.setattr(owner, name, lambda name=name: f"another {name}")
            keys.append(_index_key(question.key, tool))
    assert len(set(keys)) == len(keys) == 26
    again = Question.about(replace(structure), "inverse", ("contact",))
    assert _index_key(again.key, replace(tool)) == keys[0]
    for name in questions.GEOMETRY:
        choices = (("virtual_power", "core"), ("momentum", "direct"))
        made = {Question.about(structure_of(mechanism, *choice), name).key for choice in choices}
        assert len(made) == 1


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
    raise OSError(errno.ENOSPC, FULL)


@contextmanager
def full_at(step: str, folder: Path, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """A disk that is full when the place is made, the manifest written or the library moved."""
    owner = {"mkdtemp": tempfile, "write_text": Path, "replace": os}[step]
    real = getattr(owner, step)

    def spoiled(*arguments: Any, **options: Any) -> Any:
        words = [str(x) for x in (*arguments, *options.values())]
        ours = any(w == str(folder) or w.endswith(("manifest.json", ".so")) for w in words)
        return (full if ours else real)(*arguments, **options)

    with patch.context() as patched:
        patched.setattr(owner, step, spoiled)
        yield


def require_apart(folder: Path, temporary: Path, maker: Maker, why: str) -> None:
    """Built for this process alone, said in one notice, found again by this process only."""
    said: list[tuple[str, str]] = []
    entry = cache.build(RECIPE, maker, lambda *words: said.append(words))
    assert entry.library.read_bytes() == BYTES and temporary in entry.library.parents
    assert cache.find(RECIPE) == entry
    [(text, about)] = said
    assert about == "cache" and f"({why})" in text and str(folder) in text
    assert "this process alone" in text and "CONDYLE_CACHE" in text
    assert not folder.is_dir() or names(folder) == []
    cache._apart.clear()


def test_a_full_disk(folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While compiling, while keeping, and one that fails the compiler; a compiler that fails by
    itself is not asked twice; and where there is no place at all, that is said."""

    def here(error: Exception) -> Maker:
        return Maker(lambda place: error if folder in place.parents else None)

    require_apart(folder, temporary, here(OSError(errno.ENOSPC, "full")), "full")
    for step in ("mkdtemp", "write_text", "replace"):
        with full_at(step, folder, monkeypatch):
            require_apart(folder, temporary, Maker(), FULL)
    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "TemporaryFile", full)
        require_apart(folder, temporary, here(CondyleError("ld\nmore")), "ld")
    before, maker = names(temporary), Maker(lambda place: CondyleError("wrong"))
    with pytest.raises(CondyleError, match="wrong"):
        cache.build(RECIPE, maker, quiet)
    assert maker.calls == 1 and names(folder) == [] and names(temporary) == before
    monkeypatch.setattr(tempfile, "mkdtemp", full)
    with pytest.raises(OSError, match=FULL):
        kept()


def test_no_folder(
    folder: Path, temporary: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A file in its place or above it, a folder of others, and no home: no folder named ~ is made
    here."""
    folder.mkdir()
    folder.chmod(0o777)
    require_apart(folder, temporary, Maker(), "it belongs to or can be written by others")
    folder.rmdir()
    folder.write_text("a file")
    require_apart(folder, temporary, Maker(), os.strerror(errno.EEXIST))
    assert folder.read_text() == "a file"
    assert cache.contents() == cache.clear() == cache.Contents(folder, 0, 0)
    monkeypatch.setenv("CONDYLE_CACHE", str(below := folder / "below"))
    require_apart(below, temporary, Maker(), os.strerror(errno.ENOTDIR))
    assert cache.contents() == cache.Contents(below, 0, 0)
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("CONDYLE_CACHE", "~/kernels")
    assert cache.cache_folder() == tmp_path / "kernels"
    monkeypatch.setenv("CONDYLE_CACHE", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert tmp_path in cache.cache_folder().parents
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: f"~/.cache/{name}")
    require_apart(Path("~/.cache/condyle/kernels"), temporary, Maker(), "there is no home folder")
    assert not (tmp_path / "~").exists()


def test_a_build_that_stops_leaves_nothing(folder: Path, temporary: Path) -> None:
    for error in (KeyboardInterrupt(), MemoryError(), ValueError("x")):
        maker = Maker(lambda place, error=error: error)  # type: ignore[misc]
        with pytest.raises(type(error)):
            cache.build(RECIPE, maker, quiet)
        with pytest.raises(type(error)):
            cache.build_apart("x", maker)
        assert names(folder) == names(temporary) == []


# -- what killed builds leave -----------------------------------------------------------------


def leave_rubbish(folder: Path, name: str = "killed") -> list[Path]:
    """A half-built kernel, and one whose manifest was never written."""
    place = folder / f"{cache.BUILD}{name}"
    place.mkdir(parents=True)
    folder.chmod(0o700)
    (place / "kernel.c").write_text("sour")
    library = folder / f"{OTHER}-{'0' * 16}.so"
    library.write_bytes(b"half")
    return [place, library]


def test_the_next_build_clears_up(folder: Path) -> None:
    """Two built one kernel, not the same to the byte: the manifest decides whose library stays."""
    leave_rubbish(folder)
    library = kept().library
    assert len(names(folder)) == 2 and cache.find(RECIPE) is not None
    twin = library.with_name(f"{RECIPE}-{'0' * 16}.so")
    twin.write_bytes(b"twin")
    kept(OTHER)
    assert not twin.exists() and library.exists() and len(names(folder)) == 4


def test_nobody_clears_up_while_others_build(folder: Path) -> None:
    """But what is older than any build goes; and clearing does not disturb a build."""
    folder.mkdir(mode=0o700)
    with cache._held(folder):
        fresh = leave_rubbish(folder)
        old, _ = leave_rubbish(folder, "old")
        os.utime(old, (0, 0))
        kept()
        assert all(path.exists() for path in fresh) and not old.exists()
        assert cache.clear().kernels == 1
        assert fresh[0].exists() and cache.find(RECIPE) is None
    cache.clear()
    assert names(folder) == []

    def clear(place: Path) -> None:
        kept(OTHER)
        assert cache.clear().kernels == 1

    cache.build(RECIPE, Maker(clear), quiet)
    assert cache.find(RECIPE) is not None and cache.find(OTHER) is None


def test_without_locks_only_age_tells_what_is_left_over(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a file system that has none, and on a system that has none."""

    def no_lock(handle: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    for patch in (
        lambda: monkeypatch.setattr(cache.fcntl, "flock", no_lock),
        lambda: monkeypatch.setattr(cache, "fcntl", None),
    ):
        patch()
        place, library = leave_rubbish(folder)
        kept()
        assert place.exists() and library.exists() and cache.find(RECIPE) is not None
        os.utime(place, (0, 0))
        kept(OTHER)
        assert not place.exists() and cache.find(RECIPE) is not None
        shutil.rmtree(folder)


# -- condyle cache ----------------------------------------------------------------------------


def test_show_and_clear(
    condyle_command: Callable[..., Any], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only what is ours goes; a workplace that goes while it is looked at is no error."""
    outcome = condyle_command("cache")
    assert outcome.status == 0 and not folder.exists()
    assert outcome.out.splitlines()[0] == f"{folder}: 0 kernels, 0.0 MB"
    for recipe in (RECIPE, OTHER):
        kept(recipe)
    (folder / "notes.txt").write_text("not ours")
    (folder / f"{OTHER}.json").write_text("broken")
    place, _ = leave_rubbish(folder)
    (place / "kernel.so").write_bytes(bytes(3_000_000))
    shown = condyle_command("cache")
    assert shown.status == 0 and f"{folder}: 1 kernel, 3.0 MB\n" in shown.out
    real = Path.glob

    def gone(path: Path, pattern: str) -> Any:
        return [*real(path, pattern), *[folder / f"{cache.BUILD}gone"] * (path == folder)]

    with monkeypatch.context() as patch:
        patch.setattr(Path, "glob", gone)
        patch.setattr(Path, "is_dir", lambda path: True)
        assert cache.contents().kernels == 1

    cleared = condyle_command("cache", "--clear")
    assert cleared.status == 0 and names(folder) == ["notes.txt"]
    assert cleared.out.splitlines()[0] == f"Removed 1 kernel, 3.0 MB from {folder}"
    assert condyle_command("cache", "--clear").out.startswith("Removed 0 kernels, 0.0 MB")

    def read_only(path: Path, missing_ok: bool = False) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    kept()
    with monkeypatch.context() as patch:
        patch.setattr(Path, "unlink", read_only)
        outcome = condyle_command("cache", "--clear")
    assert (outcome.status, outcome.out) == (2, "")
    why = os.strerror(errno.EROFS)
    assert outcome.err == f"condyle: {folder} cannot be cleared: {why}\n"
