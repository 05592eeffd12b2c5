"""The lecture page: every equation and conversion, numbers that are the library's, nothing from elsewhere."""

from __future__ import annotations

import math
import re
from dataclasses import fields, is_dataclass
from html.parser import HTMLParser

import numpy as np
import pytest
from click.testing import CliRunner
from lecture import formulas, numbers, overview, page, solvable
from lecture.blocks import Formula, Section, Table, Text, Try
from lecture.numerics import complementary_cones, examples
from lecture.numerics.examples import maps, nonlinear
from lecture.numerics.facet_errors import bounds, faceted_slide
from lecture.numerics.round_trips import answer, outcome

import cpbench
from cpbench.cli import cli
from cpbench.formulations.expressions import infix


@pytest.fixture(scope="module")
def sections() -> list[Section]:
    return [make() for make in page.SECTIONS]


@pytest.fixture(scope="module")
def html(sections) -> str:
    return page.html(sections)


def parts(thing):
    """All blocks of a section, those inside others too."""
    if is_dataclass(thing):
        yield thing
        for f in fields(thing):
            yield from parts(getattr(thing, f.name))
    elif isinstance(thing, tuple):
        for inner in thing:
            yield from parts(inner)


def test_every_equation_of_the_lecture_stands_on_the_page_once_and_in_order(sections, html):
    numbered = [k for one in sections for part in parts(one) if isinstance(part, Formula) for k in part.equations]
    assert numbered == list(range(1, 50))
    for k in numbered:
        assert html.count(f'id="eq-{k}"') == 1
        assert f'href="#eq-{k}" aria-label="equation {k}">{k}<' in html


def test_facet_table_shows_the_errors_that_solving_gives(html):
    for count, angle in ((4, "44.5"), (8, "22"), (16, "11"), (64, "2.75")):
        assert numbers.number(faceted_slide("inner", count).largest_slip_angle, 3) == angle
        assert re.search(rf'<th scope="row">{count}</th><td><data>{re.escape(angle)}</data></td>', html)


@pytest.mark.parametrize("side", ["inner", "outer"])
@pytest.mark.parametrize("facets", [4, 6, 10])
def test_resistance_is_the_support_function_of_the_polygon(side: str, facets: int) -> None:
    """Over a polygon with corners c the friction at full sliding is max cᵀt: the corners made here, not by the edge."""
    slide = faceted_slide(side, facets, mu=0.7, step=7.5)
    start, radius = (0.0, 1.0) if side == "inner" else (math.pi / facets, 1 / math.cos(math.pi / facets))
    turn = start + 2 * math.pi / facets * np.arange(facets)
    t = np.radians(slide.direction)
    expected = (radius * np.cos(t[:, None] - turn[None, :])).max(axis=1)
    np.testing.assert_allclose(slide.resistance, expected, atol=1e-4)
    assert slide.radius_error <= bounds(np.array(float(facets)))[side] * (1 + 1e-4)


