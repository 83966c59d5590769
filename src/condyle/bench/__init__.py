"""The benchmark: our kernels, numpy and other engines, in one run on one core.

Every row is checked against numpy before it is timed. Peers live in the repository's
`benchmarks/peers` and take part when the command runs from its root and their packages are there.
"""

from .realtime import RealTime, real_time
from .run import Benchmark, run_benchmark

__all__ = ["Benchmark", "RealTime", "real_time", "run_benchmark"]
