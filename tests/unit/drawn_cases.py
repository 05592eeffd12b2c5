"""Random problems of every formulation with a known solution, for tests that draw a seed and a size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import planted
import planted_conic
import planted_contact
import planted_nonlinear as nonlinear
from hypothesis import strategies as st

from cpbench.formulations import Problem
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.testing.cases import Case


def draw(node: str, seed: int, size: int) -> Case:
    """Return a random case; what hypothesis draws are the seed and the size."""
    rng = np.random.default_rng(seed)
    sparse = bool(rng.integers(2))
    kind = str(rng.choice(["positive definite", "singular semidefinite", "monotone", "any"]))
    linear: dict[str, Callable[[], tuple[Problem, Any]]] = {
        "lcp": lambda: planted.lcp(rng, size, kind, sparse=sparse),
        "mlcp": lambda: planted.mlcp(rng, size, int(rng.integers(0, size + 1)), kind, sparse=sparse),
        "qp": lambda: planted.qp(rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), sparse=sparse),
        "fc": lambda: planted.fc(rng, size, int(rng.integers(2, 4)), kind, sparse=sparse),
        "gfc": lambda: planted_contact.gfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), sparse=sparse
        ),
        "fcm": lambda: planted_contact.fcm(
            rng, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), kind, sparse=sparse
        ),
        "rfc": lambda: planted_contact.rfc(rng, size, int(rng.choice([3, 5])), kind, sparse=sparse),
        "grfc": lambda: planted_contact.grfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.choice([3, 5])), sparse=sparse
        ),
        "afc": lambda: planted_contact.afc(rng, size, kind, sparse=sparse),
        "relay": lambda: planted_conic.relay(rng, size, kind, sparse=sparse),
        "avi": lambda: planted_conic.avi(
            rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), kind, sparse=sparse
        ),
        "soclcp": lambda: planted_conic.soclcp(rng, None, kind, sparse=sparse),
        "coneqp": lambda: planted_conic.coneqp(
            rng, size, None, "positive definite" if kind in ("monotone", "any") else kind, sparse=sparse
        ),
    }
    if node in linear:
        return Case(f"{kind}-{size}-{seed}", *linear[node]())
    few = int(rng.integers(0, 3))
    others: dict[str, Callable[[], tuple[Problem, Any]]] = {
        "ncp": lambda: nonlinear.ncp(rng, size, kind),
        "micp": lambda: nonlinear.micp(rng, size, kind),
        "equation": lambda: nonlinear.equation(rng, size, kind),
        "vi": lambda: nonlinear.vi(
            rng,
            size,
            None if few else nonlinear.product(rng),
            int(rng.integers(0, 4)),
            min(size, few),
            few,
            kind,
        ),
        "ge": lambda: nonlinear.ge(rng, size, None if few else nonlinear.product(rng), kind),
        "cp": lambda: nonlinear.cp(rng, ProductCone.of((Cone.NONNEGATIVE, 1, size)) if few else None, few, kind),
        "nlp": lambda: nonlinear.nlp(rng, size, few, int(size > 2), convex=kind != "any"),
        "qvi": lambda: (
            nonlinear.moving_box(rng, size, kind)
            if few == 0
            else nonlinear.friction_as_qvi(rng, size, 1 + few, kind)
            if few == 1
            else nonlinear.moving_rows(rng, size, 2, kind)
        ),
        "nfc": lambda: nonlinear.nfc(rng, 1 + size // 3, size, 2 + few % 2),
    }
    return Case(f"{kind}-{size}-{seed}", *others[node]())


NUMBERS = st.sampled_from([0.0, -0.0, 1.0, -1.0, 2.0]) | st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def maps(
    draw: st.DrawFn,
    operators: Sequence[Operator],
    inputs: tuple[int, int] = (1, 4),
    constants: st.SearchStrategy[float] = st.floats(-3, 3),  # noqa: B008 - a strategy has no state
    most: int = 12,
    rows: tuple[int, int] | None = (1, 5),
) -> Map:
    """Maps of at most so many operations: shared ones, chains, constants, bare variables.

    rows : how many, least and most; None for as many as there are unknowns.
    """
    n = draw(st.integers(*inputs))
    build = Builder(n)
    numbers = [*range(n), *(build.constant(c) for c in draw(st.lists(constants, min_size=1, max_size=4)))]
    for operator in draw(st.lists(st.sampled_from(operators), max_size=most)):
        recent = st.sampled_from(numbers[-5:]) | st.sampled_from(numbers)
        numbers.append(build.apply(operator, *(draw(recent) for _ in range(1 + operator.binary))))
    least, largest = rows or (n, n)
    return build.finish(draw(st.lists(st.sampled_from(numbers), min_size=least, max_size=largest)))
