"""Designs: numbers of a mechanism's file that make a motion cheapest, within limits."""

from .design_study import DesignStudy
from .designing import Designed, design

__all__ = ["DesignStudy", "Designed", "design"]
