"""What conformance does not see of the nonlinear edges: multipliers of published programs, promises, NCP functions."""

from __future__ import annotations

import itertools

import numpy as np
import planted
import planted_nonlinear
import pytest
from planted_nonlinear import graph as formula
from tiers import some_by_day

from cpbench import graph
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import plan
from cpbench.conversions import make
from cpbench.errors import NoRoute, NotApplicable
from cpbench.formulations import (
    LCP,
    NLP,
    VI,
    EquationPoint,
    Kind,
    MiCP,
    MiCPPoint,
)
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions.recording import recorded
from cpbench.formulations.ncp_functions import symbolic_fischer_burmeister
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.generators import generators
from cpbench.graph.routes import nodes_of_maps
from cpbench.solvers.base import solvers

INF = np.inf
PROGRAMS = {i.name: i for c in generators if c.name.startswith("hock-schittkowski") for i in c.instances()}
EQUATIONS = ("min", "fb", "pfb", "ep", "normal")


def chain(problem, *edges):
    """The problem after conversions (name, knobs) or names."""
    for edge in edges:
        problem = (make(edge) if isinstance(edge, str) else make(*edge)).step(problem)
    return problem


def newton(problem, z, steps=60):
    """Newton's method with least-squares steps on F(z) = 0, halved while ‖F‖ grows; the best z."""
    value = problem.F(z)
    for _ in range(steps):
        if np.linalg.norm(value) <= 1e-13:
            break
        step = np.linalg.lstsq(problem.F.jacobian(z).toarray(), -value, rcond=1e-12)[0]
        for t in 0.5 ** np.arange(12):
            trial = problem.F(z + t * step)
            if np.linalg.norm(trial) < np.linalg.norm(value):
                break
        else:
            break
        z, value = z + t * step, trial
    return z


# ------------------------------------------------------------------------ programs and their multipliers


def test_multipliers_are_those_that_are_published():
    """hs71: Ipopt's tutorial (Wächter 2009) prints λ = 0.5522937 and 0.1614686, and z_L₁ = 1.0878712."""
    problem = PROGRAMS["hs71"].problem
    target = chain(problem, ("nlp-micp", {"qualified": 1}), "micp-equation-min")
    start = np.array([1.0, 4.7, 3.8, 1.4, 0.5, -0.1])
    answer = graph.lift(target, EquationPoint(z=newton(target, start)))
    assert problem.objective(answer.z) == pytest.approx(17.0140173, abs=1e-7)
    np.testing.assert_allclose(answer.lam, [0.5522937], atol=1e-7)
    np.testing.assert_allclose(np.abs(answer.mu), [0.1614686], atol=1e-7)
    np.testing.assert_allclose(answer.nu, [1.0878712, 0.0, 0.0, 0.0], atol=1e-7)


@pytest.mark.parametrize("edge", ["nlp-micp", "nlp-ge"])
def test_what_an_edge_promises_of_a_program(edge):
    """Slater's point, none, affine rows without convexity, and neither."""
    qualified, _ = planted_nonlinear.nlp(np.random.default_rng(0), 5, 2, 1)
    assert make(edge).exactness(qualified) == Kind.EQUIVALENT
    unknown, _ = planted_nonlinear.nlp(np.random.default_rng(0), 5, 2, 1, slater=False)
    assert make(edge).exactness(unknown) == Kind.ONE_WAY
    assert "the start" in make(edge).reservation(unknown)
    waves = NLP(f=formula(2, lambda x: np.sin(x).sum()), h=formula(2, lambda x: x[0] - x[1]))
    assert make(edge).exactness(waves) == Kind.NECESSARY
    hopeless = NLP(f=formula(2, np.sum), h=formula(2, lambda x: x[0] * x[1] - 1.0))
    with pytest.raises(NotApplicable, match=rf"1 rows of g and h are not affine.*{edge}\[qualified=1\]"):
        make(edge).step(hopeless)
    assert make(edge, {"qualified": 1}).exactness(hopeless) == Kind.NECESSARY
    with pytest.raises(NoRoute, match="is necessary for this problem"):
        graph.arrive(waves, make(edge).target)


