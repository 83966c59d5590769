"""Controllers of a scenario by kind. A new one is a file that registers its table here."""

from ..table import Table
from .base import ControllerTable, Law, Measured, Reference
from .bite_force import BiteForce
from .computed_torque import ComputedTorque
from .function import FunctionLaw
from .impedance import Impedance
from .joint_pd import JointPD
from .none import Nothing

CONTROLLERS: dict[str, type[Table]] = {
    "joint_pd": JointPD,
    "computed_torque": ComputedTorque,
    "impedance": Impedance,
    "bite_force": BiteForce,
    "none": Nothing,
}

__all__ = ["CONTROLLERS", "ControllerTable", "FunctionLaw", "Law", "Measured", "Reference"]
