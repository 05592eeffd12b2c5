"""Edges that a problem cannot take say which condition failed, with its number, and what to use instead."""

from __future__ import annotations

import itertools

import numpy as np
import planted
import planted_conic
import planted_contact
import pytest

from cpbench import graph
from cpbench.conversions.base import make
from cpbench.errors import NotApplicable
from cpbench.formulations import AVI, QP, Kind, MixedFrictionContact, Relay, RollingFrictionContact
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers.base import Budget, solvers


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def without_bound() -> AVI:
    return AVI(M=np.eye(3), q=np.ones(3), lb=[0.0, -np.inf, 0.0])


REFUSALS = {
    "free variable": ("avi-lcp-bounds", without_bound, r"1 variables have no bound, the first is 1; use avi-mlcp"),
    "rows beside the box": (
        "avi-lcp-bounds",
        lambda: planted_conic.avi(rng(), 5, 3, 1)[0],
        r"4 rows beside its bounds; use avi-mlcp",
    ),
    "infinite bound": ("avi-relay", without_bound, r"4 bounds are infinite.*use avi-lcp-bounds"),
    "far bounds": (
        "relay-lcp",
        lambda: Relay(M=np.eye(2), q=np.array([1.0, -2.0]), lb=np.full(2, -1e20), ub=np.full(2, 1e20)),
        r"max\|q\| = 2.0e\+00, max\|Mc\| = 1.0e\+20; use avi-mlcp",
    ),
    "linear objective": (
        "qp-qp-dual",
        lambda: QP.build(np.zeros((2, 2)), np.ones(2), lb=np.zeros(2)),
        r"Q \(2x2, rank 0\) is numerically singular.*use qp-mlcp or qp-coneqp",
    ),
    "indefinite objective": (
        "qp-qp-dual",
        lambda: QP.build(np.diag([1.0, -1.0]), np.ones(2)),
        r"least eigenvalue at unit diagonal -1.0e\+00",
    ),
    "cylinder": (
        "coneqp-soclcp",
        lambda: planted_conic.coneqp(rng(), 4, ProductCone.of((Cone.CYLINDER, 2, 3, np.ones(2))))[0],
        r"2 factors of K are cylinders",
    ),
    "no gradient": (
        "soclcp-coneqp",
        lambda: planted_conic.soclcp(rng(), None, "monotone")[0],
        r"M is not symmetric, asymmetry = [0-9.]+e[+-]",
    ),
    "no gradient in contact": (
        "fc-coneqp",
        lambda: planted.fc(rng(), 2, 3, "any")[0],
        r"W is not symmetric.*fc-soclcp",
    ),
    "gyroscopic terms": (
        "gfc-fcm",
        lambda: planted_contact.gfc(rng(), 2, 2, 1, 3, symmetric=False)[0],
        r"M is not symmetric.*use gfc-fc",
    ),
    "friction": (
        "gfc-mlcp",
        lambda: planted_contact.gfc(rng(1), 2, 2, 0, 3)[0],
        r"friction at \d contacts?, the first is \d with μ = 0\.\d+; use gfc-fc",
    ),
    "friction, local": ("fc-lcp-frictionless", lambda: planted.fc(rng(), 3, 3)[0], r"friction at \d contacts?"),
    "rolling in space": ("rfc-lcp-2d", lambda: planted_contact.rfc(rng(), 2, 5)[0], r"5 rows.*use rfc-lcp-facets"),
    "rolling in the plane": ("rfc-lcp-facets", lambda: planted_contact.rfc(rng(), 2, 3)[0], r"3 rows.*use rfc-lcp-2d"),
}


@pytest.mark.parametrize("what", REFUSALS)
def test_refused_with_a_number(what):
    name, problem, pattern = REFUSALS[what]
    with pytest.raises(NotApplicable, match=pattern):
        make(name).step(problem())