def test_a_minimum_without_multipliers_is_why_an_edge_is_one_way_only():
    """min x over −x² ≥ 0: x = 0, where 1 + 2xλ = 0 has no solution."""
    problem = NLP(f=formula(1, lambda x: x), g=formula(1, lambda x: -x * x), convex=True)
    assert make("nlp-micp").exactness(problem) == Kind.ONE_WAY
    target = chain(problem, "nlp-micp")
    best = min(target.residuals(MiCPPoint(z=[x, lam])).error for x in (-1e-3, 0.0) for lam in (0.0, 1.0, 500.0, 1e3))
    assert best >= 1e-6


def test_the_forces_on_z_become_multipliers_of_its_bounds():
    """Pressed against lb, against ub, free with a rest, fixed, fixed but for more than its force; of two small numbers
    the smaller is 0."""
    prices = np.array([1.0, -1.0, 1e-9, -3.0, 1e-3])
    problem = NLP(f=formula(5, lambda x: prices @ x), lb=[0, 0, 0, 2, 2], ub=[1, 1, 1, 2, 2])
    lifted = graph.lift(chain(problem, "nlp-micp"), MiCPPoint(z=[1e-9, 1.0, 0.5, 2.0, 2.01]))
    np.testing.assert_array_equal(lifted.nu, [1.0, -1.0, 0.0, -3.0, 1e-3])


# -------------------------------------------------------------------------------------------- inequalities


def test_what_an_edge_promises_of_a_set():
    """Rows that are affine, that Slater's point is inside of, that none is known of; a cone with rows."""
    F = formula(2, lambda x: x)
    disk = formula(2, lambda x: 1.0 - x @ x)
    cone = cone_fields(ProductCone.of((Cone.SECOND_ORDER, 1, 2, 1.0)))
    for g, fields, micp, ge in (
        (None, {}, Kind.EQUIVALENT, Kind.EQUIVALENT),
        (None, {"A": np.ones((1, 2)), "b": [3.0]}, Kind.EQUIVALENT, Kind.EQUIVALENT),
        (formula(2, lambda x: x - 1.0), {}, Kind.EQUIVALENT, Kind.EQUIVALENT),
        (disk, {}, Kind.EQUIVALENT, Kind.EQUIVALENT),
        (disk, {"start": [1.0, 0.0]}, Kind.ONE_WAY, Kind.ONE_WAY),
        (disk, {"lb": [0.5, 0.5]}, Kind.ONE_WAY, Kind.ONE_WAY),
        (disk, {"C": np.ones((1, 2)), "d": [0.5]}, Kind.ONE_WAY, Kind.ONE_WAY),
        (None, {"A": np.ones((1, 2)), **cone}, None, Kind.ONE_WAY),
        (None, cone, None, Kind.EQUIVALENT),
    ):
        problem = VI(F=F, g=g, **fields)
        assert make("vi-ge").exactness(problem) == ge
        if micp is None:
            assert "second-order, which is no box" in make("vi-micp").obstacle(problem)
        else:
            assert make("vi-micp").exactness(problem) == micp


def test_a_complementarity_problem_is_one_over_the_orthant():
    """The chain of the lecture, NCP → MiCP → VI → CP: bounds 0 have become the factors of the cone."""
    problem, point = planted_nonlinear.ncp(np.random.default_rng(3), 6)
    target = chain(problem, "ncp-micp", "micp-vi", "vi-cp")
    assert [Cone(int(k)) for k in target.cone_kind] == [Cone.NONNEGATIVE]
    there = graph.push(target, point)
    assert target.residuals(there).error <= 1e-12
    mixed = MiCP(F=problem.F, lb=[0, -INF, -INF, 0, 0, 0], ub=[INF, INF, INF, INF, 0, 0])
    cones = chain(mixed, "micp-vi", "vi-cp")
    assert [(Cone(int(k)).name, int(n)) for k, n in zip(cones.cone_kind, cones.cone_size, strict=True)] == [
        ("NONNEGATIVE", 1), ("FREE", 2), ("NONNEGATIVE", 1), ("ZERO", 2),
    ]  # fmt: skip
    for lb, ub, why in (
        ([1, 0, 0, 0, 0, 0], [INF] * 6, "bounds that are not 0"),
        ([-INF] * 6, [0] * 6, "from above alone"),
    ):
        with pytest.raises(NotApplicable, match=why):
            chain(MiCP(F=problem.F, lb=lb, ub=ub), "micp-vi", "vi-cp")


