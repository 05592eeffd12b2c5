"""The solvers of cpbench: algorithms of the literature, and the automatic choice among them.

They come in as those of any other package do, by the entry point `cpbench.plugins`.
"""

import pkgutil

from cpbench.solvers.base import solvers

KERNELS = f"{__name__}.kernels"
GROUPS = [m.name for m in pkgutil.iter_modules(__path__, f"{__name__}.") if m.ispkg and m.name != KERNELS]
"""Packages of formulations that share their mathematics."""

solvers.include(*GROUPS)
