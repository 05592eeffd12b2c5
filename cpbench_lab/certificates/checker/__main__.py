"""Check certificates without cpbench: python cpbench_lab/certificates/checker FILE... proves each again, and of results
files that of every row, with what the row says.

It needs Python, NumPy, h5py and python-flint, and shares no code with what makes certificates. A file is believed in
nothing: the hash of the problem is taken again of its data, solutions are solved for or enclosed again, and every
condition is checked over the rationals or in balls. Ends with 1 where a file proves less than it says.
"""

from __future__ import annotations

import sys
import zlib
from typing import Any

from all_solutions import enumeration
from ball_proofs import contacts, maps
from certificate_file import read, require
from no_solutions import no_solution
from polyhedral_proofs import polyhedral
from refutations import refutation
from result_rows import is_results_file, rows

CHANGED = (OSError, LookupError, ValueError, TypeError, ArithmeticError, RuntimeError, zlib.error)
"""What reading and proving a file that was changed raises; HDF5's own errors are RuntimeErrors."""


def check(path: str) -> str:
    """Prove what a file says and return it in words; raises ValueError where that fails."""
    return proved(*read(path))


def proved(own: dict[str, Any], data: dict[str, Any], answer: Any, evidence: dict[str, Any]) -> str:
    """Prove what a certificate says and return it in words; raises ValueError where that fails."""
    if own["level"] in ("infeasible", "unbounded"):
        return no_solution(own, data, evidence)
    denied = f"no solution within {own['excluded']:.3g} of the answer's size" if own["excluded"] else ""
    if denied:
        denied += ", with its multipliers" if own["node"] in ("qp", "avi") and "direction" not in evidence else ""
        refutation(own, data, answer, evidence)
    counted = enumeration(own, data, evidence)
    if own["level"] in ("refuted", "measured"):
        proof = bool(denied) or own["solutions"] == 0 or (own["level"] == "measured" and bool(counted))
        require(proof, "nothing is proved")
        return f"{own['level']}: " + "; ".join(filter(None, (denied, counted)))
    polyhedron, exactly = "held" in evidence, "held" in evidence or "point" in evidence
    level = own["level"]
    known = ("distant", *(("proved", "stationary") if exactly else ("enclosed",)))
    require(level in known, f"the level {level} needs no proof, or has none")
    if own["format_version"] > 2:  # before, answers of every distance were proved
        near = own["distance"] <= own["tolerance"] and own["excluded"] < own["tolerance"]
        require(near != (level == "distant"), f"the answer is {'' if near else 'not '}within the tolerance")
    prove = polyhedral if polyhedron else maps if "F" in data else contacts
    prove(own, data, answer, evidence)
    require(polyhedron or not own["unique"], "uniqueness is not known of this formulation")
    unique = f", the only one ({own['unique']})" if own["unique"] else ""
    what = "a first-order solution" if own["node"] == "qp" and not unique else "a solution"
    near = f"{level}: {what}{unique} within {own['distance']:.3g} of the answer"
    return "; ".join(filter(None, (near, denied, counted)))


def main(paths: list[str]) -> int:
    """Check files; returns the exit code."""
    bad = 0
    for path in paths:
        for name, parts in rows(path) if is_results_file(path) else [(path, lambda path=path: read(path))]:
            try:
                print(f"{name}: {proved(*parts())}")
            except CHANGED as cause:
                print(f"{name}: NOT PROVED: {cause}")
                bad = 1
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
