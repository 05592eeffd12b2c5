"""The small problems of the lecture page, two to six unknowns each, so that every one can be written out.

The QP, NLP and contact problems keep their letters over several sections: what one section solves, the next converts.
"""

from __future__ import annotations

import dataclasses
from functools import cache

from cpbench import Problem
from lecture.numerics.examples import contact, linear, maps, variational


def problems() -> dict[str, Problem]:
    """Every problem by its name in the file that goes with the page."""
    return dict(_problems())


@cache
def _problems() -> tuple[tuple[str, Problem], ...]:
    """Made once: those with maps are converted."""
    made: dict[str, Problem] = {
        "qp": linear.quadratic(),
        "qp-repeated": linear.repeated_row(),
        "lcp": linear.symmetric(),
        "lcp-nonsymmetric": linear.nonsymmetric(),
        "lcp-three": linear.three_solutions(),
        "mlcp": linear.mixed(),
        "mlcp-singular": linear.singular(),
        "soclcp": variational.over_cone(),
        "coneqp": variational.program_over_cone(),
        "avi": variational.triangle(),
        "avi-box": variational.box(),
        "relay": variational.relay(),
        "sliding": contact.sliding(),
        "plane": contact.plane(),
        "dumbbell": contact.dumbbell(),
        "frictionless": contact.frictionless(),
        "frictionless-local": contact.frictionless_local(),
        "anisotropic": contact.anisotropic(),
        "rolling": contact.rolling(),
        "rolling-plane": contact.rolling_plane(),
        "rolling-global": contact.rolling_global(),
    }
    made |= maps.problems(made)
    return tuple((name, dataclasses.replace(problem, name=name)) for name, problem in made.items())
