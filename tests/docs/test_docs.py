"""The documentation tells the truth: its blocks and commands run, its links and names exist.

A ```python block is run, page by page in one namespace and one folder, with the ```console
commands between. It is left alone only where it is an excerpt of the sources, word for word, or
where a line `<!-- not run: why -->` stands above it.
"""

from __future__ import annotations

import importlib
import json
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml
from support.machine_log import (
    CYCLE,
    DRIVES,
    HELD,
    LIGHTER,
    SHORT_PATH,
    STUDY,
    write_log,
    write_poses,
)
from support.recorded_jaw import record
from support.recorded_session import write_session

import condyle
from condyle.mechanism import bundled_text

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*([ROOT / "README.md"] * (ROOT / "README.md").exists()), *sorted(DOCS.rglob("*.md"))]
PAGES = [page for page in PAGES if "generated" not in page.parts]
# Servers and long work: of these commands only the options are looked at.
LONG = {"view", "bench", "compare"}
BLOCK = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
EQUATIONS = 67
# Pages whose numbers are many: interpreted they would take minutes.
COMPILED = {"kernels.md", "simulate.md", "controllers.md", "tutorial-simulate.md"}
COMPILED |= {"foods.md", "bite-control.md"}
MASSES = """
motion = { file = "trial", rate = 4 }
load = "none"
[[vary]]
what = "platform.mass"
values = [0.2, 0.3]
"""
# Blocks and commands of some pages, so that a test that finds none of them fails.
RUN = {"tutorial.md": 10, "forward-kinematics.md": 5}


@dataclass(frozen=True)
class Block:
    kind: str
    text: str
    line: int
    skipped: bool


def blocks(page: Path) -> Iterator[Block]:
    text = page.read_text(encoding="utf-8")
    for match in BLOCK.finditer(text):
        before = text[: match.start()].rstrip().rpartition("\n")[2]
        skipped = before.startswith("<!-- not run:")
        yield Block(match[1], match[2], text.count("\n", 0, match.start()) + 2, skipped)


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture(scope="session")
def sources() -> str:
    return "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py"))


@pytest.fixture
def hooks(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(DOCS))
    return importlib.import_module("hooks")


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    monkeypatch.setenv("CONDYLE_CACHE", str(tmp_path_factory.getbasetemp() / "docs-kernels"))


@pytest.fixture(autouse=True)
def registers() -> Iterator[None]:
    """What a page registers is gone after it."""
    from condyle.dynamics import FORMULATIONS
    from condyle.questions import QUESTIONS
    from condyle.questions.law import CONTROLLERS
    from condyle.questions.load import LOADS
    from condyle.report.figures import PLOTS
    from condyle.report.panel import PANEL_GROUPS

    registers = FORMULATIONS, PLOTS, PANEL_GROUPS, QUESTIONS, CONTROLLERS, LOADS
    kept: list[tuple[dict[str, Any], dict[str, Any]]] = [
        (register, dict(register)) for register in registers
    ]
    yield
    for register, before in kept:
        register.clear()
        register.update(before)


def put_files_of_a_reader(folder: Path) -> None:
    """Files that commands in the text name without making them."""
    shutil.copytree(ROOT / "examples", folder / "examples", dirs_exist_ok=True)
    (folder / "my.toml").write_text(bundled_text("masticatory"), encoding="utf-8")
    for name in ("masses.toml", "study.toml"):
        (folder / name).write_text(MASSES, encoding="utf-8")
    (folder / "chewing.toml").write_text("duration = 0.004\n")
    drives = '[controller]\nkind = "joint_pd"\nstiffness = 5\ndamping = 0.03\n'
    (folder / "drives.toml").write_text(f"duration = 0.002\n{drives}")
    jaw = record(noise=5e-5)
    jaw.write(folder / "trial.c3d")
    jaw.write_tables(folder / "markers.toml")
    write_session(folder, 2, 2.5)
    write_log(folder / "log.csv")
    write_poses(folder / "poses.csv")
    (folder / "fit.toml").write_text(STUDY)
    (folder / "calib.toml").write_text('numbers = ["chain.*.actuator.zero"]')
    (folder / "excite.toml").write_text(SHORT_PATH)
    (folder / "cycle.toml").write_text(CYCLE)
    (folder / "held.toml").write_text(HELD)
    (folder / "sensed.toml").write_text(DRIVES)
    (folder / "lighter.toml").write_text(LIGHTER)
    (folder / "robot.toml").write_text(bundled_text("masticatory"), encoding="utf-8")
    q = ("X", "Y", "alpha", "beta")
    names = [prefix + name for prefix in ("", "d", "dd") for name in q]
    (folder / "bite.csv").write_text("X,Y,alpha,beta,Fz\n0,0,0,0,-100\n")
    chains, legs = (
        [f"joint_{chain}" for chain in condyle.load_mechanism(name).chain_names]
        for name in ("masticatory", "gough-stewart")
    )
    driven = [*names[:8], *(chain.replace("joint_", "tau_") for chain in chains)]
    tables = (("efforts.csv", driven), ("states.csv", names))
    muscles = condyle.load_mechanism("human-jaw-muscles")
    seconds = np.arange(8) * 0.05
    still = {"t": seconds} | dict.fromkeys(("X", "Y", "alpha", "beta"), np.zeros(8))
    pd.DataFrame(still).to_csv(folder / "path.csv", index=False)
    signals = {f"emg_{chain}": np.full(8, 0.2) for chain in muscles.chain_names[:8]}
    pd.DataFrame({"t": seconds} | signals).to_csv(folder / "measured.csv", index=False)
    for name, columns in (*tables, ("encoders.csv", chains), ("legs.csv", legs)):
        rows = [",".join(columns), *[",".join(["0"] * len(columns))] * 2]
        (folder / name).write_text("\n".join(rows), encoding="utf-8")


