"""condyle sweep, run --vary, report --sweep and schema study."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas
import pytest
import tomli_w

from condyle.mechanism import bundled_text

STUDY: dict[str, Any] = {
    "motion": {"file": "trial", "rate": 4.0},
    "load": "none",
    "vary": [{"what": "platform.mass", "range": [0.2, 0.3], "count": 4}],
    "measure": {
        "peak": {"of": "effort", "take": "max_abs", "better": "less"},
        "margin": {"of": "singularity_ratio", "take": "min", "better": "more"},
    },
}


@pytest.fixture
def study(tmp_path: Path) -> Path:
    file = tmp_path / "study.toml"
    file.write_text(tomli_w.dumps(STUDY))
    return file


def test_sweep_and_show(condyle_command: Callable[..., Any], study: Path) -> None:
    done = condyle_command("sweep", study, "--out", "rows", "--workers", 1, "--json", "--figures")
    assert done.status == 0, done.err
    told = json.loads(done.out)
    assert told["rows"] == told["asked"] == 4
    assert told["outcomes"] == [{"status": "ok", "rows": 4, "first_reason": ""}]
    names = {Path(file).name for file in told["files"]}
    assert {"best.csv", "main-effects.csv", "pareto.csv", "sweep-scatter.png"} <= names
    shown = condyle_command("sweep", "--show", "rows", "--csv")
    assert len(Path("rows/rows.csv").read_text().splitlines()) == 1 + 4
    assert list(pandas.read_parquet("rows/rows")["status"]) == ["ok"] * 4
    assert [file.name for file in Path("rows/rows").iterdir()] == ["all.parquet"]
    assert shown.status == 0 and "least peak" in shown.out and "Pareto front" in shown.out
    again = condyle_command("sweep", study, "--out", "rows")
    assert again.status == 2 and "--resume" in again.err


def test_a_machine_that_is_no_jaw_has_no_load(condyle_command: Callable[..., Any]) -> None:
    """The bundled bite force is nobody's default but the jaw's."""
    text = bundled_text("masticatory").replace("right_molar", "tip").replace("incisor", "nose")
    Path("own.toml").write_text(text)
    study = {**STUDY, "mechanism": "own.toml"}
    del study["load"]
    Path("study.toml").write_text(tomli_w.dumps(study))
    done = condyle_command("sweep", "study.toml", "--out", "rows", "--workers", 1)
    assert done.status == 0, done.err
    assert condyle_command("run", "own.toml", "--rate", 4, "--out", "results").status == 0


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "expected a study"),
        (("--show", "."), "is not the folder of a sweep"),
        (("a.toml",), "no such file"),
    ],
)
def test_wrong_calls(condyle_command: Callable[..., Any], words: Any, message: str) -> None:
    done = condyle_command("sweep", *words)
    assert done.status == 2 and message in done.err and done.err.count("\n") == 1


def test_bands_and_sections_of_the_report(condyle_command: Callable[..., Any], study: Path) -> None:
    assert condyle_command("sweep", study, "--out", "rows", "--workers", 1).status == 0
    words = ("--vary", study, "--rate", 4, "--threads", 1, "--out", "results")
    done = condyle_command("run", *words)
    assert done.status == 0, done.err
    made = condyle_command("report", "results/masticatory.nc", "--sweep", "rows")
    assert made.status == 0, made.err
    page = Path("results/masticatory.html").read_text()
    assert '<section id="bands">' in page and '<section id="sweep">' in page
    assert page.count('<img src="data:image/png') == 6


def test_a_study_of_another_mechanism_is_refused(
    condyle_command: Callable[..., Any], study: Path
) -> None:
    study.write_text(tomli_w.dumps({"mechanism": "hexaglide", **STUDY}))
    done = condyle_command("run", "--vary", study, "--rate", 4)
    assert done.status == 2 and 'the study is of "hexaglide"' in done.err


def test_schema_of_studies(condyle_command: Callable[..., Any]) -> None:
    schema = json.loads(condyle_command("schema", "study").out)
    assert schema["title"] == "condyle study" and "vary" in schema["properties"]
