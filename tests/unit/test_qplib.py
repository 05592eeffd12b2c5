"""QPLIB's text, by an example of each part and its opposite."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import cpbench
from cpbench.errors import FormatError
from cpbench.formulations import QP

TEXT = """! min x1^2 - x1 x2 + 3/2 x2^2 + x1 - 5 x3 + 7
SMALL
QCL # a type
minimize
3 # variables
2 # rows
3 # entries of the Hessian
1 1 2.0
2 1 -1.0
2 2 3.0
0.0 # default of the linear term
2
1 1.0
3 -5.0
7.0 # constant
4 # entries of A
1 1 1.0
1 2 1.0
2 2 2.0
2 3 1.0
1e20 # infinity
-1e20 # lower sides
1
2 1.0
4.0 # upper sides
1
2 1.0
0.0 # lower bounds
0
1e20 # upper bounds
1
3 9.0
0.0
0
"""


@pytest.mark.parametrize("sense", ["minimize", "MAXIMIZE"])
def test_every_part_is_where_it_belongs(sense: str, tmp_path: Path) -> None:
    (tmp_path / "p.qplib").write_text(TEXT.replace("minimize", sense))
    sign, inf = (1.0 if sense == "minimize" else -1.0), np.inf
    Q = sign * np.array([[2.0, -1, 0], [-1, 3, 0], [0, 0, 0]])
    wanted = QP(Q=Q, p=sign * np.array([1.0, 0, -5]), A=[[-1.0, -1, 0]], b=[-4.0], C=[[0.0, 2, 1]], d=[1.0],
                lb=np.zeros(3), ub=[inf, inf, 9.0])  # fmt: skip
    problem = cpbench.load(tmp_path / "p.qplib")
    assert problem.fingerprint == wanted.fingerprint
    assert (problem.name, problem.info.properties["objective_offset"]) == ("SMALL", sign * 7.0)


@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ("QCL", "QBL", "integer and binary unknowns"),
        ("QCL", "LCQ", "quadratic rows"),
        ("QCL", "program", "expected three letters"),
        ("3 # variables", "three", "number of variables"),
        ("2 1 -1.0", "2 4 -1.0", "Hessian: has an index outside of 1 to 3 x 3"),
        ("2 3 1.0", "2 3", "has 2 words"),
        ("1e20 # upper bounds\n1\n3 9.0\n0.0\n0\n", "", "ends before default of the upper bounds"),
    ],
)
def test_what_is_no_such_program_is_refused(old: str, new: str, cause: str, tmp_path: Path) -> None:
    (tmp_path / "p.qplib").write_text(TEXT.replace(old, new))
    with pytest.raises(FormatError, match=cause):
        cpbench.load(tmp_path / "p.qplib")