def test_games_become_the_conditions_of_all_players():
    """qvi → micp: moving bounds and rows of the duopoly have multipliers, which the lift may leave or needs."""
    games = {i.name: i for i in generators.get("qvi-games").instances()}
    for name, unknowns in (("duopoly", 4), ("duopoly-rows", 2 + games["duopoly-rows"].problem.g.rows)):
        game = games[name]
        target = chain(game.problem, "qvi-micp")
        assert target.start.size == unknowns
        assert target.residuals(graph.push(target, game.solution)).error <= 1e-12
        again = graph.lift(target, graph.push(target, game.solution))
        assert game.problem.residuals(again).error <= 1e-12
    friction = next(i.problem for i in generators.get("qvi-friction").instances() if not i.problem.only_box)
    assert "which is no box" in make("qvi-micp").obstacle(friction)


def test_rows_of_g_that_are_affine_become_rows_of_a_polyhedron():
    rng = np.random.default_rng(5)
    problem, point = planted_nonlinear.vi(rng, 5, None, 2, 1, law="affine")
    E, e = rng.standard_normal((2, 5)), np.array([-1.0, -2.0])
    nu = np.array([0.0, 0.0])
    wider = VI(
        F=problem.F, A=problem.A, b=problem.b, C=problem.C, d=problem.d, lb=problem.lb, ub=problem.ub,
        g=formula(5, lambda x: E @ (x - point.z) - e),
    )  # fmt: skip
    target = chain(wider, "vi-avi")
    there = graph.push(target, type(point)(z=point.z, lam=point.lam, mu=point.mu, nu=nu))
    assert there.lam.size == 4
    assert target.residuals(there).error <= 1e-12


# ------------------------------------------------------------------------------------------- NCP functions


def at(how, z, w, lb, ub, **knobs):
    """Φ(z) of one unknown with F(z) = w whatever z is."""
    problem = MiCP(F=formula(1, lambda x: w + 0.0 * x), lb=[lb], ub=[ub])
    return float(make(f"micp-equation-{how}", knobs).step(problem).F(np.array([z]))[0])


@pytest.mark.parametrize("how", ["min", "fb", "pfb", "ep"])
@pytest.mark.parametrize(("lb", "ub"), some_by_day([(0.0, INF), (-INF, 3.0), (0.0, 3.0), (-INF, INF), (1.0, 1.0)], 2))
def test_an_equation_is_zero_where_the_law_holds_and_nowhere_else(how, lb, ub):
    """On a grid: beyond, at and between the bounds, with F of both signs and 0. −1 and 2 − √3 fool the printed (38)."""
    for z, w in itertools.product((-1.0, 0.0, 1.0, 2.0 - 3.0**0.5, 3.0, 4.0), (-1.0, 0.0, 2.0 - 3.0**0.5, 1.0)):
        natural = z - float(np.clip(z - w, lb, ub))
        value = at(how, z, w, lb, ub)
        assert (abs(value) <= 1e-15) == (abs(natural) <= 1e-15), (z, w, value)
        assert value * natural >= 0.0, (z, w)


def test_fischer_burmeister_keeps_its_digits_and_has_a_derivative_everywhere():
    phi = recorded(2, lambda z: symbolic_fischer_burmeister(z[:1], z[1:]))
    assert phi(np.array([1e8, 1e-8]))[0] == pytest.approx(1e-8, rel=1e-12)
    for point in (
        [0.0, 0.0],
        [1.0, 0.0],
        [0.0, 2.0],
        [-1.0, 0.0],
        [3.0, -3.0],
        [1e-300, 0.0],
        [0.5, 2.0],
        [-1.0, -2.0],
    ):
        x = np.array(point)
        slope = phi.jacobian(x).toarray().ravel()
        assert np.isfinite(slope).all(), point
        size = np.hypot(*x)
        if size > 1e-200:
            np.testing.assert_allclose(slope, 1.0 - x / size, atol=1e-12)