class _Page(HTMLParser):
    """Tags that are open, ids, and whatever refers to something."""

    VOID = frozenset({"meta", "link", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.refers: list[str] = []
        self.tags: set[str] = set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "src", "xlink:href", "action", "srcset"):
                self.refers.append(value)
            if value and "url(" in value:
                self.refers += re.findall(r"url\(([^)]*)\)", value)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.open.pop()


def test_page_is_well_formed_and_refers_to_nothing_but_itself(html):
    parsed = _Page()
    parsed.feed(html)
    assert not parsed.open
    assert len(parsed.ids) == len(set(parsed.ids))
    for target in parsed.refers:
        assert target.startswith(("#", "data:")), target
        assert not target.startswith("#") or target[1:] in parsed.ids, target
    assert "://" not in html
    assert not parsed.tags & {"script", "iframe", "object", "embed", "img", "form"}
    assert len(html.encode()) < 2_000_000


def test_numbers_are_computed_not_typed(sections):
    """Templates have no decimal number; every «name» has its value, and every value a «name»."""
    for one in sections:
        for part in parts(one):
            if isinstance(part, Text):
                assert set(re.findall("«([^»]+)»", part.template)) <= set(part.values), part.template
                words = re.sub(r"\$[^$]*\$", "", part.template)
                assert not re.search(r"\d\.\d", words), part.template
            if isinstance(part, Table):
                known = set(part.values)
                cells = [cell for row in part.rows for cell in row if isinstance(cell, str)]
                for cell in (*cells, part.caption):
                    assert set(re.findall("«([^»]+)»", cell)) <= known
                    assert not re.search(r"\d\.\d", re.sub(r"\$[^$]*\$", "", cell)), cell


@pytest.mark.parametrize("example", [nonlinear.kojima_shindo(), nonlinear.hock_schittkowski_14(), nonlinear.hump()])
def test_derivatives_of_the_nonlinear_examples(example, rng):
    x = rng.normal(size=example.start.size)
    for way in np.eye(x.size):
        measured = (example.value(x + 1e-6 * way) - example.value(x - 1e-6 * way)) / 2e-6
        assert np.allclose(measured, example.jacobian(x) @ way, atol=1e-7)
    for solution in example.solutions:
        assert example.residual(solution) < 1e-14


def test_maps_are_those_of_the_examples_written_by_hand(rng):
    known = examples.problems()
    four, program = nonlinear.kojima_shindo(), nonlinear.hock_schittkowski_14()
    for example, problem, order in (
        (four, known["kojima-shindo"], [0, 1, 2, 3]),
        (program, known["program-conditions"], [0, 1, 3, 2]),  # the library has λ before μ
    ):
        x = rng.normal(size=4)
        assert np.allclose(problem.F(x[order])[order], example.value(x), atol=1e-13)
        assert np.allclose(
            problem.F.jacobian(x[order]).toarray()[np.ix_(order, order)], example.jacobian(x), atol=1e-13
        )
    assert np.allclose(answer(known["program"]).point.z, program.solutions[0][:2], atol=1e-12)


def test_formulas_on_the_page_say_what_the_maps_are(rng):
    """The LaTeX, read as SymPy would, has the values of the map."""
    for name, problem in examples.problems().items():
        for F in problem.maps().values():
            if not F.rows or name == "kojima-shindo-equation":
                continue
            z = rng.uniform(0.1, 2.0, size=F.inputs)
            letters = tuple(f"x_{{{k}}}" for k in range(F.inputs))
            for row, value in zip(infix.formulas(F, letters, formulas.LONGEST), F(z), strict=True):
                python = re.sub(r"\\sqrt\{(.*?0\.01)\}", r"(\1)**0.5", formulas.latex(row)).replace(" \\cdot ", "*")
                python = re.sub(r"x_\{(\d+)\}", r"x[\1]", python).replace("^{", "**(").replace("}", ")")
                python = re.sub(r"(?<=[\w\])]) (?=[\w(])", "*", python)
                assert eval(python, {"x": z}) == pytest.approx(value, abs=1e-12), (name, row, python)


def test_solution_over_the_disk_is_pushed_straight_out():
    problem = examples.problems()["disk"]
    z = answer(problem).point.z
    F = problem.F(z)
    assert abs(np.linalg.norm(z) - 1.0) < 1e-14
    assert abs(F[0] * z[1] - F[1] * z[0]) < 1e-14
    assert F @ z < -0.1


def test_both_solutions_of_four_unknowns_are_found_by_each_function():
    for edge in solvable.EDGES.values():
        for start, solution in zip(solvable.STARTS, ((1, 0, 3, 0), (6**0.5 / 2, 0, 0, 0.5)), strict=True):
            problem = maps.converted(maps.four_unknowns(start), "ncp-micp", edge)
            # (38) is singular at the second one: z is known to the root of the error, asked to be 1e-12
            assert np.allclose(outcome(problem, "newton-equation"), solution, atol=1e-5), edge


@pytest.mark.nightly
def test_commands_on_the_page_work(sections, tmp_path, monkeypatch):
    runner = CliRunner()
    path = page.write(tmp_path, (overview.section,))
    assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
    monkeypatch.chdir(tmp_path)
    lines = [line for one in sections for part in parts(one) if isinstance(part, Try) for line in part.lines]
    assert len(lines) > 20
    for line in lines:
        program, *arguments = line.split()
        assert program == "cpbench"
        done = runner.invoke(cli, arguments, catch_exceptions=False)
        # of an answer on facets, say, `solve` measures the error and ends with 1
        measured = arguments[0] in ("solve", "verify") and "error " in done.output
        assert done.exit_code == 0 or (measured and done.exit_code == 1), f"{line}: {done.output}"


def test_the_tutorial_is_a_page_and_its_problems(tmp_path):
    path = page.write(tmp_path / "x", (overview.section,))
    assert path == tmp_path / "x" / "index.html"
    assert (tmp_path / "x" / "problems.h5").is_file()


def test_complementary_cones_hold_q_where_there_is_a_solution(rng):
    """By trying every α; and Lemke's method ends at one of them where M is a P-matrix."""
    counts, after = set(), 0
    for _ in range(60):
        M, q = rng.standard_normal((2, 2)), rng.standard_normal(2)
        expected = [np.zeros(2)] if q.min() >= 0 else []
        for F in ([0], [1], [0, 1]):
            z = np.zeros(2)
            z[F] = np.linalg.solve(M[np.ix_(F, F)], -q[F])
            expected += [z] if z.min() >= 0 and (M @ z + q).min() >= -1e-9 else []
        problem = cpbench.LCP(M=M, q=q)
        found = complementary_cones.solutions(complementary_cones.complementary_cones(problem))
        assert len(found) == len(expected)
        assert all(min(np.abs(z - y).max() for y in found) < 1e-9 for z in expected)
        counts.add(len(found))
        if complementary_cones.is_p_matrix(problem):
            path = complementary_cones.lemke_path(problem)
            assert np.abs((path.z[-1] if len(path.z) else np.zeros(2)) - found[0]).max() < 1e-9
            after += len(path.z)
    assert {0, 1, 2} <= counts
    assert after > 0
