"""Nonlinear functions as data: built, evaluated and differentiated; nothing in a file is executed."""

from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import Operator

__all__ = ["Builder", "Map", "Operator"]
