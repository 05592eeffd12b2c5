"""The edges of the graph: one conversion a file, the mathematics on top, `lift` beside `apply`."""

from cpbench.conversions.base import Conversion, conversions, lift_step, make
from cpbench.formulations.base import Kind

__all__ = ["Conversion", "Kind", "conversions", "lift_step", "make"]
