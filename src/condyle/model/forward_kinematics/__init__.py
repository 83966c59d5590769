"""Forward kinematics: from joint coordinates, as encoders give them, to the pose."""

from .pose_status import PoseStatus
from .solver import TOLERANCE, ForwardKinematics

__all__ = ["TOLERANCE", "ForwardKinematics", "PoseStatus"]
