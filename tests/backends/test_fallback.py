"""Without a compiler, or with one that is of no use: the same numbers, one notice.

And clear errors where kernels are demanded.
"""

from __future__ import annotations

import csv
import errno
import functools
import os
import shlex
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.cases import case, error

from condyle.backends import cache, compiler
from condyle.backends.compiler import CompilerError, find_compiler
from condyle.errors import InputError
from condyle.model.model import Model

NAME = "gough-stewart"
SLOWER = "; numpy gives the same numbers, slower\n"
HANGS = "exec sleep 60"
REMEDY = "Install gcc or clang, name another compiler in CC"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No kernels to begin with."""
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_apart", {})
    return tmp_path / "cache"


def by_numpy() -> Model:
    return Model(case(NAME).mechanism, backend="numpy")


@functools.cache
def wanted() -> np.ndarray:
    return by_numpy().inverse_dynamics(*case(NAME).arguments).effort


def check_numbers(model: Model) -> None:
    """Those of numpy."""
    found = model.inverse_dynamics(*case(NAME).arguments)
    tolerance = 1e-12 if model.route == "direct" else 0
    assert error(found.effort, wanted()) <= tolerance


def absent(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
    """Nothing on the path, and no ziglang."""
    (tmp_path / "empty").mkdir()
    patch.setenv("PATH", str(tmp_path / "empty"))
    patch.delenv("CC", raising=False)
    patch.setattr(compiler, "find_spec", lambda name: None)


def answering(body: str) -> Callable[[Path, pytest.MonkeyPatch], None]:
    """A compiler that knows itself well, and then does `body`; $out is the library's path."""
    real = shlex.join(find_compiler().command)

    def use(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
        if body == HANGS:
            patch.setattr(compiler, "SECONDS", 0.5)
        script(
            tmp_path,
            patch,
            f'case "$*" in *-dM*) exec {real} "$@";; esac\n'
            f'for word; do test "$last" = -o && out=$word; last=$word; done\n'
            f'real() {{ {real} "$@"; }}\n{body}',
        )

    return use


def silent(body: str) -> Callable[[Path, pytest.MonkeyPatch], None]:
    """A compiler that is of no use from the start."""

    def use(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
        if body == HANGS:
            patch.setattr(compiler, "ASKING", 0.5)
        script(tmp_path, patch, body)

    return use


def script(tmp_path: Path, patch: pytest.MonkeyPatch, body: str) -> None:
    path = tmp_path / "compiler"
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    path.chmod(0o755)
    patch.setenv("CC", shlex.quote(str(path)))


def words(text: str) -> Callable[[Path, pytest.MonkeyPatch], None]:
    return lambda tmp_path, patch: patch.setenv("CC", text)


# What is wrong, and what is said of it. First those that are found out at once.
USELESS: dict[str, tuple[Callable[[Path, pytest.MonkeyPatch], None], str]] = {
    "none": (absent, "no C compiler: tried cc (not found), gcc (not found), clang (not found)"),
    "not there": (words("no-such-cc -O2"), "no C compiler: tried no-such-cc (not found)"),
    "quotation": (words("cc 'x"), 'CC is "cc \'x": No closing quotation'),
    "not a program": (words("/"), "no C compiler: tried / (not found)"),
    "fails": (silent("exit 3"), "compiler (does not work)"),
    "is no compiler": (silent("echo hello"), "compiler (does not work)"),
    "no text": (silent("printf '__VERS\\377\\376'"), "compiler (does not work)"),
    "dies": (silent("kill -9 $$"), "compiler (does not work)"),
    "hangs": (silent(HANGS), "compiler (does not answer)"),
}
BROKEN: dict[str, tuple[Callable[[Path, pytest.MonkeyPatch], None], str]] = {
    "error": (answering("printf 'wrong \\377\\n' >&2\nexit 1"), "failed: wrong \ufffd"),
    "dies": (answering("kill -9 $$"), "failed: exit status -9"),
    "hangs": (answering(HANGS), "timed out"),
    "builds nothing": (answering("exit 0"), "said nothing and built nothing"),
    "no library": (answering('echo hello > "$out"'), "no kernel could be built and loaded"),
    "no functions": (
        answering('echo "int x;" | real -shared -x c - -o "$out"'),
        "no kernel could be built and loaded",
    ),
}
KINDS = [*(("useless", k) for k in USELESS), *(("broken", k) for k in BROKEN)]


@pytest.fixture
def useless(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> tuple[str, str]:
    kind, name = request.param
    use, said = (USELESS if kind == "useless" else BROKEN)[name]
    use(tmp_path, monkeypatch)
    return kind, said


@pytest.mark.parametrize("useless", KINDS, indirect=True, ids="-".join)
def test_same_numbers_and_one_notice(
    useless: tuple[str, str], capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    """However often it is called; and nothing stays behind."""
    c = case(NAME)
    model = Model(c.mechanism)
    for _ in range(2):
        check_numbers(model)
    assert model.backend.name == "numpy"
    said = capsys.readouterr().err
    assert said.startswith("condyle: ") and said.count("condyle: ") == 1
    assert useless[1] in said and said.endswith(SLOWER)
    assert not folder.exists() or list(folder.iterdir()) == []


@pytest.mark.parametrize(
    "useless", [("useless", "none"), ("broken", "error")], indirect=True, ids="-".join
)
def test_one_notice_for_many_models(
    useless: tuple[str, str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever it is that is wrong with the compiler next."""
    for _ in range(2):
        check_numbers(Model(case(NAME).mechanism))
    check_numbers(Model(case(NAME).mechanism, route="direct"))
    monkeypatch.setenv("CC", "no-such-cc")
    check_numbers(Model(case(NAME).mechanism))
    assert capsys.readouterr().err.count("condyle: ") == 1


@pytest.mark.parametrize("useless", KINDS, indirect=True, ids="-".join)
def test_kernels_that_are_demanded(
    useless: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    """At the latest when the first of them is needed."""
    c = case(NAME)
    with pytest.raises(CompilerError) as failure:
        Model(c.mechanism, backend="compiled").inverse_dynamics(*c.arguments)
    assert useless[1] in str(failure.value) and REMEDY in str(failure.value)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("useless", [("useless", "hangs")], indirect=True)
def test_asked_once(useless: tuple[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler that does not answer costs its time once a process."""
    calls = []
    real = compiler._run
    monkeypatch.setattr(compiler, "_run", lambda *call: (calls.append(call), real(*call))[1])
    for _ in range(3):
        with pytest.raises(CompilerError):
            find_compiler()
    assert len(calls) == 1


def test_no_place_to_build(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(tempfile, "mkdtemp", full)
    check_numbers(Model(case(NAME).mechanism))
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and os.strerror(errno.ENOSPC) in said and said.endswith(SLOWER)


@pytest.mark.usefixtures("compiler_command")
def test_what_was_built_before_needs_no_second_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler that has broken since is not called for what is there."""
    c = case(NAME)
    first = Model(c.mechanism).kernel("inverse", ())
    monkeypatch.setattr(compiler.Compiler, "build", lambda *call: pytest.fail("built again"))
    second = Model(c.mechanism).kernel("inverse", ())
    assert second.cached and not first.cached


# -- who decides ------------------------------------------------------------------------------


def test_the_environment_decides_what_auto_means(monkeypatch: pytest.MonkeyPatch) -> None:
    mechanism = case(NAME).mechanism
    meant = {"numpy": "numpy", "interpreted": "numpy", "compiled": "compiled", "": "compiled"}
    for value, name in meant.items():
        monkeypatch.setenv("CONDYLE_BACKEND", value)
        assert Model(mechanism).backend.name == name
        for backend in ("compiled", "numpy"):
            assert Model(mechanism, backend=backend).backend.name == backend
        assert Model(mechanism, backend="numpy").backend.name == "numpy"
    monkeypatch.setenv("CONDYLE_BACKEND", "compilled")
    with pytest.raises(InputError, match=r'no backend "compilled"\. Did you mean "compiled"'):
        Model(mechanism)


def test_demanded_by_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    absent(tmp_path, monkeypatch)
    monkeypatch.setenv("CONDYLE_BACKEND", "compiled")
    with pytest.raises(CompilerError, match=REMEDY):
        Model(case(NAME).mechanism)
    assert Model(case(NAME).mechanism, backend="numpy").backend.name == "numpy"


# -- on the command line ----------------------------------------------------------------------


@pytest.fixture
def solve(
    condyle_command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Any]:
    """`condyle solve` on the states of the case."""
    c = case(NAME)
    names = by_numpy().independent
    with open(tmp_path / "states.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([p + n for p in ("", "d", "dd") for n in names])
        writer.writerows(c.samples[:, :18].tolist())

    def run(out: str, *options: str) -> Any:
        return condyle_command("solve", NAME, "--states", "states.csv", "--out", out, *options)

    return run


def table(path: Path) -> np.ndarray:
    return np.loadtxt(path, delimiter=",", skiprows=1)


@pytest.mark.usefixtures("compiler_command")
def test_both_backends_write_the_same(
    solve: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernel, numpy, and numpy for want of a compiler."""
    assert solve("compiled.csv", "--backend", "compiled").status == 0
    assert solve("numpy.csv", "--backend", "numpy").err == ""
    absent(tmp_path, monkeypatch)
    outcome = solve("fallback.csv")
    assert outcome.status == 0 and outcome.err.count("\n") == 1 and outcome.err.endswith(SLOWER)
    wanted = table(tmp_path / "numpy.csv")
    got = table(tmp_path / "compiled.csv")
    assert got.shape == (len(case(NAME).q), 18)
    for columns in (slice(0, 6), slice(6, 12), slice(12, 18)):
        assert error(got[:, columns], wanted[:, columns]) < 1e-10
    assert (tmp_path / "fallback.csv").read_bytes() == (tmp_path / "numpy.csv").read_bytes()


@pytest.mark.parametrize(
    "useless", [("useless", "none"), ("broken", "error")], indirect=True, ids="-".join
)
def test_the_command_demands(
    useless: tuple[str, str], solve: Callable[..., Any], tmp_path: Path
) -> None:
    """An error in one line, no file; the old one stays as it is."""
    (tmp_path / "out.csv").write_text("old")
    outcome = solve("out.csv", "--backend", "compiled")
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err.startswith("condyle: ") and outcome.err.count("\n") == 1
    assert useless[1] in outcome.err and REMEDY in outcome.err
    assert (tmp_path / "out.csv").read_text() == "old"
    assert not list(tmp_path.glob(".out.csv*"))


def test_a_kernel_whose_numbers_are_wrong_is_not_kept(
    tmp_path: Path,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    compiler_command: object,
) -> None:
    """A compiler whose roots are too large: numpy's numbers, one notice, no kernel."""
    change = "s/ = rsqrt_v(/ = 1.1 * rsqrt_v(/"
    spoil = f'for word; do case "$word" in *.c) sed -i "{change}" "$word";; esac; done'
    answering(f'{spoil}\nreal "$@"')(tmp_path, monkeypatch)
    model = Model(case(NAME).mechanism)
    check_numbers(model)
    assert "made a kernel whose numbers are wrong" in capsys.readouterr().err
    assert not list(folder.glob("*.json"))
    with pytest.raises(CompilerError, match="numbers are wrong"):
        Model(case(NAME).mechanism, backend="compiled").inverse_dynamics(*case(NAME).arguments)
