"""condyle sweep, run --vary and report --sweep."""

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
SWEEP = ("sweep", "study.toml", "--out", "rows")


@pytest.mark.slow
def test_sweep_show_and_report(run: Any, refused: Any) -> None:
    Path("study.toml").write_text(tomli_w.dumps(STUDY))
    done = run(*SWEEP, "--workers", 1)
    assert done.status == 0, done.err
    assert done.data["rows"] == done.data["asked"] == 4
    assert done.data["outcomes"] == [{"status": "ok", "rows": 4, "first_reason": ""}]
    names = {Path(file).name for file in done.data["files"]}
    assert {"best.csv", "main-effects.csv", "pareto.csv"} <= names
    shown = run("sweep", "--show", "rows", "--csv")
    assert len(Path("rows/rows.csv").read_text().splitlines()) == 1 + 4
    assert list(pandas.read_parquet("rows/rows")["status"]) == ["ok"] * 4
    assert [file.name for file in Path("rows/rows").iterdir()] == ["all.parquet"]
    assert shown.status == 0 and "least peak" in shown.out and "Pareto front" in shown.out
    refused(*SWEEP, said="--resume")

    done = run("run", "--vary", "study.toml", "--rate", 4, "--threads", 1)
    assert done.status == 0, done.err
    made = run("report", "results/masticatory.nc", "--sweep", "rows")
    assert made.status == 0, made.err
    page = Path("results/masticatory.html").read_text()
    assert '<section id="bands">' in page and '<section id="sweep">' in page
    assert page.count('<img src="data:image/png') == 6


def test_a_part_of_a_sweep_and_what_is_missing(run: Any, refused: Any) -> None:
    vary = [{"what": "platform.mass", "range": [0.2, 0.3], "count": 8}]
    Path("study.toml").write_text(tomli_w.dumps({**STUDY, "vary": vary}))
    done = run(*SWEEP, "--part", "2/2", "--workers", 1)
    assert done.status == 0, done.err
    assert done.data == {"rows": 4, "missing": "", "folder": "rows"}
    assert run(*SWEEP, "--part", "/2", "--missing").out == "--array=1\n"
    assert run(*SWEEP, "--part", "1/2", "--workers", 1).status == 0
    assert run(*SWEEP, "--part", "/2", "--missing").data["missing"] == []
    refused(*SWEEP, "--missing", said='--part "/n"')
    refused(*SWEEP, "--part", "3/2", said="i from 1 to n")


def test_studies_of_other_machines(run: Any, refused: Any) -> None:
    """The bundled bite force is nobody's default but the jaw's; a run is of its study's machine."""
    text = bundled_text("masticatory").replace("right_molar", "tip").replace("incisor", "nose")
    Path("own.toml").write_text(text)
    study = {"mechanism": "own.toml", **STUDY}
    del study["load"]
    Path("study.toml").write_text(tomli_w.dumps(study))
    assert run(*SWEEP, "--workers", 1).status == 0
    Path("study.toml").write_text(tomli_w.dumps({"mechanism": "hexaglide", **STUDY}))
    words = ("run", "--vary", "study.toml", "--rate", 4)
    refused(*words, said='the study is of "hexaglide"')