@pytest.mark.parametrize(
    ("edge", "knob"), [("fc-coneqp", "slip"), ("fc-soclcp", "slip"), ("fc-coneqp-tresca", "threshold")]
)
def test_frozen_terms_are_one_a_contact_and_not_negative(edge, knob):
    problem = planted.fc(rng(), 3, 3, "positive definite")[0]
    for values, pattern in (
        ((1.0, 2.0), "has 2 numbers, expected one for each of the 3"),
        ((1.0, -1.0, 0.0), "has -1"),
    ):
        assert pattern in str(make(edge, {knob: values}).obstacle(problem))


def duplicated_constraints(consistent: bool) -> tuple[MixedFrictionContact, object]:
    """The last bilateral constraint stated twice: R has rank 2 of 3; s agrees with itself or not."""
    problem, point = planted_contact.fcm(rng(3), 3, 2, 3)
    twice = [0, 1, 1]
    s = problem.s[twice] + (0.0 if consistent else np.array([0.0, 0.0, 1.0]))
    R = problem.R[np.ix_(twice, twice)]
    same = type(point)(r=point.r, lam=np.array([point.lam[0], 0.25 * point.lam[1], 0.75 * point.lam[1]]))
    mixed = MixedFrictionContact(W=problem.W, V=problem.V[:, twice], R=R, q=problem.q, s=s, mu=problem.mu, dimension=3)
    return mixed, same


def test_constraints_that_contradict_each_other_are_refused():
    problem, _ = duplicated_constraints(consistent=False)
    with pytest.raises(NotApplicable, match=r"R \(3x3, rank 2\) is singular and s is not in its range"):
        make("fcm-fc").step(problem)


def test_joints_that_repeat_each_other_keep_their_reactions():
    """K is singular, so v and λ do not follow from r at once; by way of fcm they do."""
    problem, point = planted_contact.gfc(rng(4), 3, 3, 1, 3)
    twice = [0, 0]
    doubled = type(problem)(
        M=problem.M, H=problem.H, G=problem.G[:, twice], f=problem.f, w=problem.w, b=problem.b[twice], mu=problem.mu
    )
    same = type(point)(v=point.v, r=point.r, lam=0.5 * point.lam[twice])
    with pytest.raises(NotApplicable, match="use gfc-fcm"):
        make("gfc-fc").step(doubled)
    arrival = graph.arrive(doubled, "fc")
    assert arrival.route.label == "gfc-fcm > fcm-fc"
    back = graph.lift(arrival.problem, graph.push(arrival.problem, same))
    assert doubled.residuals(back).error <= 1e-10


def test_relaxations_are_not_taken_unless_environment():
    problem = planted.fc(rng(), 3, 3, "positive definite")[0]
    with pytest.raises(graph.NoRoute, match="With --routes all: fc-coneqp"):
        graph.arrive(problem, "coneqp")
    assert graph.arrive(problem, "coneqp", graph.ALL).kind == Kind.RELAXATION


@pytest.mark.needs("cpbench_solvers")
def test_rolling_facets_converge():
    """One contact that slides and rolls at an angle no polygon has: the largest error over angles falls with ν."""
    errors = []
    for count in (4, 8, 16, 32):
        worst = 0.0
        for theta in np.linspace(0.0, 2.0 * np.pi / count, 7):
            way = np.array([np.cos(theta), np.sin(theta)])
            r = np.concatenate([[1.0], 0.5 * way, 0.25 * way])
            u = np.concatenate([[0.0], -2.0 * way, -1.0 * way])
            problem = RollingFrictionContact(W=np.eye(5), q=u - r, mu=[0.5], mu_r=[0.25])
            target = make("rfc-lcp-facets", {"facets": count}).step(problem)
            answer = lemke(target)
            worst = max(worst, problem.residuals(graph.lift(target, answer)).error)
        errors.append(worst)
    assert all(finer < 0.7 * coarser for coarser, finer in itertools.pairwise(errors)), errors


def lemke(target):
    return solvers.get("lemke").run(target, Budget(tolerance=1e-11)).point
