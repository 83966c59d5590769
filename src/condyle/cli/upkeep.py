"""condyle bench, cache, schema: what keeps an installation and its files in order."""

from __future__ import annotations

import importlib
import json
import sys
from contextlib import ExitStack
from pathlib import Path
from types import ModuleType

import condyle

from ..errors import UnsupportedError
from ..files.atomic import ending_of, replacing
from .answer import Answer, files_line
from .command import command
from .options import output_folder


@command("bench --seconds 0.2 --out bench.json")
def bench(*, out: Path | None = None, seconds: float = 1.0, realtime: bool = False) -> Answer:
    """Benchmark this machine.

    One table of every method and of other engines, on one core. It runs in the repository only.

    Args:
        out: JSON file for the results.
        realtime: Benchmark exported C in loops of 1, 5, 10 and 20 kHz instead: latency of ticks,
            the longest, and missed ones, next to an empty loop.
        seconds: Time for each row of the table (s).
    """
    benchmarks = _benchmarks()
    with ExitStack() as stack:  # a file that cannot be written is found before the minutes pass
        if out is not None:
            ending_of(out, [".json"])
            output_folder(out.parent)
            temporary = stack.enter_context(replacing(out))
        if realtime:
            result = benchmarks.real_time(condyle.load_mechanism("masticatory"), seconds)
        else:
            result = benchmarks.run_benchmark(seconds)
        if out is not None:
            temporary.write_text(json.dumps(result.data(), indent=1), encoding="utf-8")
    files = [out] if out else []
    text = f"{result}\n{files_line(files)}" if out else str(result)
    return Answer(text, result.data() | {"files": files}, kind="result")


def _benchmarks() -> ModuleType:
    """The engine, which stands beside the package in a checkout.

    Raises: UnsupportedError: where the package was installed without it.
    """
    root = Path(__file__).parents[3]
    if not (root / "benchmarks" / "timer.c").is_file():
        raise UnsupportedError(
            "condyle bench is part of the repository, not of an installation. Run it in a checkout "
            "that is installed with pip install --editable ."
        )
    sys.path.insert(0, str(root))
    try:
        return importlib.import_module("benchmarks")
    finally:
        sys.path.pop(0)


@command("cache --clear")
def cache(*, clear: bool = False) -> Answer:
    """Show or clear the compiled kernels on disk.

    A kernel is compiled when it is first needed, in a second or two, and then reused.

    Args:
        clear: Remove all kernels.
    """
    from ..backends import cache as kernels

    had = kernels.clear() if clear else kernels.contents()
    count = "1 kernel" if had.kernels == 1 else f"{had.kernels} kernels"
    what = f"{count}, {had.size / 1e6:.1f} MB"
    text = f"Removed {what} from {had.folder}" if clear else f"{had.folder}: {what}"
    data = {"folder": had.folder, "kernels": had.kernels, "bytes": had.size, "cleared": clear}
    return Answer(text, data, kind="result")


@command("schema > condyle.schema.json", "analysis.studies:schema")
def schema(of: str = "mechanism") -> Answer:
    """Args:
    of: Kind of file: <names>.
    """
    data = condyle.schema(of)  # type: ignore[arg-type]  # any kind
    return Answer(json.dumps(data, indent=2), data, kind="result")
