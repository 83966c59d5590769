"""The scenario: duration, start, efforts or a controller, loads; as a file or in Python."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, ValidatorFunctionWrapHandler, WrapValidator, model_validator

from ..errors import InputError, ProblemsError, ScenarioError, as_path, printable
from ..mechanism.cells import table
from ..mechanism.files import validated
from ..mechanism.messages import of_file
from ..mechanism.quantities import Length, Name, Number
from ..mechanism.study_file import StudyFile
from ..mechanism.table import Table
from ..questions.entries import File, Frequency, Gain, Gains, Positive
from ..questions.law import CONTROLLERS
from ..questions.load import LOADS
from .drives import DrivesTable
from .integrators import FIXED, INTEGRATORS
from .safety import Coordinates, Safety

LONGEST = 1e4  # seconds
COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")


class Start(Coordinates):
    """Where the mechanism begins: independent coordinates and their rates, 0 where not said."""

    dX: Length | None = None
    dY: Length | None = None
    dZ: Length | None = None
    dalpha: Number | None = None
    dbeta: Number | None = None
    dgamma: Number | None = None
    on_motion: bool = Field(
        default=False, description="begin where the controller's motion does, and as fast"
    )

    @model_validator(mode="after")
    def _require_single_start(self) -> Self:
        if self.on_motion and self.given:
            raise ValueError(f"on_motion says where to begin; remove {next(iter(self.given))}")
        return self

    @property
    def given(self) -> dict[str, float]:
        """What is said, by name."""
        return {n: v for n, v in self.entries().items() if n != "on_motion" and v is not None}


class Efforts(Table):
    """Efforts in open loop; of muscles the tensions wanted, or their excitations."""

    file: File = Field(
        description="CSV of t [s] and tau_<chain> [N m or N], of muscles also excitation_<chain> "
        "[0 to 1], linear between rows"
    )


class Sensors(Table):
    """What stands between the mechanism and its controller: encoders in the actuators' joints.

    From their counts the pose follows by forward kinematics, from the last pose on. Without this
    table a controller measures the exact state.
    """

    encoder_resolution: Gain = Field(default=0.0, description="rad or m a count; 0: exact")
    encoder_noise: Gain = Field(
        default=0.0, description="standard deviation of a reading, rad or m, drawn at every tick"
    )
    seed: int = Field(default=1, ge=0, strict=True)
    velocity: Literal["difference", "exact"] = Field(
        default="difference", description="of counts over a period, or by tachometers"
    )
    velocity_cutoff: Frequency | None = Field(
        default=None, description="Hz, of a first-order low-pass on differences; default none"
    )

    @property
    def given_rates(self) -> bool:
        """Whether it says how rates are measured."""
        return self.velocity != "difference" or self.velocity_cutoff is not None


class Observer(Table):
    """How a controller comes to the state and to the load at a point, from encoders and efforts.

    Without this table the state is the sensors', and a load that a law needs is the true one.
    """

    kind: Literal["kalman"]
    point: Name | None = Field(
        default=None, description="where the load is; default the controller's, or right_molar"
    )
    acceleration_noise: Gains = Field(
        default=0.1,
        description="of q'', 1/s^2 a root of Hz; one for angles, of lengths times the mechanism's "
        "size, or one a coordinate",
    )
    force_noise: Positive = Field(
        default=15.0, description="how fast the load wanders, N a root of s"
    )


class Timing(Table):
    """How a controller misses its times; the law takes every period for a whole one."""

    jitter: Gain = Field(default=0.0, description="s that a tick is late, at most, evenly spread")
    missed: float = Field(
        default=0.0, ge=0, lt=1, strict=True, description="share of the ticks that are left out"
    )
    seed: int = Field(default=1, ge=0, strict=True)


class ContactKind(Table):
    """What unilateral contacts, and those with clearance, do when the platform leaves them."""

    kind: Literal["kept", "rigid", "compliant"] = Field(
        default="kept",
        description="kept: they hold, and the run ends where one would have to pull; rigid: they "
        "lift, and land with the mechanism file's restitution and friction; compliant: they lift, "
        "and give by their compliance",
    )


def _or_none(value: Any, from_file: ValidatorFunctionWrapHandler) -> Any:
    return None if value is None else from_file(value)


class Scenario(StudyFile):
    """A simulation: duration, start, efforts or controller, and loads. All values are SI."""

    refusal: ClassVar[type[ProblemsError]] = ScenarioError
    _noun: ClassVar[str] = "scenario"

    @classmethod
    def _of(cls, data: Mapping[str, Any], source: str, folder: Path | None) -> Self:
        """Lengths are in the file's `length_unit`."""
        controller = data.get("controller") if isinstance(data, Mapping) else None
        if folder is not None and not data:
            raise InputError(
                f"{source}: is empty, and would be a free fall; condyle simulate --new FILE.toml "
                "writes a scenario to start from"
            )
        if controller == {"kind": "none"}:
            data = {key: value for key, value in data.items() if key != "controller"}
        found, problems, _ = validated(cls, data, source, cls._noun, {"folder": folder})
        if problems or found is None:
            raise cls.refusal(source, of_file(problems, data, cls, source))
        return found

    def _repr_html_(self) -> str:
        """What differs from the defaults."""
        given = self.model_dump(exclude_defaults=True)
        rows = [(key, str(value)[:300]) for key, value in given.items()]
        return table("Scenario", f"{self.duration:g} s at {self.rate:g} Hz", rows)

    duration: Positive = Field(default=1.0, le=LONGEST, description="s")
    rate: Frequency = Field(default=1000.0, description="of the results, Hz")
    method: str = Field(default="DOP853", description=", ".join(INTEGRATORS))
    rtol: float = Field(
        default=1e-9, ge=1e-13, le=1e-2, allow_inf_nan=False, description="of the integrator"
    )
    step: Positive | None = Field(default=None, description="s, of a method with fixed steps")
    start: Start = Start()
    efforts: Efforts | None = None
    controller: Annotated[Any, CONTROLLERS, WrapValidator(_or_none)] = None
    sensors: Sensors | None = None
    observer: Observer | None = None
    timing: Timing | None = None
    drives: DrivesTable | None = None
    safety: Safety = Safety()
    contacts: ContactKind = ContactKind()
    loads: tuple[Annotated[Any, LOADS], ...] = Field(default=(), alias="load", max_length=100)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        problems = []
        if self.method not in INTEGRATORS:
            known = ", ".join(INTEGRATORS)
            problems.append(f'method: got "{printable(self.method):.40}"; available: {known}')
        elif (self.method in FIXED) != (self.step is not None):
            problems.append(
                f"step: {self.method} chooses its own steps, by rtol; remove it"
                if self.step is not None
                else f"step is missing: {self.method} has fixed steps [s], such as 1e-4"
            )
        closed = self.controller is not None and self.controller.kind != "none"
        if closed and self.efforts is not None:
            problems.append("efforts and controller: efforts come from one of them; remove one")
        if not closed and self.observer is not None:
            problems.append("observer: there is no controller for it; remove it")
        if self.observer is not None:
            problems += _observer_problems(self.sensors)
        if not closed and self.start.on_motion:
            problems.append("start.on_motion: there is no controller with a motion")
        if closed:
            problems += _controller_problems(self.controller, self.sensors, self.timing)
        names = [load.name for load in self.loads if load.name is not None]
        problems += [f'two loads are called "{n}"' for n in {*names} if names.count(n) > 1]
        if problems:
            raise ValueError("; ".join(problems))
        return self

    @property
    def closed_loop(self) -> bool:
        """Whether a controller commands the efforts."""
        return self.controller is not None and self.controller.kind != "none"


