"""Temporary files of processes that are gone are swept; those of the living stay."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from condyle.atomic import replacing, write_text

KILLED = """
import os, signal, sys
from condyle.atomic import replacing
with replacing(sys.argv[1]) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
def test_what_a_killed_process_left_is_swept(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, tmp_path / "a.csv"], check=False)
    [left] = tmp_path.iterdir()
    assert left.name.startswith(".a.csv.") and left.suffix == ".part"
    write_text(tmp_path / "b.csv", "whole")
    assert [path.name for path in tmp_path.iterdir()] == ["b.csv"]


def test_what_others_may_still_write_stays_for_a_day(tmp_path):
    with replacing(tmp_path / "a.csv") as temporary:
        temporary.write_text("half")
        mine = temporary.name.replace("a.csv", "mine")
        here = temporary.name.rpartition(".part")[0].rpartition(".")[2].split("-")[0]
        elsewhere = temporary.name.replace(here, "00000000").replace("a.csv", "elsewhere")
        strange = [".a.csv.part", ".a.12345-0123abcd.part", "a.csv.0-1-2.part"]
        for name in (mine, elsewhere, *strange):
            (tmp_path / name).write_text("half")
        write_text(tmp_path / "b.csv", "whole")
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {temporary.name, "b.csv", mine, elsewhere, *strange}
        old = time.time() - 90_000
        for name in (mine, elsewhere, *strange):
            os.utime(tmp_path / name, (old, old))
        write_text(tmp_path / "b.csv", "whole")
        names = {path.name for path in tmp_path.iterdir()}
        assert names == {temporary.name, "b.csv", *strange}
    assert (tmp_path / "a.csv").read_text() == "half"
