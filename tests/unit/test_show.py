"""What `cpbench show` prints: numbers, structure, laws and history; LaTeX that other parsers accept."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from click.testing import CliRunner
from matplotlib.mathtext import MathTextParser

from cpbench import storage
from cpbench.cli import cli
from cpbench.conversions.base import make
from cpbench.formulations import LCP, FrictionContact, Problem, formulations
from cpbench.formulations.base import counted
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.foundation.product_cones import Cone
from cpbench.report import show, show_tex, tex


def run(*arguments: object) -> str:
    done = CliRunner().invoke(cli, list(map(str, arguments)), catch_exceptions=False)
    return done.output


def contact(nc: int) -> FrictionContact:
    rng = np.random.default_rng(nc)
    J = rng.standard_normal((3 * nc, 3 * nc + 2))
    return FrictionContact(
        W=sp.csr_array(J @ J.T), q=rng.standard_normal(3 * nc), mu=np.full(nc, 0.5), dimension=3, name=f"contacts_{nc}"
    )


def sines(rows: int, inputs: int) -> Map:
    """The sine of one unknown after the other, or of 1 where there is none."""
    build = Builder(inputs)
    one = build.constant(1.0)
    return build.finish([build.apply(Operator.SIN, k % inputs if inputs else one) for k in range(rows)])


def filled(node: str, size: int) -> Problem:
    """A problem of the formulation with `size` for each dimension; what holds whatever its data mean."""
    cls = formulations.get(node)
    contact_node = issubclass(cls, ContactProblem)
    d = cls.dimensions[0] if contact_node else 1
    sizes: dict[str, int] = {}
    data = {}
    for f in cls._data_fields():
        shape = [
            int(s) if s.isdigit() else sizes.setdefault(s, d * size if contact_node and s == "m" else size)
            for s in f.metadata["shape"]
        ]
        data[f.name] = np.eye(*shape) if len(shape) == 2 else np.ones(shape)
        if f.name == "lb":
            data[f.name] = -np.ones(shape)
    for f in fields(cls):
        if "map" in f.metadata:
            data[f.name] = sines(
                *(counted(symbol, {symbol.lstrip("0123456789"): size}) for symbol in f.metadata["map"])
            )
    if "cone_kind" in data:
        data["cone_kind"] = np.full(size, float(Cone.FREE if "lb" in data else Cone.NONNEGATIVE))
    if node == "afc":
        data["mu"] = np.ones((size, 2))
    return cls(**data, **({"dimension": d} if contact_node else {}), name=f"a_b%{size}")


def test_small_problems_are_printed_in_numbers() -> None:
    M = np.array([[2.0, 0, -1.5], [0, 1e-9, 1], [12345.678, 0, 4]])
    said = show.text(LCP(M=M, q=[-1.0, 0.0, 2.0], name="three"))
    assert "    0 ≤ z ⟂ w = Mz + q ≥ 0" in said.splitlines()
    assert "equation: (13)" in said
    at = said.splitlines().index("    [         2      .  -1.5 ]")
    assert said.splitlines()[at + 1 : at + 3] == ["M = [         .  1e-09     1 ]", "    [ 1.235e+04      .     4 ]"]
    assert "q = [ -1  .  2 ]ᵀ" in said
    assert "from them w" in said


def test_large_problems_are_printed_as_structure() -> None:
    n = 500
    said = show.text(LCP(M=sp.eye_array(n, format="csr"), q=np.linspace(-1, 2, n)))
    assert "M (n×n = 500×500): sparse, 500 nonzeros (0.2 %), max |.| 1" in said
    assert "q (n = 500): from -1 to 2" in said
    assert max(map(len, said.splitlines())) < 140


@pytest.mark.parametrize("shape", [(8, 8), (5, 3), (100, 30), (1, 1000), (1000, 1), (48, 49), (96, 97)])
def test_a_dot_stands_for_a_block_with_an_entry(shape: tuple[int, int]) -> None:
    """The picture decoded again, against the pattern coarsened by loops."""
    rng = np.random.default_rng(sum(shape))
    M = rng.random(shape) * (rng.random(shape) < 0.05)
    M[0, 0] = 1.0
    picture = show.spy(sp.csr_array(M))
    step = max(*shape, 48) / 48
    expected = {(int(i / step), int(j / step)) for i, j in zip(*np.nonzero(M), strict=True)}
    order = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (3, 0), (3, 1)]  # dots 1-8 of the Unicode chart U+2800
    dots = {
        (4 * y + dy, 2 * x + dx)
        for y, line in enumerate(picture)
        for x, cell in enumerate(line)
        for k, (dy, dx) in enumerate(order)
        if ord(cell) - 0x2800 >> k & 1
    }
    assert dots == expected
    assert len({len(line) for line in picture}) == 1


@pytest.mark.parametrize("node", formulations.names())
@pytest.mark.parametrize("size", [0, 2, 40])
def test_every_formulation_can_be_shown(node: str, size: int) -> None:
    problem = filled(node, size)
    said = show.text(problem)
    for relation in problem.relations:
        assert relation in said
    for name in (*problem.data(), *problem.point_sizes):
        assert re.search(rf"\b{name}\b", said)
    assert ("empty" in said) == (size == 0)
    fragment = show_tex.fragment(problem)
    _check_tex(fragment)
    assert ("array" in fragment) == (size == 2)


def _check_tex(fragment: str) -> None:
    """ASCII, environments and braces closed, every row of an array as wide as its declaration."""
    assert fragment.isascii(), [c for c in fragment if not c.isascii()]
    opened: list[str] = []
    for kind, name in re.findall(r"\\(begin|end)\{([a-z*]+)\}", fragment):
        if kind == "begin":
            opened.append(name)
        else:
            assert opened.pop() == name
    assert not opened
    bare = fragment.replace(r"\{", "").replace(r"\}", "")
    assert bare.count("{") == bare.count("}")
    assert fragment.count(r"\left") == fragment.count(r"\right")
    for columns, body in re.findall(r"\\begin\{array\}\{(r+)\}(.*?)\\end\{array\}", fragment):
        assert {row.count("&") + 1 for row in body.split(r"\\")} == {len(columns)}


@pytest.mark.parametrize("node", formulations.names())
def test_laws_are_parsed_by_matplotlib(node: str) -> None:
    """mathtext is a TeX parser of its own: it refuses unknown commands and double scripts."""
    cls = formulations.get(node)
    parser = MathTextParser("path")
    for relation in show.relations(cls):
        parser.parse(f"${tex.law(relation, [f.name for f in cls._data_fields()])}$")


@pytest.mark.parametrize(
    ("relation", "expected"),
    [
        ("0 ≤ z ⟂ w = Mz + q ≥ 0", r"0 \leq z \perp w = Mz + q \geq 0"),
        ("û = u + μ‖u_T‖e_N", r"\hat{u} = u + \mu\|u_{T}\|e_{N}"),
        ("K*_μ ∋ û ⟂ r ∈ K_μ", r"K^{*}_{\mu} \ni \hat{u} \perp r \in K_{\mu}"),
        ("Gᵀv + b = 0", r"G^{\top}v + b = 0"),
        ("A⁻¹x₁ − λv", r"A^{-1}x_{1} - \lambda v"),
        ("−w ∈ N_[lb,ub](z)", r"-w \in N_{[lb,ub]}(z)"),
        ("X = {z : Az ≥ b}", r"X = \{z : Az \geq b\}"),
        ("for all y ∈ X", r"\text{ for }\text{ all }y \in X"),
    ],
)
def test_laws_in_latex(relation: str, expected: str) -> None:
    assert tex.law(relation).replace(" ", "") == expected.replace(" ", "")


ODD = ("Größe 字 ⟨x⟩ \U0001f600", "αΑ ωΩ Γ Ε λx", "_ ^ ~ \\ { } % # & $", "x² ~ ᵀ₀")


@pytest.mark.parametrize("text", ODD)
def test_any_character_becomes_latex(text: str) -> None:
    assert tex.prose(text).isascii()
    assert tex.law(text).isascii()


def test_every_law_is_declared() -> None:
    class Undeclared(LCP):
        """One line.

        More.
        """

        relations = ()

    assert show.relations(Undeclared) == ("One line.",)
    assert all(cls.relations for cls in formulations)


@pytest.mark.parametrize("facets", [4, 16])
def test_facets_say_the_angle_to_expect(tmp_path: Path, facets: int) -> None:
    path = tmp_path / "contact.h5"
    storage.save(contact(2), path)
    said = run("show", path, "--via", "fc-lcp-inner", "--facets", facets)
    assert said.startswith("lcp: ")
    assert "(47)-(48), approximate, from fc" in said
    assert f"180°/{facets} = {180 / facets:.4g}°" in said
    fragment = run("show", path, "--as", "mlcp", "--routes", "all", "--tex")
    _check_tex(fragment)
    assert r"180\ensuremath{{}^{\circ}}/8" in fragment
    exact = show.text(make("lcp-mlcp").step(LCP(M=np.eye(2), q=[0.0, 1.0])))
    assert "slip" not in exact


def test_a_problem_is_shown_as_another(tmp_path: Path) -> None:
    path = tmp_path / "lcp.h5"
    storage.save(LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu"), path)
    said = run("show", path, "--as", "qp")
    assert said.startswith("qp: quadratic program")
    assert "made by lcp-qp, (1), equivalent, from lcp" in said
    assert "Source" in said
    assert "Lift" in said
    assert run("show", path) == run("show", path, "--as", "lcp")


def test_a_conversion_that_is_not_installed_is_named(tmp_path: Path) -> None:
    import dataclasses

    problem = make("lcp-mlcp").step(LCP(M=np.eye(1), q=[0.0]))
    foreign = dataclasses.replace(problem.provenance[0], conversion="lcp-other")
    problem = dataclasses.replace(problem, provenance=(foreign,))
    assert "made by lcp-other, equivalent, from lcp" in show.text(problem)
    assert "not installed" in show.text(problem)
    assert "lcp-other" in show_tex.fragment(problem)


def test_fragments_compile(tmp_path: Path) -> None:
    """By LaTeX itself where there is one."""
    latex = shutil.which("pdflatex")
    if latex is None:
        pytest.skip("needs a program: pdflatex, apt-get install texlive-latex-base texlive-pictures")
    lines = [r"\documentclass{article}\usepackage{amsmath}\begin{document}"]
    lines += [show_tex.fragment(filled(node, size)) for node in formulations.names() for size in (0, 2, 40)]
    lines += [show_tex.fragment(make("fc-lcp-inner").step(contact(1)))]
    lines += [show_tex.fragment(LCP(M=np.eye(1), q=[1.0], name=text)) for text in ODD]
    lines += [f"${tex.law(text)}$" for text in ODD]
    (tmp_path / "all.tex").write_text("\n\n".join([*lines, r"\end{document}"]))
    done = subprocess.run(
        [latex, "-halt-on-error", "-interaction=nonstopmode", "all.tex"], cwd=tmp_path, capture_output=True, timeout=60
    )
    assert done.returncode == 0, done.stdout[-1500:].decode(errors="replace")
    assert b"Missing character" not in (tmp_path / "all.log").read_bytes()
