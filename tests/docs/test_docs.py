"""The documentation tells the truth: its blocks and commands run, its links and names exist.

A ```python block is run, page by page in one namespace and one folder, with the ```console
commands between. It is left alone only where it is an excerpt of the sources, word for word, or
where a line `<!-- not run: why -->` stands above it.
"""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from support.machine_log import DRIVES, HELD, SHORT_PATH, STUDY, write_log, write_poses
from support.recorded_jaw import record
from support.recorded_session import write_session
from support.speeds import few

import condyle
from condyle.backends.compiler import CompilerError, find_compiler
from condyle.cli.command import registered
from condyle.distribution import OBJECTIVES
from condyle.dynamics import FORMULATIONS
from condyle.kinematics.chain import FAMILIES
from condyle.mechanism import bundled_text
from condyle.mechanism.chain import CHAINS
from condyle.mechanism.surface import SURFACES
from condyle.motion import write_table
from condyle.quantities import QUANTITIES
from condyle.questions import QUESTIONS
from condyle.questions.law import CONTROLLERS
from condyle.questions.load import LOADS
from condyle.report.figures import PLOTS
from condyle.report.panel import PANEL_GROUPS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*([ROOT / "README.md"] * (ROOT / "README.md").exists()), *sorted(DOCS.rglob("*.md"))]
PAGES = [page for page in PAGES if "generated" not in page.parts]
DAILY = [page for page in PAGES if page.name in ("README.md", "tutorial.md")]
# Servers and long work: of these commands only the options are looked at.
LONG = {"view", "bench", "compare"}
BLOCK = re.compile(r"^```(\w*)[^\n]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
EQUATIONS = 67
# Pages whose numbers are many: interpreted they would take minutes.
COMPILED = {"elsewhere.md", "kernels.md", "simulate.md", "controllers.md", "tutorial-simulate.md"}
COMPILED |= {"foods.md", "bite-control.md", "lifting.md", "condyle-lifts.md"}
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
def hooks() -> ModuleType:
    return importlib.import_module("hooks")


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a page registers is gone after it; no page opens a window."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    registers = (FORMULATIONS, PLOTS, PANEL_GROUPS, QUANTITIES, QUESTIONS, CONTROLLERS, LOADS,
                 SURFACES, CHAINS, FAMILIES, OBJECTIVES)  # fmt: skip
    names = [set(register) for register in registers]
    yield
    for register, before in zip(registers, names, strict=True):
        for name in set(register) - before:
            del register[name]


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files that commands in the text name without making them."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copytree(ROOT / "examples", folder / "examples")
    texts = {
        **dict.fromkeys(("my.toml", "robot.toml"), bundled_text("masticatory")),
        "study.toml": MASSES,
        "fit.toml": STUDY,
        "calib.toml": 'numbers = ["chain.*.actuator.zero"]',
        "excite.toml": SHORT_PATH,
        "held.toml": HELD,
        "sensed.toml": DRIVES,
        "bite.csv": "X,Y,alpha,beta,Fz\n0,0,0,0,-100\n",
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    jaw = record(noise=5e-5)
    jaw.write(folder / "trial.c3d")
    jaw.write_tables(folder / "markers.toml")
    write_session(folder, 2, 2.5)
    write_log(folder / "log.csv")
    write_poses(folder / "poses.csv")
    q = ["X", "Y", "alpha", "beta"]
    rates = [prefix + name for prefix in ("d", "dd") for name in q]
    chains, legs, muscles = (
        condyle.load_mechanism(name).chain_names
        for name in ("masticatory", "gough-stewart", "human-jaw-muscles")
    )
    columns = {
        "efforts": [*q, *rates[:4], *(f"tau_{chain}" for chain in chains)],
        "states": [*q, *rates],
        "encoders": [f"joint_{chain}" for chain in chains],
        "legs": [f"joint_{leg}" for leg in legs],
        "path": ["t", *q],
        "measured": ["t", *(f"emg_{muscle}" for muscle in muscles[:8])],
    }
    for name, head in columns.items():
        rows = [[0.05 * k if column == "t" else 0.0 for column in head] for k in range(8)]
        write_table(folder / f"{name}.csv", dict(zip(head, np.transpose(rows), strict=True)))
    return folder


def run_page(page: Path, command: Callable[..., Any], sources: str) -> int:
    """Run a page's blocks in order; returns how many."""
    namespace: dict[str, Any] = {"__name__": "page"}
    count = 0
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


@pytest.mark.parametrize("page", few(PAGES, *DAILY), ids=name_of)
def test_blocks_and_commands_run(
    page: Path,
    condyle_command: Callable[..., Any],  # also moves to an empty folder
    files: Path,
    sources: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if page.name in COMPILED:
        monkeypatch.setenv("CONDYLE_BACKEND", "compiled")
        try:
            find_compiler()
        except CompilerError as error:
            pytest.skip(f"kernels need a compiler: {error}")
    shutil.copytree(files, Path.cwd(), dirs_exist_ok=True)
    count = run_page(page, condyle_command, sources)
    assert count == RUN.get(page.name, count)


@pytest.mark.ci
def test_commands_of_the_readme_run(
    condyle_command: Callable[..., Any], files: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those in its tables and lists, in their order, since one shows what another wrote."""
    text = PAGES[0].read_text(encoding="utf-8")
    lines = re.findall(r"`(condyle [^`]+)`|^(condyle .+)$", text, re.MULTILINE)
    commands = [*dict.fromkeys((a or b).split("  #")[0].strip() for a, b in lines)]
    assert len(commands) > 10
    monkeypatch.setenv("CONDYLE_BACKEND", "auto")
    shutil.copytree(files / "examples", Path("examples"))
    design = Path("examples/design.toml")
    text = design.read_text(encoding="utf-8").replace("rate = 50.0", "rate = 5.0")
    design.write_text(text.replace("count = 5", "count = 2"), encoding="utf-8")  # a tenth of it
    for command in commands:
        run_command(condyle_command, shlex.split(command)[1:])


def test_what_is_named_exists(sources: str) -> None:
    """Excerpts are of the sources; commands are commands, and targets of make are targets."""
    assert all(block.text in sources for block in blocks(DOCS / "chains.md") if block.kind)
    importlib.import_module("condyle.cli.commands")  # registers them
    known = {words.split()[0] for words, _ in registered()}
    for page in PAGES:
        used = re.findall(r"`condyle ([a-z]+)", page.read_text(encoding="utf-8"))
        assert set(used) <= known, name_of(page)
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = re.findall(r"\bmake ([a-z]+)", PAGES[0].read_text(encoding="utf-8"))
    assert {"run", "test", "quick"} <= {*named} <= {*re.findall(r"^([a-z]+):", makefile, re.M)}


# Example -> the number in its last line, and how near it must be.
EXAMPLES = {
    "chew": (4.0, 0.2),
    "compare_surfaces": (-6.4285, 1e-3),
    "forward_kinematics": (2.979e-05, 1e-7),
    "own_mechanism": (0.244891, 2e-6),
    "reference": (0.925334, 2e-6),
    "session": (1.572, 0.03),
    "states_batch": (0.055845, 2e-6),
}


@pytest.mark.parametrize("name", few(EXAMPLES, "own_mechanism", "states_batch"))
def test_examples(
    name: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    path = ROOT / "examples" / f"{name}.py"
    assert {one.stem for one in path.parent.glob("*.py")} == set(EXAMPLES)
    text = path.read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    if name == "chew":  # one stroke of five
        monkeypatch.delenv("CONDYLE_BACKEND")
        text = text.replace("SECONDS = 5.0", "SECONDS = 1.9")
    exec(compile(text, str(path), "exec"), {"__name__": "__main__", "__file__": str(path)})
    last = capsys.readouterr().out.splitlines()[-1]
    number = float(re.findall(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", last)[-1])
    wanted, tolerance = EXAMPLES[name]
    assert number == pytest.approx(wanted, abs=tolerance), last


def anchor(heading: str) -> str:
    """As the site makes it."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower())


def test_links_and_names_lead_somewhere(hooks: ModuleType) -> None:
    """Pages, headings and code; and nothing is fetched from elsewhere."""
    made = {DOCS / "generated" / name for name in hooks.FILES}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        names = re.findall(r"`(condyle(?:\.\w+)+)[^`]*`|^::: (condyle(?:\.\w+)+)", text, re.M)
        for name in {a or b for a, b in names} - {"condyle.toml"}:
            assert exists(name), f"{name_of(page)}: {name} does not exist"
        text = BLOCK.sub("", text)
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"\w+:", link):
                continue
            path, _, part = link.partition("#")
            target = (page.parent / path).resolve() if path else page
            assert target.exists() or target in made, f"{name_of(page)}: {link} leads nowhere"
            if part and target.suffix == ".md":
                headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.M)
                assert part in map(anchor, headings), f"{name_of(page)}: {link}: no such heading"
        for name in re.findall(r'^--8<-- "(.+)"$', text, re.MULTILINE):
            assert name in hooks.PAGES
    for path in [*PAGES, ROOT / "mkdocs.yml", DOCS / "style.css", DOCS / "hooks.py"]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"!\[[^]]*\]\(https?:|<script|@import|<link", text), path
    assert "/generated/" in (DOCS / ".gitignore").read_text(encoding="utf-8")


def test_every_equation_has_a_home() -> None:
    """One, in the table's third column."""
    text = (DOCS / "theory" / "equations.md").read_text(encoding="utf-8")
    row = r"^\| *\((\d+)\)(?:-\((\d+)\))? *\|[^|]*\|[^|]*`condyle\."
    found = [(int(a), int(b or a)) for a, b in re.findall(row, text, re.MULTILINE)]
    numbers = [number for first, last in found for number in range(first, last + 1)]
    assert sorted(numbers) == list(range(1, EQUATIONS + 1))


def test_names_of_the_index_lead_to_their_source(hooks: ModuleType) -> None:
    index = importlib.import_module("paper_index")
    for name in index.names():
        module, text = index.source(name)
        assert name.rpartition(".")[2] in text or module.__name__ == name, name
    page = index.with_links((DOCS / index.INDEX).read_text(encoding="utf-8"), index.INDEX)
    assert not re.search(r"(?<!\[)`condyle\.", page)
    assert "[`Model.bias`](code.md#condyle.Model.bias" in page
    assert "([API](../reference/api.md#condyle.Model))" in page


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


@pytest.mark.ci
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
