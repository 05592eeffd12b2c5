"""Nonlinear functions as data: built, evaluated and differentiated; nothing in a file is executed."""

from cpbench.expressions.map import Builder, Map
from cpbench.expressions.operators import Operator

__all__ = ["Builder", "Map", "Operator"]
