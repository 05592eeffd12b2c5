"""The solvers of cpbench: algorithms of the literature, and the automatic choice among them.

They come in as those of any other package do, by the entry point `cpbench.plugins`.
"""

from cpbench.foundation import kernel_cache
from cpbench.solvers.base import solvers

GROUPS = ("lcp", "mlcp", "qp", "avi", "cone", "contact", "nonlinear")
"""Packages of formulations that share their mathematics."""

solvers.include(*(f"{__name__}.{group}" for group in GROUPS))
kernel_cache.include(f"{__name__}.kernels")