def run_page(page: Path, command: Callable[..., Any], sources: str) -> int:
    """Run a page's blocks in order; returns how many."""
    namespace: dict[str, Any] = {"__name__": "page"}
    count = 0
    put_files_of_a_reader(Path.cwd())
    for block in blocks(page):
        if block.kind == "python" and not block.skipped and block.text not in sources:
            code = "\n" * (block.line - 1) + block.text
            exec(compile(code, str(page), "exec", dont_inherit=True), namespace)
            count += 1
        if block.kind == "console" and not block.skipped:
            for line in block.text.splitlines():
                words = shlex.split(line.removeprefix("$ "), comments=True)
                if words[:1] == ["condyle"]:
                    run_command(command, words[1:])
                    count += 1
    return count


def run_command(command: Callable[..., Any], words: list[str]) -> None:
    outcome = command(words[0], "--help") if words[0] in LONG else command(*words)
    assert outcome.status == 0, f"condyle {shlex.join(words)}: {outcome.err}"
    if words[0] in LONG:
        for word in words:
            assert not word.startswith("--") or word in outcome.out, f"no option {word}"


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_blocks_and_commands_run(
    page: Path,
    condyle_command: Callable[..., Any],  # also moves to an empty folder
    sources: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if page.name in COMPILED:
        from condyle.backends.compiler import CompilerError, find_compiler

        monkeypatch.setenv("CONDYLE_BACKEND", "compiled")
        try:
            find_compiler()
        except CompilerError as error:
            pytest.skip(f"kernels need a compiler: {error}")
    count = run_page(page, condyle_command, sources)
    assert count == RUN.get(page.name, count)


def test_excerpts_are_of_the_sources(sources: str) -> None:
    assert all(block.text in sources for block in blocks(DOCS / "chains.md") if block.kind)


def test_inline_commands_exist() -> None:
    from condyle.cli import commands  # noqa: F401 - registers them
    from condyle.cli.command import registered

    known = {words.split()[0] for words, _ in registered()}
    for page in PAGES:
        used = re.findall(r"`condyle ([a-z]+)", page.read_text(encoding="utf-8"))
        assert set(used) <= known, name_of(page)


# Example -> the number in its last line, and how near it must be.
EXAMPLES = {
    "chew": (4.0, 0.2),
    "compare_surfaces": (-6.4285, 1e-3),
    "forward_kinematics": (2.979e-05, 1e-7),
    "own_mechanism": (0.244891, 2e-6),
    "reference": (0.925334, 2e-6),
    "session": (1.644, 0.03),
    "states_batch": (0.055845, 2e-6),
}


def test_every_example_is_listed() -> None:
    assert {path.stem for path in (ROOT / "examples").glob("*.py")} == set(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples(
    name: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    path = ROOT / "examples" / f"{name}.py"
    text = path.read_text(encoding="utf-8")
    if name == "chew":  # one stroke of five
        monkeypatch.delenv("CONDYLE_BACKEND")
        monkeypatch.chdir(tmp_path)
        text = text.replace("SECONDS = 5.0", "SECONDS = 1.9")
    if name == "session":
        monkeypatch.chdir(tmp_path)
    exec(compile(text, str(path), "exec"), {"__name__": "__main__", "__file__": str(path)})
    last = capsys.readouterr().out.splitlines()[-1]
    number = float(re.findall(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", last)[-1])
    wanted, tolerance = EXAMPLES[name]
    assert number == pytest.approx(wanted, abs=tolerance), last


def anchor(heading: str) -> str:
    """As the site makes it."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower())


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path, hooks: ModuleType) -> None:
    text = BLOCK.sub("", page.read_text(encoding="utf-8"))
    made = {DOCS / "generated" / name for name in hooks.FILES}
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"\w+:", link):
            continue
        path, _, part = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists() or target in made, f"{link} leads nowhere"
        if part and target.suffix == ".md":
            headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert part in map(anchor, headings), f"{link}: no such heading"
    for name in re.findall(r'^--8<-- "(.+)"$', text, re.MULTILINE):
        assert name in hooks.PAGES


class _Loader(yaml.SafeLoader):
    """Reads mkdocs.yml."""


_Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda loader, suffix, node: suffix)


def test_every_page_is_in_the_navigation() -> None:
    settings = yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), _Loader)

    def leaves(entry: Any) -> Iterator[str]:
        for value in entry.values() if isinstance(entry, dict) else entry:
            yield from [value] if isinstance(value, str) else leaves(value)

    pages = {str(p.relative_to(DOCS)) for p in PAGES if DOCS in p.parents}
    assert set(leaves(settings["nav"])) == pages


def table_rows(page: Path) -> list[list[str]]:
    lines = page.read_text(encoding="utf-8").splitlines()
    return [[c.strip() for c in line.strip("|").split("|")] for line in lines if line[:1] == "|"]


def test_every_equation_has_a_home() -> None:
    homes: dict[int, str] = {}
    for eq, *cells in table_rows(DOCS / "theory" / "equations.md"):
        if found := re.fullmatch(r"\((\d+)\)(?:-\((\d+)\))?", eq):
            for number in range(int(found[1]), int(found[2] or found[1]) + 1):
                assert number not in homes, f"({number}) stands twice"
                homes[number] = cells[1]
                assert "`condyle." in cells[1], f"({number}) has no home"
    assert sorted(homes) == list(range(1, EQUATIONS + 1))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_names_of_code_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    names = re.findall(r"`(condyle(?:\.\w+)+)[^`]*`|^::: (condyle(?:\.\w+)+)", text, re.MULTILINE)
    for name in {a or b for a, b in names} - {"condyle.toml"}:
        assert exists(name), f"{name} does not exist"


def test_everything_public_is_in_the_reference() -> None:
    text = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^::: condyle\.[\w.]*?(\w+)$", text, re.MULTILINE))
    assert set(condyle.__all__) - {"__version__"} <= described
    assert {"ModelResult", "Distribution", "PoseStatus"} <= described
    assert {"write_report", "open_view"} <= described


def test_example_that_fails_ends_the_build(hooks: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "good.py").write_text("assert __name__ == '__main__'")
    hooks.run_examples(tmp_path)
    (tmp_path / "wrong.py").write_text("assert 1 == 2")
    with pytest.raises(AssertionError):
        hooks.run_examples(tmp_path)


def exists(name: str) -> bool:
    """Whether a dotted name leads to a module, class, function, method or field."""
    parts = name.split(".")
    for i in range(len(parts), 0, -1):
        try:
            thing: Any = importlib.import_module(".".join(parts[:i]))
        except ModuleNotFoundError:
            continue
        for part in parts[i:]:
            fields = {**getattr(thing, "__annotations__", {}), **vars(thing)}
            if not hasattr(thing, part) and part not in fields:
                return False
            thing = getattr(thing, part, None)
        return True
    return False


def test_every_variable_and_command_is_described(hooks: ModuleType, tmp_path: Path) -> None:
    hooks.text_pages(tmp_path)
    variables = (tmp_path / "variables.md").read_text(encoding="utf-8")
    for name in hooks.reference_solution(100.0).data_vars:
        row = next(r for r in variables.splitlines() if r.startswith(f"| `{name}` |"))
        assert all(cell.strip() for cell in row.strip("|").split("|")), row
    commands = (tmp_path / "cli.md").read_text(encoding="utf-8")
    assert "## condyle run" in commands and "`--load-point`" in commands
    assert "`--quiet`, `-q`" in commands and "--as-json" not in commands
    for row in (tmp_path / "operations.md").read_text(encoding="utf-8").splitlines()[2:]:
        shared, written_out = (float(cell.strip(" %")) for cell in re.findall(r"[\d.]+%", row))
        assert written_out < 20 < 75 < shared < 100, row  # the gap that sharing closes


def test_nothing_is_fetched_from_elsewhere() -> None:
    for path in [*PAGES, ROOT / "mkdocs.yml", DOCS / "style.css", DOCS / "hooks.py"]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"!\[[^]]*\]\(https?:|<script|@import|<link", text), path


def test_generated_files_are_not_kept() -> None:
    assert "/generated/" in (DOCS / ".gitignore").read_text(encoding="utf-8")


# Command of the table of JSON keys -> how it is called here; compare and bench take too long.
JSON = {
    "condyle new": ("new", "a_robot"),
    "condyle new --list": ("new", "--list"),
    "condyle check": ("check", "masticatory"),
    "condyle check --project": ("check", "--project", "off.toml"),
    "condyle reference": ("reference", "--out", "reference"),
    "condyle run": ("run", "--rate", "20", "--out", "results"),
    "condyle solve": ("solve", "my.toml", "--states", "states.csv", "--out", "t.csv"),
    "condyle forward": ("forward", "my.toml", "--states", "efforts.csv", "--out", "a.csv"),
    "condyle derivatives": (
        *("derivatives", "my.toml", "--states", "states.csv", "--out", "d.csv"),
        *("--of", "effort", "--wrt", "q"),
    ),
    "condyle compare --tradeoff": ("compare", "--tradeoff", "--rate", "20", "--out", "curve"),
    "condyle pose": ("pose", "my.toml", "--joints", "encoders.csv", "--out", "p.csv"),
    "condyle pose --all": (
        *("pose", "gough-stewart", "--joints", "legs.csv", "--out", "m.csv", "--all"),
    ),
    "condyle motion from-c3d": (
        *("motion", "from-c3d", "trial.c3d", "--markers", "markers.toml"),
        *("--mechanism", "masticatory", "--out", "motion.csv"),
    ),
    "condyle map": (
        *("map", "masticatory", "--over", "X=0:3:3 mm", "--quantity", "joint", "--no-figures"),
    ),
    "condyle simulate": ("simulate", "my.toml", "--scenario", "chewing.toml", "--out", "fall"),
    "condyle simulate --check-gains": (
        *("simulate", "my.toml", "--scenario", "drives.toml", "--check-gains"),
    ),
    "condyle simulate --new": ("simulate", "my.toml", "--new", "first.toml"),
    "condyle export controller": (
        *("export", "controller", "my.toml", "--scenario", "sensed.toml"),
        *("--out", "controller"),
    ),
    "condyle export ros2": (
        *("export", "ros2", "my.toml", "--scenario", "sensed.toml", "--out", "package"),
    ),
    "condyle export fmu": ("export", "fmu", "gough-stewart", "--kind", "inverse", "--out", "units"),
    "condyle export acados": ("export", "acados", "gough-stewart", "--out", "acados"),
    "condyle export matlab": ("export", "matlab", "gough-stewart", "--out", "matlab"),
    "condyle export mjcf": ("export", "mjcf", "gough-stewart", "--out", "mujoco"),
    "condyle export c": ("export", "c", "gough-stewart", "--question", "motion", "--out", "c"),
    "condyle plot": ("plot",),
    "condyle plot SOLUTION": (
        *("plot", "results/masticatory.nc", "--figure", "effort", "--out", "figures"),
    ),
    "condyle report": ("report", "results/masticatory.nc"),
    "condyle sweep": ("sweep", "masses.toml", "--out", "rows", "--workers", "1"),
    "condyle cache": ("cache",),
    "condyle bite": ("bite", "human-jaw"),
    "condyle literature": ("literature",),
    "condyle cite": ("cite",),
    "condyle video": ("video", "results/masticatory.nc", "--out", "film.gif", "--fps", "1"),
    "condyle optimise": ("optimise", "held.toml", "--out", "held.csv"),
    "condyle design": ("design", "lighter.toml", "--out", "better"),
    "condyle session": ("session", "session.toml", "--out", "session"),
    "condyle identify": (
        *("identify", "my.toml", "--log", "log.csv", "--study", "fit.toml"),
        *("--out", "fitted.toml"),
    ),
    "condyle calibrate": (
        *("calibrate", "my.toml", "--poses", "poses.csv", "--study", "calib.toml"),
        *("--out", "geometry.toml"),
    ),
    "condyle path": ("path", "my.toml", "--study", "cycle.toml", "--out", "cycle.csv"),
    "condyle excite": ("excite", "my.toml", "--study", "excite.toml", "--out", "path.csv"),
}


def test_json_keys_are_those_of_the_reference(condyle_command: Callable[..., Any]) -> None:
    put_files_of_a_reader(Path.cwd())
    off = bundled_text("masticatory").replace("offset = 13.215", "offset = 13.5")
    Path("off.toml").write_text(off, encoding="utf-8")
    rows = table_rows(DOCS / "reference" / "cli.md")
    told = {row[0].strip("`"): set(re.findall(r"`(\w+)`", row[1])) for row in rows if len(row) == 2}
    long = {"condyle compare", "condyle bench", "condyle bench --realtime"}
    assert set(JSON) | long == {t for t in told if "condyle" in t}
    for name, words in JSON.items():
        outcome = condyle_command(*words, "--json")
        assert outcome.status == 0, outcome.err
        assert set(json.loads(outcome.out)) == told[name], name
