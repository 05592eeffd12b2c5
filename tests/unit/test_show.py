"""What `cpbench info --data` prints: numbers, structure, laws and history."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from click.testing import CliRunner

from cpbench import storage
from cpbench.cli import cli
from cpbench.conversions.base import make
from cpbench.formulations import LCP, FrictionContact, Problem, formulations
from cpbench.formulations.base import counted
from cpbench.formulations.contact import ContactProblem
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.foundation.cones import Cone
from cpbench.report import show


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
    run("convert", path, tmp_path / "faceted.h5", "--to", "lcp", "--via", f"fc-lcp-inner[facets={facets}]")
    said = run("info", tmp_path / "faceted.h5", "--data")
    assert said.startswith("lcp: ")
    assert "(47)-(48), approximate, from fc" in said
    assert f"180°/{facets} = {180 / facets:.4g}°" in said
    exact = show.text(make("lcp-mlcp").step(LCP(M=np.eye(2), q=[0.0, 1.0])))
    assert "slip" not in exact


def test_a_problem_is_shown_as_another(tmp_path: Path) -> None:
    path = tmp_path / "lcp.h5"
    storage.save(LCP(M=np.array([[2.0, 1], [1, 2]]), q=[-5.0, -6.0], name="deudeu"), path)
    run("convert", path, tmp_path / "qp.h5", "--to", "qp")
    said = run("info", tmp_path / "qp.h5", "--data")
    assert said.startswith("qp: quadratic program")
    assert "made by lcp-qp, (1), equivalent, from lcp" in said
    assert "Source" in said
    assert "Lift" in said
