"""Adapters of other people's solvers, one a file. The package that solves is imported on first use.

They come in by the entry point `cpbench.plugins`, as those of any other package do; `cpbench` does not import them.
"""

from cpbench.solvers.base import solvers

solvers.include(__name__)
