"""N_ref, the force by which contact forces are measured where they weigh against efforts."""

from __future__ import annotations

import numpy as np

from ..kinematics.chain import FAMILIES
from ..mechanism.chain import limits
from ..mechanism.home import characteristic_length
from ..mechanism.mechanism import Mechanism


def reference_force(mechanism: Mechanism) -> float:
    """The largest limit of the chains [N]; 1 N where none has a limit.

    `weighted` adds W (lambda_k / N_ref)^2 of every contact: with W = 1 a contact force as large as
    the strongest actuator's weighs as much as that actuator at its limit. A torque counts as the
    force that it gives at the characteristic length.
    """
    forces = []
    for chain in mechanism.chains:
        arm = 1.0 if FAMILIES[chain.kind].effort_unit == "N" else characteristic_length(mechanism)
        forces.append(limits(chain).greatest / arm)
    return max((force for force in forces if np.isfinite(force) and force > 0), default=1.0)
