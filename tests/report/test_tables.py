"""The tables: what they say, beside what, and in which form."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

import condyle
from condyle.analysis.comparison import Comparison, compare
from condyle.motion import Motion
from condyle.report.tables import Table, save_tables, tables_text
from condyle.report.tables.comparison_tables import differences, table_1, table_2


@pytest.fixture(scope="module")
def without_paper() -> Comparison:
    """Four chains: a mechanism that the paper says nothing about."""
    mechanism = condyle.load_mechanism("masticatory")
    t = np.linspace(0, 1, 20)
    motion = Motion.from_arrays(t, np.zeros((20, 4)), ["X", "Y", "alpha", "beta"])
    four = mechanism.replace(chains=mechanism.chains[:4])
    return compare(four, motion, formulations=["momentum"])


def test_table_1_beside_the_paper(comparison: Comparison) -> None:
    table = table_1(comparison)
    assert [record["paper_name"] for record in table.records] == [
        "GM 1", "L-D 1", "GM 2", "L-D 2", "6RSS GM", "6RSS L-D",
    ]  # fmt: skip
    published = [record["total_paper"] for record in table.records]
    assert published == pytest.approx([35.861, 61.265, 8.582, 10.041, 7.258, 10.018])
    first, second = table.records[:2]
    assert first["samples"] == comparison.samples == 101
    assert first["total"] == first["symbolic"] + first["numeric"]
    assert first["numeric_ratio"] == pytest.approx(first["numeric"] / 14.369)
    assert first["of_gm1"] == first["of_gm1_paper"] == 1
    assert second["of_gm1_paper"] == pytest.approx(61.265 / 35.861)
    assert "101 samples" in table.title
    said = " ".join(table.notes)
    for fact in ("does not state its number of samples", "i7-8700K", "23.9% by the paper's table"):
        assert fact in said


def test_table_2_beside_the_paper(comparison: Comparison) -> None:
    table = table_2(comparison)
    assert table.columns == ("Mechanism", "F", "F_EE", "F_SM", "F_GS")
    assert [row[0] for row in table.rows] == ["RAPM [N m]", "6RSS [N m]", "saved by contacts"]
    for record in table.records[:8]:
        assert record["ratio"] == pytest.approx(record["value"] / record["paper"])
        assert 0.8 < record["ratio"] < 1.2
    saved = {r["index"]: r["paper"] for r in table.records if r["mechanism"] == "saved"}
    assert saved["F_EE"] == pytest.approx(0.7232, abs=5e-5)
    held, free = (table.records[i]["value"] for i in (0, 4))
    assert table.records[8]["value"] == pytest.approx(1 - held / free)
    assert "(0.0207, 1.0" in table.rows[0][1]
    said = " ".join(table.notes)
    for fact in ("stands in for the authors' robot", "calibrated", "synthetic", "without"):
        assert fact in said


def test_differences(comparison: Comparison) -> None:
    table = differences(comparison)
    assert len(table.records) == 6 + 1
    assert max(record["effort"] for record in table.records) < 1e-10
    assert table.records[-1]["contact_force"] is None
    assert [row[0] for row in table.rows][-1] == "lagrange core, no contacts"
    assert table.rows[-1][2] == "-"


def test_no_paper_beside_another_mechanism(without_paper: Comparison) -> None:
    assert table_1(without_paper).columns == ("Model", "Symbolic s", "Numeric s", "Total s")
    rows = table_2(without_paper).rows
    assert [row[0] for row in rows] == ["with contacts [N m]"]
    assert "(" not in rows[0][1]
    text = tables_text(without_paper)
    assert "35.861" not in text and "0.0207" not in text
    assert "stands in" not in text and "synthetic" not in text
    assert "Not available: without contacts. Reason: a platform without contacts" in text


def test_text_is_aligned_and_short(comparison: Comparison) -> None:
    text = str(comparison)
    assert text == tables_text(comparison)
    assert text.isascii()
    table = table_2(comparison).text().splitlines()
    assert len({len(line) for line in table[1:6]}) == 1
    assert all(len(line) <= 100 for line in text.splitlines() if line.startswith(("- ", "  ")))


def test_markdown_has_cells_for_all_columns(comparison: Comparison) -> None:
    for table in (table_1(comparison), table_2(comparison), differences(comparison)):
        lines = [line for line in table.markdown().splitlines() if line.startswith("|")]
        assert len(lines) == 2 + len(table.rows)
        assert {line.count("|") for line in lines} == {len(table.columns) + 1}


def test_csv_gives_the_numbers_back(tmp_path: Path) -> None:
    records = [{"name": "a, b", "x": 0.1, "y": None}, {"name": "c", "x": 1 / 3, "y": 2.0}]
    Table("t", "T", (), [], records, []).write_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["a, b", "c"]
    assert [float(row["x"]) for row in rows] == [0.1, 1 / 3]
    assert [row["y"] for row in rows] == ["", "2"]


def test_saved_files(comparison: Comparison, tmp_path: Path) -> None:
    paths = save_tables(comparison, tmp_path)
    assert sorted(path.name for path in paths) == sorted(p.name for p in tmp_path.iterdir())
    assert {path.name for path in paths} == {
        f"{name}.{kind}" for name in ("differences", "table-1", "table-2") for kind in ("md", "csv")
    }
    assert "calibrated" in (tmp_path / "table-2.md").read_text()
    with pytest.raises(condyle.InputError, match="does not exist"):
        save_tables(comparison, tmp_path / "nowhere")
