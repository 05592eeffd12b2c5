"""cpbench benchmarks solvers of complementarity problems and converts the problems between formulations."""

__version__ = "0.1.0"
