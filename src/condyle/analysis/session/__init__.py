"""A session of recordings: motions, solutions, cycles, and their mean."""

from .cycle_finding import CycleDetection, at_times, find_cycles
from .solved_session import SolvedSession, SolvedTrial, solve_session

__all__ = [
    "CycleDetection",
    "SolvedSession",
    "SolvedTrial",
    "at_times",
    "find_cycles",
    "solve_session",
]
