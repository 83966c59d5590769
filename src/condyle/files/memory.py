"""Available memory, so that too large a request is refused at once."""

from __future__ import annotations

import os
from contextlib import suppress

from ..errors import InputError

_UNKNOWN = 8 << 30  # bytes, where the system does not say


def require_memory(need: float, what: str, remedy: str = "") -> None:
    """Raises InputError where a number of bytes is more than is free; `what` "takes" them."""
    if need > (free := available_memory()):
        said = f"{what} {byte_text(need)}, and {byte_text(free)} are free"
        raise InputError(f"{said}: {remedy}" if remedy else said)


def byte_text(count: float) -> str:
    """'1.5 GiB' of a number of bytes."""
    return f"{count / 2**30:.3g} GiB" if count >= 1 << 30 else f"{count / 2**20:.3g} MiB"


def available_memory() -> int:
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