def test_shares_of_the_penalty():
    assert at("pfb", 2.0, 2.0, 0.0, INF, share=0.5) == pytest.approx(0.5 * (4.0 - 8.0**0.5) + 0.5 * 4.0)
    assert at("pfb", 2.0, 2.0, 0.0, INF) == pytest.approx(0.95 * (4.0 - 8.0**0.5) + 0.05 * 4.0)
    for share in (0.0, 1.0, -1.0):
        with pytest.raises(NotApplicable, match="share"):
            at("pfb", 2.0, 2.0, 0.0, INF, share=share)


@pytest.mark.parametrize("how", some_by_day(EQUATIONS, 2))
def test_asking_for_what_an_equation_asks_for_is_enough(how):
    """Roots of Φ to the tolerance asked solve the MiCP, at ties too: there Φ = δ leaves √δ of (38). 0 is in the box."""
    asked = 1e-5
    edge = make(f"micp-equation-{how}")
    for seed in range(20):
        rng = np.random.default_rng(seed)
        z, w = planted.complementary(rng, 8)
        ub = np.where(rng.random(8) < 0.5, np.where(rng.random(8) < 0.5, np.maximum(z, 0.5), 3.0), INF)
        w[z == ub] = -rng.uniform(0.0, 1.0, int((z == ub).sum())) * (seed % 2)
        F = planted_nonlinear.monotone(rng, z, w * (seed % 4 < 3), "positive definite", "tanh")
        problem = MiCP(F=F, lb=np.zeros(8), ub=ub)
        point = MiCPPoint(z=z)
        assert problem.residuals(point).error <= 1e-12
        target = edge.step(problem)
        root = graph.push(target, point).z
        way = rng.standard_normal(8)
        size = 1.0
        while target.residuals(EquationPoint(z=root + size * way)).error > edge.tolerance(asked, {}):
            size *= 0.5
        lifted = graph.lift(target, EquationPoint(z=root + size * way))
        assert problem.residuals(lifted).error <= asked, seed


def test_the_normal_map_is_zero_beside_the_solution():
    """At z − F(z), not at z; F is not asked for values outside the box."""
    problem = MiCP(F=formula(2, lambda x: np.log(x) + 2.0), lb=[0.5, 0.1], ub=[2.0, 3.0])
    target = chain(problem, "micp-equation-normal")
    z = np.array([0.5, np.exp(-2.0)])
    x = graph.push(target, MiCPPoint(z=z)).z
    assert x[0] == pytest.approx(0.5 - (np.log(0.5) + 2.0))
    np.testing.assert_allclose(target.F(x), 0.0, atol=1e-15)
    assert np.linalg.norm(target.F(z)) > 1.0
    assert np.isfinite(target.F(np.array([-5.0, -7.0]))).all()
    np.testing.assert_allclose(graph.lift(target, EquationPoint(z=x)).z, z, atol=1e-15)


# --------------------------------------------------------------------------------------- one Newton step


@pytest.mark.parametrize("seed", some_by_day(range(5), 2))
def test_steps_of_josephy_and_newton_converge_quadratically(seed):
    """The conversion again and again, `at` the answer before; the MLCPs by trying every active set."""
    problem, point = planted_nonlinear.micp(np.random.default_rng(seed), 6, "positive definite", "exp")
    z, errors = point.z + 0.05, []
    for _ in range(5):
        target = make("micp-mlcp", {"at": tuple(z)}).step(problem)
        answer = planted.enumerate_mlcp(target)
        assert answer is not None
        z = graph.lift(target, answer).z
        errors.append(np.linalg.norm(z - point.z))
    assert errors[-1] <= 1e-12
    steps = [(a, b) for a, b in itertools.pairwise(errors) if 1e-6 < a < 0.1 and b > 1e-14]
    assert all(b <= 20.0 * a * a for a, b in steps), errors


