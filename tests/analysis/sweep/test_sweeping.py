"""Rows of a study: right, in order, whoever does them, and none lost or doubled."""

import errno
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomli_w
import xarray as xr
from support.children import PATIENCE, start

import condyle
from condyle.analysis import workers as pool
from condyle.analysis.sweep import open_sweep, study_folder
from condyle.analysis.sweep.part import solve_part
from condyle.analysis.workers import LostWorkerError

from .conftest import MACHINE, STUDY, masses, same


def test_rows_in_the_order_of_the_grid(alone: xr.Dataset) -> None:
    """A variant without a result is a row with its reason."""
    points, bases = (STUDY["vary"][i]["values"] for i in (1, 2))
    grid = np.array([(m, p, b) for m in np.linspace(0.2, 0.3, 5) for p in points for b in bases])
    assert alone["variant"].values.tolist() == list(range(20))
    for i, name in enumerate(alone.attrs["parameters"]):
        np.testing.assert_array_equal(alone[name].values, grid[:, i])
    refused, far = alone.isel(row=2), alone.isel(row=1)
    assert refused["status"] == "refused" and "expected a value above 0" in refused["reason"].item()
    assert far["status"] == "unreachable"
    assert 'chain "temporalis_left" cannot reach M' in far["reason"].item()
    failed = alone["status"].values != "ok"
    assert np.isnan(alone["peak"].values[failed]).all()
    assert np.isfinite(alone["peak"].values[~failed]).all() and (~failed).sum() == 5
    assert not any(alone["reason"].values[~failed])


def test_measures_are_those_of_the_mechanism_solved_alone(alone: xr.Dataset) -> None:
    """Kernels of a study leave nothing out that is zero here: other roundings, no more."""
    for row in (0, 16):
        one = alone.isel(row=row)
        mechanism = MACHINE.set("platform.mass", one["platform.mass"].item())
        solution = condyle.derive(mechanism).solve(condyle.trial_motion(MACHINE, rate=4.0))
        effort = solution["effort"].values
        load = solution["contact_force"].sel(contact="left_condyle").values.min()
        wanted = {"peak": np.abs(effort).max(), "load": load}
        wanted["margin"] = solution["singularity_ratio"].values.min()
        rms = np.sqrt((effort**2).mean(axis=0))
        wanted |= {f"rms.{n}": x for n, x in zip(mechanism.chain_names, rms, strict=True)}
        assert {name: one[name].item() for name in wanted} == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("scheduler", ["processes", "threads"])
def test_whoever_does_it_the_bits_are_the_same(alone: xr.Dataset, scheduler: str) -> None:
    same(alone, condyle.sweep(STUDY, workers=2, scheduler=scheduler))


def test_several_motions_are_rows_of_their_own(alone: xr.Dataset) -> None:
    motions = [{"file": "trial", "rate": 4.0}, {"file": "trial", "rate": 2.0}]
    both = condyle.sweep({**STUDY, "motion": motions}, workers=1)
    assert both.sizes["row"] == 2 * alone.sizes["row"] and "motion" in both
    np.testing.assert_array_equal(both["peak"].values[::2], alone["peak"].values)


