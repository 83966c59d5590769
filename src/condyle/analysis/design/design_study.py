"""A design study: a sweep's study, whose numbers are searched in the place of sampled."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from ...errors import printable
from ...mechanism.study_file import Count, Finite, Positive
from ...mechanism.table import Table
from ..sweep.study import Sampling, Study

DERIVED = ("effort", "contact_force", "joint", "pose", "singularity_ratio", "frequency")
TAKEN = ("min", "max", "max_abs", "mean", "rms")
STARTS = Sampling(kind="sobol", count=3)


class Limit(Table):
    """What a measure is kept within."""

    least: Finite | None = None
    most: Finite | None = None

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.least is None and self.most is None:
            raise ValueError("expected least, most or both")
        return self


class Pareto(Table):
    """The best cost for each of several values of another measure."""

    measure: str
    count: Count = Field(default=7, description="points of the front, its ends included")


class DesignOptions(Table):
    """How far the search goes."""

    steps: Count = Field(default=60, description="of the search from each start")
    accuracy: Positive = Field(default=1e-5, description="of the cost, relative")


class DesignStudy(Study):
    """The keys of a sweep's study; numbers vary between the ends of `range` or `scale`.

    The search starts from the file's own numbers, and from the rows of `sampling`.
    """

    minimise: str | None = Field(default=None, description="a measure")
    maximise: str | None = Field(default=None, description="a measure, in the place of minimise")
    limits: dict[str, Limit] = Field(
        default={}, description="measure -> { least, most }; a measure without one is free"
    )
    pareto: Pareto | None = None
    tolerance: dict[str, Positive] = Field(
        default={}, description="path -> error of each of its numbers, either way"
    )
    sampling: Sampling = Field(default=STARTS, description="starts besides the file's numbers")
    options: DesignOptions = DesignOptions()

    @property
    def cost(self) -> tuple[str, float]:
        """The measure, and 1 where less is better, -1 where more is."""
        return (self.minimise, 1.0) if self.minimise else (str(self.maximise), -1.0)

    @model_validator(mode="after")
    def _designed(self) -> Self:
        if (self.minimise is None) == (self.maximise is None):
            raise ValueError("expected one of minimise and maximise, with a measure")
        named = [self.cost[0], *self.limits, *([self.pareto.measure] if self.pareto else ())]
        for name in named:
            if name not in self.measure:
                known = ", ".join(self.measure)
                raise ValueError(f'unknown measure "{printable(name)}"; available: {known}')
        if self.pareto is not None and self.pareto.measure == self.cost[0]:
            raise ValueError("pareto: expected another measure than the cost")
        for number in self.vary:
            if number.range is None and number.scale is None:
                raise ValueError(f"vary {printable(number.what)}: expected range or scale")
        for name, measure in self.measure.items():
            where = f"measure {printable(name)}"
            if measure.of not in DERIVED:
                raise ValueError(
                    f"{where}: {printable(measure.of)} has no derivatives by numbers of the file; "
                    f"expected one of {', '.join(DERIVED)}"
                )
            if measure.take not in TAKEN:
                known = ", ".join(TAKEN)
                raise ValueError(f"{where}: expected take of {known}, got {measure.take}")
        if self.contacts != "kept":
            raise ValueError('contacts: designs are of contacts that are "kept"; leave it out')
        if self.solutions:
            raise ValueError("solutions: is a key of sweeps alone; leave it out")
        return self
