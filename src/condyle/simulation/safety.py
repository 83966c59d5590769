"""What an exported controller does when something is not as it should be: `[safety]`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from ..mechanism.quantities import Length, Number
from ..mechanism.table import Table
from ..questions.entries import Gain, Positive, Signed

Factor = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1.0, le=1e6)]
Most = Annotated[int, Field(strict=True, ge=0, le=1_000_000)]


class Trips(Table):
    """Thresholds that stop the machine. Without a number a trip is off: what is right depends on
    the machine, and a guess would either stop good runs or protect nothing."""

    tracking: Positive | None = Field(
        default=None,
        description="a joint this far from its reference, rad or m; off: soft laws and food lead "
        "joints away on purpose",
    )
    speed: Factor = Field(
        default=1.2,
        description="joint speed over the actuator's speed_limit, where it has one; a fifth above "
        "it is more than noise of differences",
    )
    overtaxed: Positive | None = Field(
        default=None,
        description="s that an effort may stand at its limit; off: a limit may be a rating that "
        "can be held",
    )
    contact: Positive | None = Field(
        default=None,
        description="s that a contact may carry nothing; needs a distribution within limits, which "
        "knows contact forces; off: some paths unload a contact",
    )
    encoder_jump: Positive | None = Field(
        default=None,
        description="rad or m between a reading and what is expected from its rate: beyond it the "
        "reading counts as lost; off: depends on the encoder",
    )
    encoder_stuck: Positive | None = Field(
        default=None,
        description="rad or m that a reference moves while the reading stands still; off: coarse "
        "encoders stand still at small motions",
    )


class Coordinates(Table):
    """Independent coordinates of a mechanism, 0 where not said."""

    X: Length | None = None
    Y: Length | None = None
    Z: Length | None = None
    alpha: Number | None = None
    beta: Number | None = None
    gamma: Number | None = None


class Search(Table):
    """How homing finds what incremental encoders are off, before it goes to the reference."""

    until: Literal["index", "stop"] = Field(
        description="index: until each encoder's mark has passed, input `index`; stop: until "
        "joints stand although they are asked to move on"
    )
    at: Signed = Field(
        description="joint coordinates at the marks or at the stop, rad or m; one, or one a chain"
    )
    reach: Coordinates = Field(
        description="how far to go for it, by independent coordinate, such as { beta = 0.1 }"
    )
    tolerance: Positive = Field(
        description="rad or m by which joints may be off the pose that the controller begins with: "
        "a mark elsewhere is none, and joints that lag by more are at the stop"
    )
    within: Positive = Field(default=10.0, description="s, for the whole reach: slow beside homing")
    effort: Annotated[float, Field(strict=True, gt=0, le=1)] = Field(
        default=0.2, description="share of the limits while it searches: a stop is pressed, not hit"
    )
    press: Gain = Field(default=0.2, description="s that joints stand at the stop")


class Safety(Table):
    """What the exported controller does on start, on stop and on faults. Simulation ignores it."""

    stop: Literal["brake", "hold_then_release", "hold"] = Field(
        default="brake",
        description="a safe stop brakes the joints and lets efforts go; or first holds the pose "
        "for `hold` seconds; or holds until off is wanted. Faults of readings, pose, clock, speed "
        "and tracking, and an emergency stop, always brake: the law cannot be trusted then",
    )
    homing: Gain = Field(default=2.0, description="s, to the reference: slow enough to be watched")
    halting: Gain = Field(
        default=0.1,
        description="s, in which a speed is led to the next reference's: short beside a chewing "
        "cycle",
    )
    ramp: Gain = Field(default=0.2, description="s, in which efforts rise from 0 after off")
    stopping: Gain = Field(
        default=0.5, description="s, in which efforts fade in a safe stop: the brake needs a tenth"
    )
    hold: Gain = Field(default=2.0, description="s, of hold_then_release: time to put a prop under")
    late: Factor = Field(default=1.5, description="a tick is late beyond this many periods")
    gap: Factor = Field(
        default=10.0,
        description="a gap of more periods, or a clock that far back, stops at once: efforts were "
        "not renewed for as long",
    )
    late_most: Most = Field(
        default=3, description="late ticks that are borne: a scheduler's hiccup, not its failure"
    )
    lost_most: Most = Field(
        default=3,
        description="ticks without a reading, without a pose, or too fast, that are borne",
    )
    recovery: Annotated[float, Field(strict=True, gt=0, le=1)] = Field(
        default=0.25,
        description="what a good tick takes from such counts: more than one bad tick in five stops",
    )
    trips: Trips = Trips()
    search: Search | None = Field(
        default=None, description="without it encoders are absolute: the file's `zero`"
    )
