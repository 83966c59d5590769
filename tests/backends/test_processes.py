"""Processes that build the same kernels, or are killed while they do."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from support.children import PATIENCE, end, start, wait_for

from condyle.backends import cache
from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.compiler import find_compiler
from condyle.graph.graph import Graph
from condyle.graph.program import Numbers, Output, Port, Program, Programs

X = np.linspace(-1, 1, 9)[:, None]

SOLVE = """
import json, sys
from backends.test_processes import X, kernel
print("here", flush=True)
sys.stdin.readline()
own = kernel()
print(json.dumps([own.cached, own.run({"x": X}).values["y"].tolist()]))
"""

# Builds of a few bytes, each different, so that any mixture shows.
JUGGLE = """
import hashlib, os, random, sys
from condyle.backends import cache
dice = random.Random(int(sys.argv[1]))
def make(place):
    library = place / "kernel.so"
    library.write_bytes(b"whole %d %d " % (os.getpid(), dice.randrange(10**6)) * 1000)
    return library, {}
def say(text, about):
    sys.exit(text)
print("here", flush=True)
sys.stdin.readline()
for _ in range(150):
    recipe = cache.digest(str(dice.randrange(4)))
    what = dice.random()
    if what < 0.05:
        cache.clear()
    elif what < 0.3:
        cache.contents()
    entry = cache.find(recipe) if what < 0.7 else cache.build(recipe, make, say)
    if entry:
        try:
            data = entry.library.read_bytes()
        except FileNotFoundError:
            continue  # cleared since
        if hashlib.sha256(data).hexdigest() != entry.facts["sha256"]:
            sys.exit("not the library of the manifest")
print("done")
"""

# Builds for ever.
HOLD = """
import time
from condyle.backends import cache
def make(place):
    print("building", flush=True)
    time.sleep(1000)
cache.build(cache.digest("one"), make, print)
"""

# Dies at some step of a build, as by a power cut.
DIE = """
import os, signal, sys
from pathlib import Path
from condyle.backends import cache
step = int(sys.argv[1])
steps = 0
def dying(real):
    def call(*arguments, **options):
        global steps
        steps += 1
        if steps == step:
            os.kill(os.getpid(), signal.SIGKILL)
        return real(*arguments, **options)
    return call
os.replace, Path.write_text = dying(os.replace), dying(Path.write_text)
def make(place):
    (place / "kernel.c").write_text("source")
    (place / "kernel.so").write_bytes(b"library")
    return place / "kernel.so", {}
cache.build(cache.digest("one"), make, print)
print("alive")
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def square() -> Programs:
    """x^2 + sin x, for children to build in a moment."""
    graph = Graph()
    x = graph.leaf("input", 0)
    y = graph.apply("add", graph.apply("mul", x, x), graph.apply("sin", x))
    outputs = (Output("y", (), "", False, ((y,),)),)
    return Programs(Program(graph, (1,), 1, (Port("x", 1, "", False, 0),), outputs, ()))


def kernel() -> CompiledKernel:
    numbers = Numbers(np.zeros((1, 1)), (np.zeros((1, 1, 1)),), (np.zeros((1, 1)),), (0,))
    return CompiledKernel(cache.digest("square"), square, numbers)


def require_right(values: object) -> None:
    np.testing.assert_allclose(np.ravel(values), (X**2 + np.sin(X)).ravel(), rtol=1e-15, atol=1e-16)


def require_clean(folder: Path) -> None:
    """A whole kernel, two files, keys that lead there, and nothing else."""
    assert cache.contents().kernels == 1
    assert len([p for p in folder.iterdir() if p.suffix != ".index"]) == 2


def told(children: list[subprocess.Popen[str]]) -> list[str]:
    """What children say that begin together."""
    for child in children:
        assert child.stdout.readline() == "here\n", child.stderr.read()
    for child in children:
        child.stdin.write("\n")
        child.stdin.flush()
    said = [child.communicate(timeout=PATIENCE) for child in children]
    assert [err for _, err in said] == [""] * len(children)
    return [out for out, _ in said]


def made(place: Path) -> tuple[Path, dict[str, str]]:
    (place / "kernel.so").write_bytes(b"library")
    return place / "kernel.so", {}


@pytest.mark.usefixtures("compiler_command")
def test_processes_race(folder: Path) -> None:
    """All miss the kernel at the same time; one builds it, and all get the same right numbers."""
    cached, values = zip(*map(json.loads, told([start(SOLVE) for _ in range(3)])), strict=True)
    assert sorted(cached) == [False, True, True]
    assert values[0] == values[1] == values[2]
    require_right(values[0])
    require_clean(folder)
    assert kernel().cached


def test_many_build_find_and_clear(folder: Path) -> None:
    """Whatever is found is whole, and nobody's build fails."""
    assert told([start(JUGGLE, seed) for seed in range(3)]) == ["done\n"] * 3
    cache.clear()
    assert list(folder.iterdir()) == []


