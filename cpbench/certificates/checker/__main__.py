"""Check certificates without cpbench: python cpbench/certificates/checker FILE... proves each again.

It needs Python, NumPy, h5py and python-flint, and shares no code with what makes certificates. A file is believed in
nothing: the hash of the problem is taken again of its data, solutions are solved for or enclosed again, and every
condition is checked over the rationals or in balls. Ends with 1 where a file proves less than it says.
"""

from __future__ import annotations

import sys

from all_solutions import enumeration
from ball_proofs import contacts, maps
from certificate_file import read, require
from polyhedral_proofs import polyhedral
from refutations import refutation


def check(path: str) -> str:
    """Prove what a file says and return it in words; raises ValueError where that fails."""
    own, data, answer, evidence = read(path)
    denied = f"no solution within {own['excluded']:.3g} of the answer's size" if own["excluded"] else ""
    if denied:
        denied += ", with its multipliers" if own["node"] in ("qp", "avi") and "direction" not in evidence else ""
        refutation(own, data, answer, evidence)
    counted = enumeration(own, data, evidence)
    if own["level"] == "refuted":
        require(bool(denied) or own["solutions"] == 0, "nothing is refuted")
        return "refuted: " + "; ".join(filter(None, (denied, counted)))
    level = "proved" if "held" in evidence or "point" in evidence else "enclosed"
    require(own["level"] == level, f"the level {own['level']} needs no proof, or has none")
    polyhedron = "held" in evidence
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
        try:
            print(f"{path}: {check(path)}")
        except (OSError, KeyError, ValueError, TypeError, IndexError, ZeroDivisionError) as cause:
            print(f"{path}: NOT PROVED: {cause}")
            bad = 1
    return bad


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