def wait_for_parts(folder: Path, count: int, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while len(list(folder.glob("rows/part-*.parquet"))) < count and time.monotonic() < end:
        time.sleep(0.01)


@pytest.mark.ci
def test_dask_gives_the_same_bits_and_outlives_a_worker(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    study, folder = masses(80), tmp_path / "sweep"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def kill() -> None:
            wait_for_parts(folder, 2)
            os.kill(victim, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        there = condyle.sweep(study, folder, scheduler=cluster.scheduler_address)
        killer.join()
    same(condyle.sweep(study, workers=1), there)


@pytest.mark.slow
def test_killed_at_any_instant_it_goes_on(tmp_path: Path) -> None:
    study = masses(60)
    file, folder = tmp_path / "study.toml", tmp_path / "sweep"
    file.write_text(tomli_w.dumps(study))
    command = [sys.executable, "-m", "condyle", "sweep", str(file), "--out", str(folder)]
    with subprocess.Popen([*command, "--workers", "2"], stdout=subprocess.DEVNULL) as process:
        wait_for_parts(folder, 5)
        time.sleep(np.random.default_rng().uniform(0.0, 0.05))
        process.kill()
    assert open_sweep(folder).sizes["row"] % 4 == 0  # what is there can be read
    same(condyle.sweep(study, workers=1), condyle.sweep(file, folder, workers=1, resume=True))


class _Deadly:
    """Work that kills its process once, at part 2."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __call__(self, job: Any, part: int) -> Any:
        if part == 2 and self.file.exists():
            self.file.unlink()
            os.kill(os.getpid(), signal.SIGKILL)
        return solve_part(job, part)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked only there")
def test_a_worker_that_is_killed_is_told_and_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: xr.Dataset
) -> None:
    kill, folder = tmp_path / "kill", tmp_path / "sweep"
    kill.touch()
    monkeypatch.setattr("condyle.analysis.sweep.sweeping.solve_part", _Deadly(kill))
    with pytest.raises(LostWorkerError, match="--resume"):
        condyle.sweep(STUDY, folder, workers=2)
    assert not kill.exists()
    same(alone, condyle.sweep(STUDY, folder, workers=2, resume=True))


def test_a_part_that_nobody_does_is_told() -> None:
    errors = {"enough memory": BrokenExecutor(), "gave up on a part: gone": CancelledError("gone")}
    for said, error in errors.items():
        with pytest.raises(LostWorkerError, match=said), pool._pool(None, 1, "threads"):
            raise error


def test_a_full_disk_is_told_and_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, alone: xr.Dataset
) -> None:
    written, writer = [], study_folder.pq.ParquetWriter
    real = writer.write_table

    def write(self: Any, table: Any, **options: Any) -> None:
        written.append(table)
        if len(written) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(self, table, **options)

    folder = tmp_path / "sweep"
    with monkeypatch.context() as full:
        full.setattr(writer, "write_table", write)
        with pytest.raises(condyle.InputError, match="No space left"):
            condyle.sweep(STUDY, folder, workers=1)
    assert len(list((folder / "rows").iterdir())) == 2  # two parts, nothing half
    assert open_sweep(folder).sizes["row"] == 8
    same(alone, condyle.sweep(STUDY, folder, workers=1, resume=True))


def test_a_changed_study_is_refused_with_the_difference(tmp_path: Path) -> None:
    """Solutions are kept on request."""
    small = {**masses(2), "solutions": True}
    table = condyle.sweep(small, tmp_path, workers=1)
    for row in range(2):
        solution = condyle.open_solution(tmp_path / "solutions" / f"{row:09d}-0.nc")
        assert solution.condyle.mechanism.platform.mass == table["platform.mass"].values[row]
        assert abs(solution["effort"].values).max() == table["peak"].values[row]
    other = {**small, "vary": [{**small["vary"][0], "range": [0.2, 0.35]}]}
    heavier = MACHINE.set("chain.masseter_left.coupler.com", 0.4)
    for study, options, said in (
        (small, {}, "--resume"),
        (other, {"resume": True}, r"range\[1\] was 0.3, is 0.35"),
        (small, {"resume": True, "mechanism": heavier}, r"coupler\.com was"),
    ):
        with pytest.raises(condyle.InputError, match=said):
            condyle.sweep(study, tmp_path, workers=1, **options)
    assert json.loads((tmp_path / study_folder.STUDY).read_text())["rows"] == 2


@pytest.mark.slow
def test_ctrl_c_ends_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    study, real = masses(40), study_folder.Store.write

    def write(self: Any, part: int, rows: Any) -> None:
        real(self, part, rows)
        if part == 1:
            raise KeyboardInterrupt

    with monkeypatch.context() as pressed, pytest.raises(KeyboardInterrupt):
        pressed.setattr(study_folder.Store, "write", write)
        condyle.sweep(study, tmp_path, workers=2)
    there = open_sweep(tmp_path).sizes["row"]
    assert 0 < there <= 40 and there % 4 == 0
    whole = condyle.sweep(study, tmp_path, workers=1, resume=True)
    assert whole["variant"].values.tolist() == list(range(40))


def test_what_is_wrong_is_told_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "TIMEOUT", 1.0)
    twice = {"peak": {"of": "effort", "take": "max_abs", "over": ["time", "time"]}}
    for workers, scheduler, measure, message in (
        (0, "processes", {}, "at least 1"),
        (None, "slurm", {}, "expected processes, threads, or the address"),
        (2, "dask", {}, "expected processes, threads, or the address"),
        (None, "tcp://127.0.0.1:9", {}, "no Dask scheduler answers"),
        (3, "tcp://127.0.0.1:9", {}, "existing scheduler"),
        (1, "processes", {"measure": twice}, 'over has "time" 2 times'),
    ):
        with pytest.raises(condyle.InputError, match=message) as caught:
            condyle.sweep(STUDY | measure, tmp_path / "a", workers=workers, scheduler=scheduler)
        assert "\n" not in str(caught.value) and [*tmp_path.iterdir()] == []


def test_a_folder_from_a_stranger(tmp_path: Path) -> None:
    condyle.sweep(masses(2), tmp_path, workers=1)
    good = (tmp_path / "study.json").read_text()
    [rows] = (tmp_path / "rows").iterdir()
    whole = rows.read_bytes()
    for said in ("[]", "3", "[" * 9000, "{}", good.replace('"rows": ', '"rows": "x" , "y": ')):
        (tmp_path / "study.json").write_text(said)
        with pytest.raises(condyle.InputError, match="cannot be read"):
            open_sweep(tmp_path)
    (tmp_path / "study.json").write_text(good)
    table = pq.read_table(rows)
    wide = table.append_column("more", table.column("variant"))
    long = pa.concat_tables([table, table])
    for made, words in ((wide, "columns that its study does not have"), (long, "and its study")):
        pq.write_table(made, rows)
        with pytest.raises(condyle.InputError, match=words):
            open_sweep(tmp_path)
    rng = random.Random(4)
    for _ in range(40):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 5)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        rows.write_bytes(bytes(data[: rng.choice((len(data), rng.randrange(len(data))))]))
        with suppress(condyle.CondyleError):
            open_sweep(tmp_path)


MEMORY = """
import os, resource, sys, condyle
os.environ.pop("CONDYLE_BACKEND", None)  # by numpy it takes minutes
vary = {"what": "platform.mass", "range": [0.2, 0.3]}
measure = {"peak": {"of": "effort", "take": "max_abs"}}
for count in (500, 12_000):
    study = {"motion": {"file": "reference", "rate": 2.0}, "vary": [vary],
             "measure": measure, "sampling": {"kind": "sobol", "count": count}}
    found = condyle.sweep(study, out=f"{sys.argv[1]}/{count}", workers=2)
    assert found.sizes["row"] == count
    who = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    print(max(resource.getrusage(one).ru_maxrss for one in who))
"""


@pytest.mark.ci
@pytest.mark.usefixtures("compiler_command")
def test_many_variants_take_the_memory_of_few(tmp_path: Path) -> None:
    """Of the process that gathers and of those that work, the largest.

    All solutions, of 11 samples, would be 9 KiB a variant, 100 MiB.
    """
    child = start(MEMORY, tmp_path)
    out, err = child.communicate(timeout=PATIENCE)
    assert not child.returncode, err
    few, many = map(int, out.split())
    assert many - few < 40_000  # KiB
