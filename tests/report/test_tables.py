"""Tables and figures of the paper: what they say, beside what, and in which form."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import condyle
from condyle.analysis.comparison import Comparison, compare
from condyle.motion import Motion
from condyle.report import figures
from condyle.report.figures.paper_figures import figure_5, figure_8, figure_9
from condyle.report.tables import ReportTable
from condyle.report.tables.comparison_tables import differences, table_1, table_2


def test_table_1_beside_the_paper(comparison: Comparison) -> None:
    table = table_1(comparison)
    assert [record["paper_name"] for record in table.records] == [
        "GM 1", "L-D 1", "GM 2", "L-D 2", "6RSS GM", "6RSS L-D",
    ]  # fmt: skip
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


def test_table_2_and_differences(comparison: Comparison) -> None:
    table = table_2(comparison)
    assert table.columns == ("Mechanism", "F", "F_EE", "F_SM", "F_GS")
    assert [row[0] for row in table.rows] == ["RAPM [N m]", "6RSS [N m]", "saved by contacts"]
    for record in table.records[:8]:
        assert record["ratio"] == pytest.approx(record["value"] / record["paper"])
    held, free = (table.records[i]["value"] for i in (0, 4))
    assert table.records[8]["value"] == pytest.approx(1 - held / free)
    assert "(0.0207, 1.0" in table.rows[0][1]
    said = " ".join(table.notes)
    for fact in ("stands in for the authors' robot", "calibrated", "synthetic", "without"):
        assert fact in said
    table = differences(comparison)
    assert len(table.records) == 6 + 1
    assert max(record["effort"] for record in table.records) < 1e-10
    assert table.records[-1]["contact_force"] is None
    assert [row[0] for row in table.rows][-1] == "lagrange core, no contacts"
    assert table.rows[-1][2] == "-"


def test_no_paper_beside_another_mechanism() -> None:
    """Four chains: the paper says nothing about them."""
    machine, t = condyle.load_mechanism("masticatory"), np.linspace(0, 1, 20)
    motion = Motion.from_arrays(t, np.zeros((20, 4)), ["X", "Y", "alpha", "beta"])
    four = machine.replace(chains=machine.chains[:4])
    found = compare(four, motion, formulations=["momentum"])
    assert table_1(found).columns == ("Model", "Symbolic s", "Numeric s", "Total s")
    (row,) = table_2(found).rows
    assert row[0] == "with contacts [N m]" and "(" not in row[1]
    text = str(found)
    assert not any(word in text for word in ("35.861", "0.0207", "stands in", "synthetic"))
    assert "Not available: without contacts. Reason: a platform without contacts" in text


def test_text_markdown_and_files(comparison: Comparison, tmp_path: Path) -> None:
    """Text is aligned, markdown has cells for all columns, CSV gives the numbers back."""
    text = str(comparison)
    assert text.isascii()
    lines = table_2(comparison).text().splitlines()
    assert len({len(line) for line in lines[1:6]}) == 1
    assert all(len(line) <= 100 for line in text.splitlines() if line.startswith(("- ", "  ")))
    for table in (table_1(comparison), table_2(comparison), differences(comparison)):
        lines = [line for line in table.markdown().splitlines() if line.startswith("|")]
        assert len(lines) == 2 + len(table.rows)
        assert {line.count("|") for line in lines} == {len(table.columns) + 1}
    paths = comparison.save(tmp_path)
    assert {*paths} == {*tmp_path.iterdir()} and {path.name for path in paths} == {
        f"{name}.{kind}" for name in ("differences", "table-1", "table-2") for kind in ("md", "csv")
    }
    assert "calibrated" in (tmp_path / "table-2.md").read_text()
    with pytest.raises(condyle.InputError, match="does not exist"):
        comparison.save(tmp_path / "nowhere")
    records = [{"name": "a, b", "x": 0.1, "y": None}, {"name": "c", "x": 1 / 3, "y": 2.0}]
    ReportTable("t", "T", (), [], records, []).write_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == ["a, b", "c"]
    assert [float(row["x"]) for row in rows] == [0.1, 1 / 3]
    assert [row["y"] for row in rows] == ["", "2"]


def curve(figure: Figure, panel: int, label: str) -> np.ndarray:
    lines = {line.get_label(): line for line in figure.axes[panel].get_lines()}
    return np.asarray(lines[label].get_ydata())


def test_papers_figures(comparison: Comparison, monkeypatch: pytest.MonkeyPatch) -> None:
    """5 has path and coordinates, 8 the differences, 9 leaves the bite out; all are written."""
    solution = comparison.solution
    five, eight, nine = figure_5(solution), figure_8(comparison), figure_9(solution)
    assert len(five.axes) == 4 + 6 and [axes.name for axes in five.axes].count("3d") == 1
    assert [axes.get_title("left") for axes in eight.axes[:3]] == [
        "momentum direct",
        "momentum direct − momentum core",
        "momentum direct − lagrange direct",
    ]
    one, two = (comparison.run("momentum", route) for route in ("direct", "core"))
    assert one is not None and two is not None
    line = curve(eight, 1, "temporalis left")
    np.testing.assert_array_equal(line, one.effort[:, 0] - two.effort[:, 0])
    titles = [axes.get_title("left") for axes in nine.axes[:3]]
    assert titles == ["platform", "cranks", "couplers"]
    cranks = solution["share"].sel(part="cranks").values[:, 1]
    np.testing.assert_array_equal(curve(nine, 1, "temporalis right"), cranks)
    written: dict[str, object] = {}
    monkeypatch.setattr(figures, "save_drawn", lambda plots, *_: written.update(plots))
    figures.save_figures(solution, comparison, Path())
    names = ["5-motion", "6-jacobian", "7-load", "8-torque", "9-share"]
    assert list(written) == [f"figure-{name}" for name in names]
