"""A study: the numbers of a mechanism that vary, the motions, and the measures."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, StrictBool, model_validator

from ...errors import printable
from ...mechanism.study_file import (
    REFERENCE,
    Count,
    Finite,
    LoadName,
    MechanismFile,
    MotionName,
    NotNegative,
    Numbers,
    Positive,
    Seed,
    StudyFile,
)
from ...mechanism.table import Table
from ...model.model import Contacts

Pair = Annotated[tuple[Finite, Finite], Numbers]


class Follower(Table):
    """Another number of the mechanism that depends on the varied one: times * value + plus."""

    what: str
    times: Finite = 1.0
    plus: Finite = 0.0


def _followers(value: Any) -> Any:
    """One or several; as text the same number, or the negative of it with "-" in front."""
    given = value if isinstance(value, list | tuple) else [value]
    return tuple(
        {"what": one.lstrip("- "), "times": -1.0 if one.startswith("-") else 1.0}
        if isinstance(one, str)
        else one
        for one in given
    )


class Vary(Table):
    """A number of the mechanism that varies: one of range, values, normal and scale."""

    what: str = Field(description='its path, such as "chain.masseter_left.base[2]"')
    mirror: Annotated[tuple[Follower, ...], BeforeValidator(_followers)] = Field(
        default=(), description='dependent paths; with "-" in front the negative value'
    )
    range: Pair | None = Field(default=None, description="[lower, upper], SI")
    values: Annotated[tuple[Finite, ...], Numbers, Field(min_length=1)] | None = Field(
        default=None, description="list of values, SI"
    )
    normal: Pair | None = Field(default=None, description="[mean, standard deviation], SI")
    scale: Pair | None = Field(default=None, description="[lower, upper] factor of its value")
    count: Count | None = Field(default=None, description="number of values, of a grid")

    @model_validator(mode="after")
    def _require_single_source(self) -> Self:
        ways = [n for n in ("range", "values", "normal", "scale") if getattr(self, n) is not None]
        if len(ways) != 1:
            got = " and ".join(ways) or "none"
            raise ValueError(f"expected one of range, values, normal and scale, got {got}")
        pair = self.range or self.scale
        if pair is not None and not pair[0] < pair[1]:
            raise ValueError(
                f"{ways[0]}: expected [lower, upper] with lower < upper, got {list(pair)}"
            )
        if self.normal is not None and not self.normal[1] > 0:
            raise ValueError(
                f"normal: expected [mean, standard deviation > 0], got {list(self.normal)}"
            )
        if self.values is not None and self.count is not None:
            raise ValueError("count: not allowed with values; leave it out")
        return self


class Sampling(Table):
    """How the varied numbers are sampled."""

    kind: Literal["grid", "sobol", "latin", "random", "saltelli"] = "grid"
    count: Count | None = Field(
        default=None, description="number of samples; of a grid see [[vary]]"
    )
    seed: Seed = 0

    @model_validator(mode="after")
    def _counted(self) -> Self:
        if self.kind == "grid" and self.count is not None:
            raise ValueError('count: a grid has its counts in [[vary]]; or choose kind = "sobol"')
        if self.kind != "grid" and self.count is None:
            raise ValueError(f"count is required for kind {self.kind}")
        return self


class Measure(Table):
    """A variable of the solution, reduced to one number, or to one for each remaining entry."""

    of: str = Field(description='a variable of the solution, or "effort"')
    take: Literal["min", "max", "min_abs", "max_abs", "mean", "rms", "span"]
    over: tuple[str, ...] | None = Field(default=None, description="dimensions; default: all")
    better: Literal["less", "more"] | None = Field(
        default=None, description="for the best rows and the Pareto front"
    )
    chain: str | None = None
    contact: str | None = None
    coordinate: str | None = None
    part: str | None = None
    axis: str | None = None
    component: str | None = None
    independent: str | None = None

    @property
    def chosen(self) -> dict[str, str]:
        """Dimension -> the one entry that counts."""
        names = ("chain", "contact", "coordinate", "part", "axis", "component", "independent")
        return {name: entry for name in names if (entry := getattr(self, name)) is not None}


class MotionFile(Table):
    """A motion: a file with what `condyle run` takes for it, "reference" or "trial"."""

    file: MotionName
    units: str | None = None
    landmark: str | None = None
    smooth: Positive | Literal["auto"] | None = None
    rate: Positive | None = None
    trim: NotNegative = 0.0


def _motions(value: Any) -> Any:
    """One or several; text is the file's name."""
    given = value if isinstance(value, list | tuple) else [value]
    return tuple({"file": one} if isinstance(one, str) else one for one in given)


DEFAULT_MEASURES = {
    "peak_effort": Measure(of="effort", take="max_abs", better="less"),
    "margin": Measure(of="singularity_ratio", take="min", better="more"),
}


class Study(StudyFile):
    """Variants of one mechanism, one or several motions, and the measures."""

    mechanism: MechanismFile | None = Field(
        default=None, description="a file, or a bundled mechanism; default: masticatory"
    )
    motion: Annotated[tuple[MotionFile, ...], BeforeValidator(_motions), Field(min_length=1)] = (
        Field(default=(MotionFile(file=REFERENCE),), description="a file or several")
    )
    load: LoadName | None = Field(
        default=None,
        description='a file, "reference" or "none"; default: the bundled bite force where the '
        "bundled motion and right_molar fit",
    )
    load_point: str | None = None
    formulation: str = "virtual_power"
    route: str = "core"
    backend: str = "auto"
    distribution: str | None = None
    preload: Finite = 0.0
    contact_weight: Finite = Field(default=0.0, description="W, as of condyle run")
    contacts: Contacts = Field(
        default="kept", description="or compliant: those with compliance yield to their forces"
    )
    vary: tuple[Vary, ...] = Field(min_length=1)
    sampling: Sampling = Sampling()
    measure: dict[str, Measure] = Field(default=DEFAULT_MEASURES, min_length=1)
    solutions: StrictBool = Field(default=False, description="keep every solution as NetCDF too")

    @model_validator(mode="after")
    def _counted(self) -> Self:
        if self.sampling.kind == "grid":
            if bare := [v.what for v in self.vary if v.values is None and v.count is None]:
                raise ValueError(f"vary {printable(bare[0])}: count is required for a grid")
        elif counted := [one.what for one in self.vary if one.count is not None]:
            raise ValueError(
                f"vary {printable(counted[0])}: count is for a grid only; kind "
                f"{self.sampling.kind} has its count in [sampling]"
            )
        return self
