"""Problem files: one file format a module, chosen by content; reading runs nothing, writing is all or nothing."""

from cpbench.storage.answers import guesses, load_answer, save_answer, save_point, solution
from cpbench.storage.arrays import read_array, read_matrix, read_vector
from cpbench.storage.base import Format, formats
from cpbench.storage.dispatch import load, members, problem_files, save, save_pack

__all__ = [
    "Format",
    "formats",
    "guesses",
    "load",
    "load_answer",
    "members",
    "problem_files",
    "read_array",
    "read_matrix",
    "read_vector",
    "save",
    "save_answer",
    "save_pack",
    "save_point",
    "solution",
]
