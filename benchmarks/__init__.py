"""The benchmark: our kernels, numpy and other engines, in one run on one core.

Every row is checked against numpy before it is timed. The other engines, in `peers`, take part
where their packages are there. `condyle bench` runs this from a checkout.
"""

from .realtime import RealTime, real_time
from .run import Benchmark, run_benchmark

__all__ = ["Benchmark", "RealTime", "real_time", "run_benchmark"]
