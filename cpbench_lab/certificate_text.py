"""Text for a reader: the content of a certificate."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cpbench_lab.certificates.certificate import Certificate


def summary(certificate: Certificate) -> str:
    """Return what a certificate says beside its level and distance, in a line."""
    parts = [
        f"unique: {certificate.unique}" if certificate.unique else "",
        number_of_solutions(certificate),
        certificate.reason,
    ]
    return "; ".join(filter(None, parts))


def number_of_solutions(certificate: Certificate) -> str:
    """Say how many solutions there are; '' where they were not counted, or are unique."""
    count = certificate.solutions
    if math.isnan(count) or certificate.unique:
        return ""
    if math.isinf(count):
        return "a continuum of solutions"
    if not count:
        return "there is no solution: all complementary bases were looked at"
    return f"{count:.0f} solutions, all listed"


def certificate_lines(certificate: Certificate) -> Iterator[str]:
    """Yield what a certificate says, for a reader."""
    from cpbench_lab.certificates.certificate import DISTANT

    yield f"  level      {certificate.level}: {_meaning(certificate)}"
    if not math.isnan(certificate.margin):
        yield f"  margin     {certificate.margin:.2g} of the sizes of its numbers"
    if not math.isnan(certificate.distance):
        away = f"at most {certificate.distance:.3g} of the solution's size"
        yield f"  distance   {away}" + (
            f", above the tolerance {certificate.tolerance:g}"
            if certificate.level == DISTANT and certificate.distance > certificate.tolerance
            else ""
        )
        if certificate.unique:
            enumerated = certificate.solutions == 1
            how = "all complementary bases were looked at" if enumerated else f"by its matrix: {certificate.unique}"
            yield f"  unique     {how}"
    counted = number_of_solutions(certificate)
    if counted:
        yield f"  solutions  {counted}"
        for x in certificate.evidence.get("solutions", ()):
            yield f"             ({', '.join(f'{v:.6g}' for v in x)})"
    if certificate.reason:
        yield f"  no proof   {certificate.reason}"
    yield f"  seconds    {certificate.seconds:.3g}"


def _meaning(certificate: Certificate) -> str:
    """Return what the level says of the answer, or of the problem."""
    first_order = certificate.node == "qp" and not certificate.unique
    known = "a point that meets the first-order conditions" if first_order else "a solution"
    if certificate.level == "distant":
        boxed = "centre" in certificate.evidence
        how = f"a box is proved to hold {known}" if boxed else f"{known} is known exactly"
        near = certificate.distance <= certificate.tolerance
        return f"{how}; {'the answer misses the tolerance by its error' if near else 'the answer is not near it'}"
    return {
        "proved": f"{known} is known exactly, and the answer is near it",
        "stationary": f"{known} is known exactly, and the answer is near it; the program is not convex",
        "enclosed": f"a box near the answer is proved to hold {known}",
        "refuted": "there is no solution",
        "measured": "nothing is proved",
        "infeasible": "no point meets the conditions, in rational arithmetic",
        "unbounded": "from a feasible point the objective falls along a ray for ever, in rational arithmetic",
    }[certificate.level]
