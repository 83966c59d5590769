"""The paper's own numbers, and what a run must be to stand beside them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath

from ..mechanism import load_mechanism
from ..mechanism.mechanism import Mechanism
from ..motion.reference_case import LOAD_FILE, MOTION_FILE, SYNTHETIC

STAND_IN = "masticatory"  # the bundled mechanism that stands in for the authors' robot


@dataclass(frozen=True)
class Seconds:
    """What a model costs: its derivation, and its torques at all samples [s]."""

    symbolic: float
    numeric: float

    @property
    def total(self) -> float:
        return self.symbolic + self.numeric


# [Cheng2023] Table 1, by (formulation, route); then the 6RSS, by formulation.
TABLE_1 = {
    ("momentum", "direct"): Seconds(21.492, 14.369),
    ("lagrange", "direct"): Seconds(35.802, 25.463),
    ("momentum", "core"): Seconds(5.858, 2.724),
    ("lagrange", "core"): Seconds(6.579, 3.462),
}
TABLE_1_FREE = {"momentum": Seconds(5.858, 1.400), "lagrange": Seconds(6.579, 3.439)}

# Model 2 against Model 1 as the text of Section 6.2.1 states it; its Table 1 says otherwise.
MODEL_2_IN_TEXT = {"momentum": "22.5%", "lagrange": "16.2%"}

# [Cheng2023] Table 2 [N m], by part; "all" is F.
TABLE_2 = {"all": 0.0207, "platform": 0.0191, "couplers": 0.0016, "cranks": 0.0010}
TABLE_2_FREE = {"all": 0.0723, "platform": 0.0690, "couplers": 0.0034, "cranks": 0.0011}

MODEL_NAMES = {
    ("momentum", "direct"): "GM 1",
    ("lagrange", "direct"): "L-D 1",
    ("momentum", "core"): "GM 2",
    ("lagrange", "core"): "L-D 2",
}
FREE_NAMES = {"momentum": "6RSS GM", "lagrange": "6RSS L-D"}
INDEX_NAMES = {"all": "F", "platform": "F_EE", "couplers": "F_SM", "cranks": "F_GS"}


def is_paper_class(mechanism: Mechanism) -> bool:
    """Whether the paper's numbers can stand beside this mechanism's: six RSS, two planes."""
    kinds = [chain.kind for chain in mechanism.chains]
    surfaces = [contact.surface.kind for contact in mechanism.contacts]
    return kinds == ["RSS"] * 6 and surfaces == ["plane"] * 2


def is_stand_in(mechanism: Mechanism) -> bool:
    """Whether this is the bundled mechanism, number by number."""
    return mechanism.name == STAND_IN and mechanism == load_mechanism(STAND_IN)


def is_synthetic(source: str) -> bool:
    """Whether a motion or load is the bundled one, from where it came from."""
    data = [("condyle", "motion", "data", name) for name in (MOTION_FILE, LOAD_FILE)]
    return SYNTHETIC in source or PurePath(source).parts[-4:] in data
