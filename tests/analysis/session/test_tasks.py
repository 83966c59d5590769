"""A session of several tasks: each with cycles, means, tables and a page of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.recorded_jaw import PLATFORM, Jaw
from support.recorded_session import TASKS, write_tasks

import condyle
from condyle.errors import InputError
from condyle.report.measured_session import MeasuredSession


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> tuple[MeasuredSession, dict[str, Jaw]]:
    file, jaws = write_tasks(tmp_path_factory.mktemp("tasks"), {"noise": 5e-5})
    return condyle.measure_session(file), jaws


def gape(jaw: Jaw) -> np.ndarray:
    """How far the incisor is below its place at home, (F,) [m]."""
    point = np.array(condyle.load_mechanism("human-jaw").platform.points["incisor"])
    R = Rotation.from_euler("XYZ", jaw.pose[:, 3:]).as_matrix()
    return point[2] - (R @ point + jaw.pose[:, :3])[:, 2]


def test_every_movement_is_a_cycle_of_its_task(
    tasks: tuple[MeasuredSession, dict[str, Jaw]],
) -> None:
    found, jaws = tasks
    for task, ((count, opening, closing, stop), _) in TASKS.items():
        rows = [row for row in found.cycles if row["task"] == task]
        assert len(rows) == (0 if task == "static" else count), task
        largest = gape(jaws[task]).max()
        for row in rows:
            assert row["range_gape"] == pytest.approx(largest, abs=3e-4)
            assert row["opening"] == pytest.approx(opening, abs=0.06)
            assert row["closing"] == pytest.approx(closing, abs=0.06)
        gaps = [row["occlusal"] + row["rest"] for row in rows[:-1]]
        assert gaps == pytest.approx([stop] * len(gaps), abs=0.12)
        rests = [row["rest"] > 0.5 for row in rows[:-1]]
        assert rests == [stop > 0.5] * len(rests)


def test_means_and_pages_never_mix_tasks(
    tasks: tuple[MeasuredSession, dict[str, Jaw]],
) -> None:
    found, _ = tasks
    mean = found.mean
    assert [*mean["group"].values] == [*mean["task"].values] == [*TASKS]
    for task, ((count, *_), _) in TASKS.items():
        assert int(mean["cycles_group"].sel(group=task)) == (0 if task == "static" else count)
    pages = found._pages("tasks.toml")
    assert [*pages] == [
        "report.html",
        *(f"report-{task}.html" for task in ("open", "protrude", "lateral", "right")),
    ]
    assert "mean of 6 cycles of chew" in pages["report.html"].attrs["options"]
    lowest = [page["pose"].sel(coordinate="beta").values.max() for page in pages.values()]
    assert lowest == pytest.approx([0.2, 0.4, 0.0, 0.0, 0.0], abs=0.01)
    assert not [said for said in found.warnings if "cycles" in said]


def chews(folder: Path, spoiled: Callable[[Jaw], None]) -> MeasuredSession:
    """The trial of chews alone, its markers spoiled."""
    file, jaws = write_tasks(folder, {"noise": 5e-5}, trial=[{"file": "chew1.c3d", "task": "chew"}])
    spoiled(jaws["chew"])
    jaws["chew"].write(folder / "chew1.c3d")
    return condyle.measure_session(file)


def test_a_splint_that_slips_is_a_step_between_closures(
    tmp_path: Path, tasks: tuple[MeasuredSession, dict[str, Jaw]]
) -> None:
    def slip(jaw: Jaw) -> None:
        for name in PLATFORM:
            jaw.at(name)[jaw.t > 3.0] += [0.0, 0.003, 0.0]

    found = chews(tmp_path, slip)
    (said,) = [text for text in found.warnings if "did markers slip" in text]
    record = found.report_tables[0].records[0]
    assert record["closure_step"] == pytest.approx(3e-3, abs=3e-4)
    assert 3.0 < record["closure_step_time"] < 3.9 and "closed jaw is 2.9" in said
    steps = [one["closure_step"] for one in tasks[0].report_tables[0].records]
    assert steps[-1] is None and max(steps[:-1]) < 5e-4
    assert not [text for text in tasks[0].warnings if "slip" in text]


def test_gaps_cost_their_samples(
    tmp_path: Path, tasks: tuple[MeasuredSession, dict[str, Jaw]]
) -> None:
    """Both intervals stay but for their ends, and the cycles that are whole in them, with the
    same numbers."""

    def hide(jaw: Jaw) -> None:
        jaw.at("Lower_FL")[(jaw.t > 3.1) & (jaw.t < 3.5)] = np.nan
        jaw.at("Lower_FR")[(jaw.t > 3.1) & (jaw.t < 3.5)] = np.nan

    found = chews(tmp_path, hide)
    solution, whole = found.solutions["chew1"], tasks[0].solutions["chew1"]
    gap = np.diff(solution["time"].values)
    assert gap.max() == pytest.approx(0.4 + 2 * 0.1, abs=0.02) and (gap > 0.015).sum() == 1
    before = [row for row in tasks[0].cycles if row["task"] == "chew"]
    starts = [row["start"] for row in found.cycles]
    assert len(starts) == 5 and not [s for s in starts if 2.4 < s < 3.3]
    names = ("duration", "peak_contact_left_condyle", "range_gape")
    for name in names:
        assert found.cycles[0][name] == pytest.approx(before[0][name], rel=2e-3)
        assert found.cycles[-1][name] == pytest.approx(before[-1][name], rel=2e-3)
    record = found.report_tables[0].records[0]
    assert record["intervals"] == 2 and record["gaps"] == 1
    assert record["seconds"] == pytest.approx(5.49 - 0.41 - 4 * record["trimmed"], abs=0.02)
    assert solution.sizes["time"] + 39 <= whole.sizes["time"] + 1


def test_measures_of_clinics_are_those_of_the_movements(
    tasks: tuple[MeasuredSession, dict[str, Jaw]],
) -> None:
    """Against the recorded poses, by another way, and closed forms: the fossae fall 40 degrees."""
    found, jaws = tasks
    machine = condyle.load_mechanism("human-jaw")
    point = np.array(machine.platform.points["incisor"])
    for task, jaw in jaws.items():
        rows = [row for row in found.cycles if row["task"] == task]
        turn = Rotation.from_euler("XYZ", jaw.pose[:, 3:])
        x, y, z = (turn.apply(point) + jaw.pose[:, :3] - point).T
        speed = np.linalg.norm(np.diff([x, y, z], axis=1), axis=0).max() * 100
        condyle_ = np.array(machine.contacts[0].point)
        way = np.linalg.norm(turn.apply(condyle_) + jaw.pose[:, :3] - condyle_, axis=1)
        for row in rows:
            assert row["gape"] == pytest.approx(-z.min(), abs=3e-4)
            assert row["protrusion"] == pytest.approx(x.max(), abs=3e-4)
            assert row["lateral_left"] == pytest.approx(y.max(), abs=3e-4)
            assert row["rotation"] == pytest.approx(turn.magnitude().max(), abs=0.005)
            assert row["translation_left"] == pytest.approx(way.max(), abs=3e-4)
            fastest = max(row["opening_speed"], row["closing_speed"])
            assert fastest == pytest.approx(speed, rel=0.03, abs=3e-3)  # m/s, of noise
    by = {task: [r for r in found.cycles if r["task"] == task] for task in jaws}
    for row in by["protrude"] + by["lateral"]:
        assert np.degrees(row["sagittal_inclination_left"]) == pytest.approx(40.0, abs=2.5)
    for row in by["lateral"]:  # to the left: the right condyle goes 3 mm inwards on 4 mm
        angle = np.arctan2(3, 4)
        assert row["transverse_inclination_right"] == pytest.approx(angle, abs=0.06)
        assert row["transverse_inclination_left"] is None
    for row in by["right"]:
        assert row["transverse_inclination_left"] == pytest.approx(angle, abs=0.06)
        assert row["lateral_right"] == pytest.approx(0.006, abs=3e-4)
    (table,) = [table for table in found.report_tables if table.name == "measures"]
    (gapes,) = [r for r in table.records if (r["task"], r["measure"]) == ("open", "gape")]
    values = 1e3 * np.array([row["gape"] for row in by["open"]])
    assert (gapes["unit"], gapes["n"], gapes["trials"]) == ("mm", 3, 1)
    assert gapes["mean"] == pytest.approx(values.mean()) and gapes["sd_between"] is None
    assert gapes["sd_within"] == pytest.approx(values.std(ddof=1))
    assert "Bonwill triangle: 104, 101, 101 mm" in str(table.notes)


def test_inclinations_are_against_the_named_plane(tmp_path: Path) -> None:
    """A plane that falls 10 degrees forwards takes them off; its points are markers or numbers."""
    trial = [{"file": "protrude1.c3d", "task": "protrude"}]
    _, jaws = write_tasks(tmp_path)
    jaw, slope = jaws["protrude"], np.tan(np.radians(10))
    there = {"p": [0.05, 0.0, -0.05 * slope], "q": [0.0, 0.05, 0.0], "r": [0.0, -0.05, 0.0]}
    places = {name: jaw.laboratory(point) for name, point in there.items()}
    plane = {"name": "frankfort", "points": ["p", "q", "r"], "places": places}
    found = condyle.measure_session(write_tasks(tmp_path, trial=trial, plane=plane)[0])
    angles = [np.degrees(row["sagittal_inclination_left"]) for row in found.cycles]
    assert angles == pytest.approx([30.0] * 2, abs=2.0)
    assert "against the frankfort plane" in str(found)
    for points, said in (
        (["p", "q", "nose"], 'has no point or contact "nose", and places gives none'),
        (["incisor", "chin", "p"], "stands upright"),
    ):
        with pytest.raises(InputError, match=said):
            wrong = plane | {"points": points}
            condyle.measure_session(write_tasks(tmp_path, trial=trial, plane=wrong)[0])


def test_the_figure_of_movements_is_of_the_incisal_point(
    tasks: tuple[MeasuredSession, dict[str, Jaw]],
) -> None:
    """Downwards is down, the left side is on the left."""
    found, jaws = tasks
    envelope, arch, speed = found.solutions["lateral1"].condyle.plot.movement().axes
    depth, side = (np.asarray(axes.get_lines()[0].get_xydata()).T for axes in (envelope, arch))
    largest = 1e3 * gape(jaws["lateral"]).max()
    assert -depth[1].min() == pytest.approx(largest, abs=0.3)
    assert side[0].min() == pytest.approx(-6.0, abs=0.3) and side[0].max() < 0.3
    assert "gape [mm]" in speed.get_xlabel()


@pytest.mark.parametrize(("given", "trimmed"), [({}, 0.1), ({"trim": 0.0}, 0.0)])
def test_ends_are_trimmed_of_the_edges_of_filters(
    tmp_path: Path, given: dict[str, float], trimmed: float
) -> None:
    """A head at rest seems to be shaken at the ends: half a period of 5 Hz is taken off."""
    tables = {"trial": [{"file": "static1.c3d", "task": "static"}], "filter": given}
    file, jaws = write_tasks(tmp_path, {"noise": 2e-4, "head": 0.0}, **tables)
    found = condyle.measure_session(file)
    record = found.report_tables[0].records[0]
    t = jaws["static"].t
    assert record["trimmed"] == trimmed
    assert record["seconds"] == pytest.approx(np.ptp(t) - 2 * trimmed)
    # In the middle, and three standard deviations of its noise.
    (vertical,) = [motion.vertical for motion in found.solved.trials[0].motions]
    middle = vertical.felt[len(t) // 3 : 2 * len(t) // 3]
    assert (vertical.felt.max() < 3 * middle.max()) == bool(trimmed)
