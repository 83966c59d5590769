"""Without a compiler, or with one that is of no use: the same numbers, one notice.

And clear errors where kernels are demanded.
"""

from __future__ import annotations

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
Use = Callable[[Path, pytest.MonkeyPatch], None]
REMEDY = "Install gcc or clang, name another compiler in CC"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """No kernels to begin with."""
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(cache, "_apart", {})
    return tmp_path / "cache"


@functools.cache
def wanted() -> np.ndarray:
    model = Model(case(NAME).mechanism, backend="numpy")
    return model.inverse_dynamics(*case(NAME).arguments).effort


def require_numbers(model: Model) -> None:
    """Those of numpy."""
    found = model.inverse_dynamics(*case(NAME).arguments)
    assert error(found.effort, wanted()) <= (1e-12 if model.route == "direct" else 0)


def demand() -> None:
    Model(case(NAME).mechanism, backend="compiled").inverse_dynamics(*case(NAME).arguments)


def absent(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
    """Nothing on the path, and no ziglang."""
    (tmp_path / "empty").mkdir()
    patch.setenv("PATH", str(tmp_path / "empty"))
    patch.delenv("CC", raising=False)
    patch.setattr(compiler, "find_spec", lambda name: None)


def script(tmp_path: Path, patch: pytest.MonkeyPatch, body: str) -> None:
    path = tmp_path / "compiler"
    path.write_text(f"#!/bin/sh\n{body}\n", encoding="utf-8")
    path.chmod(0o755)
    patch.setenv("CC", shlex.quote(str(path)))


def answering(body: str) -> Use:
    """A compiler that knows itself well, and then does `body`; $out is the library's path."""

    def use(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
        patch.setattr(compiler, "SECONDS", 0.5 if body == HANGS else compiler.SECONDS)
        real = shlex.join(find_compiler().command)
        known = f'case "$*" in *-dM*) exec {real} "$@";; esac\n'
        known += 'for word; do test "$last" = -o && out=$word; last=$word; done\n'
        script(tmp_path, patch, f'{known}real() {{ {real} "$@"; }}\n{body}')

    return use


def silent(body: str) -> Use:
    """A compiler that is of no use from the start."""

    def use(tmp_path: Path, patch: pytest.MonkeyPatch) -> None:
        patch.setattr(compiler, "ASKING", 0.5 if body == HANGS else compiler.ASKING)
        script(tmp_path, patch, body)

    return use


def words(text: str) -> Use:
    return lambda tmp_path, patch: patch.setenv("CC", text)


# What is wrong, and what is said of it; first what is found out at once.
USELESS: dict[str, tuple[Use, str]] = {
    "none": (absent, "no C compiler: tried cc (not found), gcc (not found), clang (not found)"),
    "not there": (words("no-such-cc -O2"), "no C compiler: tried no-such-cc (not found)"),
    "quotation": (words("cc 'x"), 'CC is "cc \'x": No closing quotation'),
    "not a program": (words("/"), "no C compiler: tried / (not found)"),
    "fails": (silent("exit 3"), "compiler (does not work)"),
    "is no compiler": (silent("echo hello"), "compiler (does not work)"),
    "no text": (silent("printf '__VERS\\377\\376'"), "compiler (does not work)"),
    "dies": (silent("kill -9 $$"), "compiler (does not work)"),
    "hangs": (silent(HANGS), "compiler (does not answer)"),
    "error": (answering("printf 'wrong \\377\\n' >&2\nexit 1"), "failed: wrong \ufffd"),
    "dies later": (answering("kill -9 $$"), "failed: exit status -9"),
    "hangs later": (answering(HANGS), "timed out"),
    "builds nothing": (answering("exit 0"), "said nothing and built nothing"),
    "no library": (answering('echo hello > "$out"'), "no kernel could be built and loaded"),
    "no functions": (
        answering('echo "int x;" | real -shared -x c - -o "$out"'),
        "no kernel could be built and loaded",
    ),
    # Whose roots are too large.
    "wrong numbers": (
        answering(
            'for word; do case "$word" in *.c) '
            'sed -i "s/ = rsqrt_v(/ = 1.1 * rsqrt_v(/" "$word";; esac; done\nreal "$@"'
        ),
        "made a kernel whose numbers are wrong",
    ),
    "wrong numbers for one state": (
        answering(
            'for word; do case "$word" in *single.c) '
            'sed -i "s/ = \\([^;]*\\) \\* /= 1.1 * \\1 * /" "$word";; esac; done\nreal "$@"'
        ),
        "made a kernel whose numbers are wrong",
    ),
}


@pytest.mark.parametrize("name", USELESS)
@pytest.mark.usefixtures("compiler_command")
def test_same_numbers_one_notice_and_an_error_where_kernels_are_demanded(
    name: str,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """However often it is called, and nothing stays behind; a demand fails when the first kernel is
    needed at the latest. A compiler that does not answer costs its time once a process."""
    use, words = USELESS[name]
    use(tmp_path, monkeypatch)
    calls, real = [], compiler._run
    monkeypatch.setattr(compiler, "_run", lambda *call: (calls.append(call), real(*call))[1])
    for model in (Model(case(NAME).mechanism), Model(case(NAME).mechanism)):
        for _ in range(2):
            require_numbers(model)
        assert model.backend.name == "numpy"
    said = capsys.readouterr().err
    assert said.startswith("condyle: ") and said.count("condyle: ") == 1
    assert words in said and said.endswith(SLOWER)
    assert name != "hangs" or len(calls) == 1
    with pytest.raises(CompilerError) as failure:
        demand()
    assert words in str(failure.value) and REMEDY in str(failure.value)
    assert capsys.readouterr().err == ""
    assert not folder.exists() or list(folder.iterdir()) == []


def edited(file: str, edit: str) -> Use:
    """A compiler that reads a kernel's C other than it stands, by a command of sed."""
    return answering(
        f'for word; do case "$word" in *{file}) sed -i \'{edit}\' "$word";; esac; done\nreal "$@"'
    )


WRONG_PRODUCTS = r"s/ = \([^;]*\) \* / = 1.1 * \1 * /"
NAN_PASSES = r"s/check\[i\] >= tolerance\[i\]/!(check[i] < tolerance[i])/"
ASKED_AGAIN = {
    "robust numbers": ("single.c", "/int robust(const/,/^}/ " + WRONG_PRODUCTS),
    "robust table": ("single.c", "/void prepare_robust(/,/^}/ " + WRONG_PRODUCTS),
    "NaN passes in the batch": ("batch.c", NAN_PASSES),
    "NaN passes for one state": ("single.c", NAN_PASSES),
    "the batch has no doubts": ("batch.c", "s/any(doubt)/0/"),
}


@pytest.mark.parametrize("name", ASKED_AGAIN)
@pytest.mark.usefixtures("compiler_command")
def test_a_kernel_wrong_only_where_another_way_is_needed_is_refused(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At home, where new kernels are compared with numpy, the mechanism never needs it."""
    edited(*ASKED_AGAIN[name])(tmp_path, monkeypatch)
    with pytest.raises(
        CompilerError, match=r"made a kernel whose numbers are wrong: \d of \d samples"
    ):
        Model(case("masticatory").mechanism, backend="compiled").kernel("inverse", ())


def test_one_notice_whatever_is_wrong_next(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """No place to build, then no compiler."""

    def full(*arguments: object, **options: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(tempfile, "mkdtemp", full)
        require_numbers(Model(case(NAME).mechanism))
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and os.strerror(errno.ENOSPC) in said and said.endswith(SLOWER)
    monkeypatch.setenv("CC", "no-such-cc")
    require_numbers(Model(case(NAME).mechanism, route="direct"))
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("compiler_command")
def test_what_was_built_before_needs_no_second_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler that has broken since is not called for what is there."""
    first = Model(case(NAME).mechanism).kernel("inverse", ())
    monkeypatch.setattr(compiler.Compiler, "build", lambda *call: pytest.fail("built again"))
    second = Model(case(NAME).mechanism).kernel("inverse", ())
    assert second.cached and not first.cached


@pytest.mark.usefixtures("compiler_command")
def test_the_environment_decides_what_auto_means(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mechanism = case(NAME).mechanism
    meant = {"numpy": "numpy", "interpreted": "numpy", "compiled": "compiled", "": "compiled"}
    for value, name in meant.items():
        monkeypatch.setenv("CONDYLE_BACKEND", value)
        assert Model(mechanism).backend.name == name
        for backend in ("compiled", "numpy"):
            assert Model(mechanism, backend=backend).backend.name == backend
    monkeypatch.setenv("CONDYLE_BACKEND", "compilled")
    with pytest.raises(InputError, match=r'no backend "compilled"\. Did you mean "compiled"'):
        Model(mechanism)
    absent(tmp_path, monkeypatch)
    monkeypatch.setenv("CONDYLE_BACKEND", "compiled")
    with pytest.raises(CompilerError, match=REMEDY):
        Model(mechanism)
    assert Model(mechanism, backend="numpy").backend.name == "numpy"


@pytest.mark.usefixtures("compiler_command")
def test_the_command_writes_the_same_with_both(
    condyle_command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kernel, numpy, and numpy for want of a compiler.

    A demand is an error in one line, and the old file stays as it is.
    """
    names = Model(case(NAME).mechanism, backend="numpy").independent
    head = ",".join(p + n for p in ("", "d", "dd") for n in names)
    rows, samples = tmp_path / "states.csv", case(NAME).samples[:, :18]
    np.savetxt(rows, samples, fmt="%.17g", delimiter=",", header=head, comments="")

    def solve(out: str, *options: str) -> Any:
        return condyle_command("solve", NAME, "--states", "states.csv", "--out", out, *options)

    assert solve("compiled.csv", "--backend", "compiled").status == 0
    assert solve("numpy.csv", "--backend", "numpy").err == ""
    with monkeypatch.context() as patch:
        absent(tmp_path, patch)
        outcome = solve("fallback.csv")
    assert outcome.status == 0 and outcome.err.count("\n") == 1 and outcome.err.endswith(SLOWER)
    assert (tmp_path / "fallback.csv").read_bytes() == (tmp_path / "numpy.csv").read_bytes()
    got, right = (
        np.loadtxt(tmp_path / f"{name}.csv", delimiter=",", skiprows=1)
        for name in ("compiled", "numpy")
    )
    assert got.shape == (len(case(NAME).q), 18)
    for columns in (slice(0, 6), slice(6, 12), slice(12, 18)):
        assert error(got[:, columns], right[:, columns]) < 1e-10
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "another"))
    for name in ("not there", "error"):
        use, words = USELESS[name]
        with monkeypatch.context() as patch:
            use(tmp_path, patch)
            outcome = solve("numpy.csv", "--backend", "compiled")
        assert (outcome.status, outcome.out) == (2, "")
        assert outcome.err.startswith("condyle: ") and outcome.err.count("\n") == 1
        assert words in outcome.err and REMEDY in outcome.err
        assert (tmp_path / "fallback.csv").read_bytes() == (tmp_path / "numpy.csv").read_bytes()
        assert not list(tmp_path.glob(".numpy.csv*"))
