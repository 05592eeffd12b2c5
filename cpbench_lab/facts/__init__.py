"""Facts about problems and matrices: measured, each with its number and how it was found.

`of_problem(problem)` measures every matrix of a problem, `of_matrix(M, name)` one of them. No test takes longer than a
bound that its module states; beyond it a fact is `not decided`, with the reason.
"""

from cpbench_lab.facts.fact import Fact, How
from cpbench_lab.facts.problem import of_matrix, of_problem
from cpbench_lab.facts.sign_classes import p_matrix, z_matrix
from cpbench_lab.facts.spectrum import definiteness, rank, symmetry

__all__ = [
    "Fact",
    "How",
    "definiteness",
    "of_matrix",
    "of_problem",
    "p_matrix",
    "rank",
    "symmetry",
    "z_matrix",
]
