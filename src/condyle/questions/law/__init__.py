"""Controllers of a scenario by kind. A new one is a file that registers its table here."""

from ...mechanism.kinds import Kinds
from ...mechanism.table import Table
from .bite_force import BiteForce
from .computed_torque import ComputedTorque
from .controller import Control, ControllerTable, Law
from .hybrid import Hybrid
from .impedance import Impedance
from .joint_pd import JointPD
from .none import Nothing

CONTROLLERS = Kinds[Table](
    "condyle.controllers", JointPD, ComputedTorque, Impedance, BiteForce, Hybrid, Nothing
)

__all__ = ["CONTROLLERS", "Control", "ControllerTable", "Law"]
