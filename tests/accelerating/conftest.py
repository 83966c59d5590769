"""Kernels of these tests are built quickly and kept apart."""

from support.building import (  # noqa: F401 - fixtures
    compiler_command,
    kernel_cache,
    kernel_folder,
    nothing_said,
    quick,
    quick_command,
)
