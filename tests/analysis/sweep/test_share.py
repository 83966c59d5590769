"""A sweep in parts on several machines: the rows of one that nobody disturbed."""

import random
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from support.children import PATIENCE

import condyle
from condyle.analysis.sweep import open_sweep
from condyle.analysis.sweep.share import CONDOR, SLURM, Share, ranges
from condyle.analysis.sweep.study_folder import missing_shares

from .conftest import masses, same


def test_parts_in_any_order_are_one_sweep(tmp_path: Path) -> None:
    """Of another number of machines in the middle, and twice."""
    study, folder = masses(30), tmp_path / "rows"  # 8 parts
    whole = condyle.sweep(study, workers=1)
    first = condyle.sweep(study, folder, workers=1, part="3/3")
    assert set(first.variant.values // 4) == {2, 5} and first.attrs["missing"] == ""
    assert missing_shares(folder, "/3") == [1, 2] and missing_shares(folder, "/8") == [
        1,
        2,
        4,
        5,
        7,
        8,
    ]
    assert open_sweep(folder).attrs["missing"] == "0-1,3-4,6-7"
    condyle.sweep(study, folder, workers=1, part="2/8")
    for i in (2, 1, 3):
        condyle.sweep(study, folder, workers=1, part=f"{i}/3")
    assert missing_shares(folder, "/3") == []
    same(open_sweep(folder), whole)
    same(condyle.sweep(study, folder, workers=1, resume=True), whole)  # one file now
    same(open_sweep(folder, "3/3"), first)
    with pytest.raises(condyle.InputError, match="another study"):
        condyle.sweep(masses(31), folder, part="1/3")


@pytest.mark.slow
def test_machines_that_are_killed_lose_no_row(tmp_path: Path) -> None:
    study, folder = masses(60), tmp_path / "rows"
    file = tmp_path / "study.toml"
    file.write_text(tomli_w.dumps(study))
    command = [sys.executable, "-m", "condyle", "sweep", str(file), "--out", str(folder)]
    chance = random.Random(1)
    running: list[subprocess.Popen[bytes]] = []
    for i in (1, 2, 3):
        words = [*command, "--workers", "1", "--part", f"{i}/3"]
        running.append(subprocess.Popen(words, stdout=subprocess.DEVNULL))
    end = time.monotonic() + PATIENCE
    while not any(folder.glob("rows/part-*")) and time.monotonic() < end:
        time.sleep(0.01)
    for one in running:
        time.sleep(chance.uniform(0.0, 0.02))
        one.kill()
        one.wait()
    for i in missing_shares(folder, "/3"):
        condyle.sweep(file, folder, workers=1, part=f"{i}/3")
    same(open_sweep(folder), condyle.sweep(study, workers=1))


def test_a_limit_of_time_ends_between_two_parts(tmp_path: Path) -> None:
    found = condyle.sweep(masses(30), tmp_path / "rows", workers=1, minutes=1e-6)
    assert found.sizes["row"] == 4 and found.attrs["missing"] == "1-7"
    again = condyle.sweep(masses(30), tmp_path / "rows", workers=1, resume=True, minutes=60)
    same(again, condyle.sweep(masses(30), workers=1))


def test_an_array_of_jobs_says_which_part(tmp_path: Path) -> None:
    assert Share.read("/9", {SLURM: "4"}) == Share(4, 9) == Share.read("4/9", {SLURM: "5"})
    ad = tmp_path / ".job.ad"
    ad.write_text('ClusterId = 7\nProcId = 3\nOwner = "ann"\n')
    assert Share.read("/9", {CONDOR: str(ad)}) == Share(4, 9)
    assert ranges([1, 3, 4, 5, 9]) == "1,3-5,9" and ranges([]) == ""
    for given in ("3", "0/4", "5/4", "1/0", "a/b", "-1/4", "/4", "1/4/5", 3):
        with pytest.raises(condyle.InputError, match=r"part: .*3/100"):
            Share.read(given, {})  # type: ignore[arg-type]


def test_what_is_wrong_with_parts_is_told(tmp_path: Path) -> None:
    def refused(said: str, **given: Any) -> None:
        with pytest.raises(condyle.InputError, match=said):
            condyle.sweep(masses(30), **given)

    refused("expected a folder `out`", part="1/3")
    refused("at most 8", out=tmp_path / "rows", part="1/9")
    refused("minutes: expected a positive number, got -1", out=tmp_path / "rows", minutes=-1)
    assert not (tmp_path / "rows").exists()