def test_a_lock_ends_with_its_owner(folder: Path) -> None:
    """Who builds holds the lock of a recipe; others wait, and build when it is killed."""
    child = start(HOLD)
    assert child.stdout.readline() == "building\n", child.stderr.read()
    with ThreadPoolExecutor() as pool:
        waiting = pool.submit(cache.build, cache.digest("one"), made, print)
        with pytest.raises(TimeoutError):
            waiting.result(timeout=0.3)
        end(child, signal.SIGKILL)
        assert not waiting.result(timeout=PATIENCE).cached
    assert cache.build(cache.digest("one"), made, print).cached
    require_clean(folder)


@pytest.mark.usefixtures("compiler_command")
def test_killed_while_compiling(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command, started, slow = os.environ["CC"], tmp_path / "started", tmp_path / "slow"
    slow.write_text(
        f'#!/bin/sh\ncase "$*" in *-dM*) exec {command} "$@";; esac\n'
        f"echo > {shlex.quote(str(started))}\nexec sleep {PATIENCE}\n"
    )
    with monkeypatch.context() as patch:
        patch.setenv("CC", f"/bin/sh {shlex.quote(str(slow))}")
        child = start(SOLVE)
        child.stdin.write("\n")
        child.stdin.flush()
        wait_for(started.exists, child)
        end(child, signal.SIGKILL)
    left = [path for path in folder.iterdir() if path.suffix != ".lock"]
    assert [path.name.startswith(cache.BUILD) for path in left] == [True]
    built = kernel()
    assert not built.cached
    require_right(built.run({"x": X}).values["y"])
    require_clean(folder)


def test_killed_at_any_step(folder: Path) -> None:
    """Writing the source and the manifest, moving the library and the manifest."""
    recipe = cache.digest("one")
    for step in (1, 2, 3, 4):
        child = start(DIE, step)
        assert child.communicate(timeout=PATIENCE) == ("", "")
        assert child.returncode == -signal.SIGKILL and cache.find(recipe) is None
        assert any(name.startswith(cache.BUILD) for name in os.listdir(folder))
        cache.build(recipe, made, lambda *words: pytest.fail(str(words)))
        assert cache.find(recipe) is not None
        require_clean(folder)
        shutil.rmtree(folder)
    assert start(DIE, 5).communicate(timeout=PATIENCE) == ("alive\n", "")


@pytest.mark.usefixtures("compiler_command")
def test_a_library_put_in_place_of_ours_is_never_loaded(folder: Path, tmp_path: Path) -> None:
    """Not even opened: opening runs its code."""
    library = folder / kernel().facts["library"]
    mark, source, evil = tmp_path / "it ran", tmp_path / "evil.c", tmp_path / "evil.so"
    source.write_text(
        "#include <stdio.h>\n__attribute__((constructor)) void evil(void) {"
        f' FILE *f = fopen("{mark}", "w"); if (f) fclose(f); }}\n'
    )
    find_compiler().build(evil, source)
    os.replace(evil, library)
    cached, values = json.loads(told([start(SOLVE)])[0])
    assert not cached and not mark.exists()
    require_right(values)
    require_clean(folder)


@pytest.mark.usefixtures("compiler_command")
def test_a_library_that_no_longer_loads_is_built_again(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whole, but of another machine, say."""
    kernel()
    (manifest,) = folder.glob("*.json")
    recipe, facts = manifest.stem, cache.find(manifest.stem).facts
    cache.clear()

    def make(place: Path) -> tuple[Path, dict[str, object]]:
        (place / "kernel.so").write_bytes(b"\x7fELF of another machine")
        return place / "kernel.so", dict(facts)

    cache.build(recipe, make, lambda *words: pytest.fail(str(words)))
    assert cache.find(recipe) is not None
    again = kernel()
    assert not again.cached and kernel().cached
    require_right(again.run({"x": X}).values["y"])
    assert cache.contents().kernels == 1 and capsys.readouterr().err == ""


@pytest.mark.usefixtures("compiler_command")
def test_kernels_of_one_process_go_with_it(folder: Path, tmp_path: Path) -> None:
    """Nothing can be kept: one notice, right numbers, and nothing stays behind."""
    folder.write_text("a file")
    (tmp_path / "tmp").mkdir()
    child = start(
        f"import sys, tempfile\ntempfile.tempdir = sys.argv[1]\n{SOLVE}", tmp_path / "tmp"
    )
    out, err = child.communicate("\n", timeout=PATIENCE)
    assert err.count("\n") == 1 and f"cache {folder} cannot be used" in err
    require_right(json.loads(out.splitlines()[1])[1])
    assert list((tmp_path / "tmp").iterdir()) == []
