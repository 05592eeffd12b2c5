"""Check certificates without cpbench: python cpbench_lab/certificates/checker FILE... proves each again.

It needs Python, NumPy, SciPy, h5py and python-flint, and shares no code with what makes certificates. A file is
believed in nothing: the hash of the problem is taken again of its data, solutions are solved for or enclosed again, and
every condition is checked over the rationals or in balls. Ends with 1 where a file proves less than it says.
"""

from __future__ import annotations

import sys
import zlib

from all_solutions import enumeration
from ball_proofs import contacts, maps
from certificate_file import read, require
from no_solutions import no_solution
from polyhedral_proofs import polyhedral

CHANGED = (OSError, LookupError, ValueError, TypeError, ArithmeticError, RuntimeError, zlib.error)
"""Errors that reading and proving a changed file raises; HDF5's own errors are RuntimeErrors."""


def check(path: str) -> str:
    """Prove what a file says and return it in words; raises ValueError where that fails."""
    own, data, answer, evidence = read(path)
    if own["level"] in ("infeasible", "unbounded"):
        return no_solution(own, data, evidence)
    counted = enumeration(own, data, evidence)
    if own["level"] in ("refuted", "measured"):
        require(own["solutions"] == 0 or (own["level"] == "measured" and bool(counted)), "nothing is proved")
        return f"{own['level']}: {counted}"
    polyhedron, exactly = "held" in evidence, "held" in evidence or "point" in evidence
    level = own["level"]
    known = ("distant", *(("proved", "stationary") if exactly else ("enclosed",)))
    require(level in known, f"the level {level} needs no proof, or has none")
    require(own["distance"] <= own["tolerance"] or level == "distant", "the answer is not within the tolerance")
    prove = polyhedral if polyhedron else maps if "F" in data else contacts
    prove(own, data, answer, evidence)
    require(polyhedron or not own["unique"], "uniqueness is not known of this formulation")
    unique = f", the only one ({own['unique']})" if own["unique"] else ""
    what = "a first-order solution" if own["node"] == "qp" and not unique else "a solution"
    near = f"{level}: {what}{unique} within {own['distance']:.3g} of the answer"
    if own["value_low"] == own["value_low"]:
        near += f", {'optimal ' if own['convex'] else ''}value {own['value_low']:.12g}"
    return "; ".join(filter(None, (near, counted)))


def main(paths: list[str]) -> int:
    """Check files; returns the exit code."""
    bad = 0
    for path in paths:
        try:
            print(f"{path}: {check(path)}")
        except CHANGED as cause:
            print(f"{path}: NOT PROVED: {cause}")
            bad = 1
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