def _observer_problems(sensors: Sensors | None) -> Iterable[str]:
    if sensors is None or not (sensors.encoder_noise or sensors.encoder_resolution):
        yield (
            "observer: it weighs encoders by their errors; give sensors.encoder_noise or "
            "sensors.encoder_resolution"
        )
    elif sensors.given_rates:
        yield "sensors.velocity: the observer estimates rates; remove velocity and velocity_cutoff"


def _controller_problems(
    controller: Any, sensors: Sensors | None, timing: Timing | None
) -> Iterable[str]:
    if controller.keep_bounds and controller.adds:
        yield (
            f"controller.keep_bounds: {controller.kind} asks for no acceleration that could be "
            "led away; take computed_torque, impedance, hybrid or bite_force"
        )
    if not controller.ideal:
        if timing is not None and timing.jitter * controller.rate >= 1:
            yield "timing.jitter: expected less than a period; a tick that is later is missed"
        return
    if timing is not None:
        yield "controller.ideal: it has no ticks; remove ideal, or timing"
    if controller.memory:
        yield f"controller.ideal: {controller.kind} has a memory and needs a rate; remove ideal"
    if controller.effort_rate is not None:
        yield "controller.effort_rate: an ideal controller has no ticks to count from; remove one"
    if controller.delay:
        yield "controller.ideal: there is no delay without periods; remove one of them"
    if sensors is not None:
        yield "controller.ideal: it measures the exact state; remove ideal, or the sensors"


def load_scenario(source: str | os.PathLike[str]) -> Scenario:
    """Read a scenario file; paths in it are relative to it.

    Raises: ScenarioError: with every problem found;  InputError: if it is no TOML file.
    """
    return Scenario.read(as_path(source, "scenario"))
