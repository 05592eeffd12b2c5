"""The edges of the graph: a file for each formulation they leave, the mathematics in their docstrings."""

from cpbench.conversions.base import Conversion, conversions, edge, lift_step, make
from cpbench.formulations.base import Kind

__all__ = ["Conversion", "Kind", "conversions", "edge", "lift_step", "make"]
