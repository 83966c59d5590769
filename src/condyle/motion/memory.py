"""Available memory, so that too large a request is refused at once, and a limit for libraries."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from ..errors import InputError

MOST_SAMPLES = 10_000_000  # of a motion that is made: three hours at 1 kHz
_UNKNOWN = 8 << 30  # bytes, where the system does not say


def sample_count(duration: float, rate: float) -> float:
    """Samples of a duration [s] at a rate [Hz].

    Raises: InputError: for more than are made.
    """
    if not (count := duration * rate) <= MOST_SAMPLES:
        raise InputError(
            f"{duration:.4g} s at {rate:g} Hz are {count:.3g} samples; expected at most "
            f"{MOST_SAMPLES:.0e}: lower rate, or what makes it last so long"
        )
    return count


def memory_at_hand() -> int:
    """Bytes that this process can still allocate, as far as the system says."""
    limits = []
    with suppress(OSError, ValueError, IndexError), open("/proc/meminfo", encoding="ascii") as file:
        limits += [int(line.split()[1]) << 10 for line in file if line.startswith("MemAvailable")]
    if not limits:
        with suppress(OSError, ValueError, AttributeError):
            limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with suppress(OSError, ValueError), open("/sys/fs/cgroup/memory.max", encoding="ascii") as file:
        limits.append(int(file.read()))  # of a container; "max" is no limit
    with suppress(ImportError, OSError):
        import resource

        address_space = resource.getrlimit(resource.RLIMIT_AS)[0]
        limits += [address_space] if address_space != resource.RLIM_INFINITY else []
    return min(limits, default=_UNKNOWN)


@contextmanager
def at_most(extra: int) -> Iterator[None]:
    """Let this process allocate a number of further bytes, where the system can say so.

    For a library that allocates what a damaged file asks for: it gets a MemoryError.
    """
    try:
        import resource

        with open("/proc/self/statm", encoding="ascii") as file:
            now = int(file.read().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    except (ImportError, OSError, ValueError):
        yield
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = now + extra
    if any(limit != resource.RLIM_INFINITY and limit <= wanted for limit in (soft, hard)):
        yield
        return
    resource.setrlimit(resource.RLIMIT_AS, (wanted, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