def test_a_linearization_has_the_blocks_of_the_jacobian():
    """A, C, D, B are blocks of F′(z_k), a = G(z_k) − Au_k − Cv_k, b = H(z_k) − Du_k − Bv_k."""
    F = planted_nonlinear.monotone(np.random.default_rng(2), np.ones(4), np.zeros(4), "any", "exp")
    problem = MiCP.from_index_set(F, [1, 3], start=[0.5, 2.0, -1.0, 0.25])
    target, z = chain(problem, "micp-mlcp"), problem.start
    J, value = F.jacobian(z).toarray(), F(z)
    u, v = [0, 2], [1, 3]
    for name, rows, columns in (("A", u, u), ("C", u, v), ("D", v, u), ("B", v, v)):
        np.testing.assert_array_equal(getattr(target, name).toarray(), J[np.ix_(rows, columns)])
    np.testing.assert_allclose(target.a, (value - J @ z)[u], atol=1e-14)
    np.testing.assert_allclose(target.b, (value - J @ z)[v], atol=1e-14)
    assert make("micp-mlcp").exactness(problem) == Kind.APPROXIMATE


def test_a_linearization_of_an_affine_map_is_exact_over_any_box():
    """z = (1, ½): at its bound under a force of 1, and within; M is not symmetric, and no bound is 0."""
    M, q = np.array([[2.0, 1.0], [-1.0, 3.0]]), np.array([-1.5, -0.5])
    problem = MiCP(F=formula(2, lambda x: M @ x + q), lb=[1.0, -2.0], ub=[4.0, INF], start=[3.0, 0.0])
    target = chain(problem, "micp-mlcp")
    np.testing.assert_allclose(graph.lift(target, planted.enumerate_mlcp(target)).z, [1.0, 0.5], atol=1e-12)


def test_a_step_refuses_where_there_is_no_derivative():
    problem = MiCP(F=formula(1, np.log), lb=[0.0], ub=[INF])
    with pytest.raises(NotApplicable, match="not finite at z_k"):
        chain(problem, "micp-mlcp")
    with pytest.raises(NotApplicable, match="at has 2 numbers, the problem has 1"):
        chain(problem, ("micp-mlcp", {"at": (1.0, 2.0)}))
    assert chain(problem, ("micp-mlcp", {"at": (2.0,)})).a.size == 0


# --------------------------------------------------------------------------------------------------- routes


def test_no_path_makes_a_detour_through_maps():
    """From matrices to maps and back, or from maps to matrices after the first step."""
    maps = nodes_of_maps()
    for source, target in (
        ("lcp", "qp"),
        ("mlcp", "lcp"),
        ("avi", "mlcp"),
        ("nlp", "lcp"),
        ("nfc", "lcp"),
        ("vi", "qp"),
    ):
        for route in graph.candidates(source, target, graph.ALL):
            back = [k for k, edge in enumerate(route.steps) if edge.source in maps and edge.target not in maps]
            assert back in ([], [0]), route.label
    assert graph.candidates("ncp", "qp")
    assert {"lcp", "qp", "avi"} <= set(graph.reachable("ncp"))


def test_affine_problems_reach_solvers_of_linear_ones_and_others_do_not():
    rng = np.random.default_rng(4)
    affine, _ = planted_nonlinear.ncp(rng, 5, "positive definite", "affine")
    assert graph.arrive(affine, "mlcp").route.label == "ncp-lcp > lcp-mlcp"
    curved, _ = planted_nonlinear.ncp(rng, 5, "positive definite", "exp")
    with pytest.raises(NoRoute, match=r"ncp-lcp: F is not affine: it has [3-5] nonlinear terms"):
        graph.arrive(curved, "mlcp")


def test_a_matrix_with_too_many_entries_stays_one():
    problem = LCP(M=np.ones((1826, 1826)), q=np.ones(1826))
    with pytest.raises(NotApplicable, match="a map of it has up to 10002828 operations"):
        chain(problem, "lcp-ncp")


def test_a_run_that_names_no_solver_keeps_problems_of_matrices_with_solvers_of_matrices():
    maps = nodes_of_maps()
    mapped = next(s.spec for s in solvers if s.spec.node in maps and s.spec.by_default)
    for node in ("lcp", mapped.node):
        survey = Surveyed(
            address="a", format=None, problem="p", fingerprint="f", node=node, family="", sizes={}, features={},
            nodes={"exact": [node, mapped.node]},
        )  # fmt: skip
        for detours in (True, False):
            found = plan.pairs([survey], [plan.Entry(mapped.name)], [plan.exact()], 1e-6, detours=detours)
            assert bool(found) == (detours or node in maps)
