"""Siconos text of problems that this version has no formulation for: recognised, to refuse them by their name.

relay       n  M  q lb ub                       SOCLCP   n nc  M  q  cone ends (0 first)  tau
rolling     d nc  M  q  mu  mu_r (d = 5 or 3)   global   d nc  M H  q b mu mu_r
plasticity  3 nc model M q ..., or 3 nc M q eta theta as older files have it (then like rolling friction in 2D)
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cpbench.errors import FormatError
from cpbench.storage.siconos_matrix import Cursor, read_matrix


def recognise(path: Path) -> str:
    """What the file is ("a relay problem"), "" when it is none of these either."""
    tokens = Cursor(path).tokens
    fitting: list[str] = []
    for what, reader in _LAYOUTS:
        try:
            reader(Cursor(path, tokens))
        except FormatError:
            continue
        fitting.append(what)
    return " or ".join(fitting)


def _relay(c: Cursor) -> None:
    n = c.integer("n")
    read_matrix(c, "M", (n, n))
    c.numbers("q", 3 * n)
    c.finish()


def _soclcp(c: Cursor) -> None:
    n, nc = c.integer("n"), c.integer("nc")
    read_matrix(c, "M", (n, n))
    c.numbers("q", n)
    ends = c.integers("cone ends", nc + 1)
    if ends[0] != 0 or ends[-1] != n:
        raise c.error("cone ends", f"do not go from 0 to {n}")
    c.numbers("tau", nc)
    c.finish()


def _rolling(dimension: int) -> Callable[[Cursor], None]:
    def read(c: Cursor) -> None:
        d, nc = c.integer("d"), c.integer("nc")
        if d != dimension:
            raise c.error("d", f"is {d}, expected {dimension}")
        read_matrix(c, "M", (d * nc, d * nc))
        c.numbers("q, mu and mu_r", (d + 2) * nc)
        c.finish(flag=True)

    return read


def _global_rolling(c: Cursor) -> None:
    d, nc = c.integer("d"), c.integer("nc")
    if d not in (3, 5):
        raise c.error("d", f"is {d}, expected 3 or 5")
    n = read_matrix(c, "M", None).shape[0]
    read_matrix(c, "H", (n, d * nc))
    c.numbers("q, b, mu and mu_r", n + (d + 2) * nc)
    c.finish(flag=True)


def _plasticity(c: Cursor) -> None:
    d, nc, model = c.integer("d"), c.integer("nc"), c.integer("model")
    if d != 3 or model not in (1, 2):
        raise c.error("model", f"is {model}, expected 1 or 2")
    read_matrix(c, "M", (d * nc, d * nc))
    c.numbers("q and yield parameters", d * nc + (2 if model == 1 else 1) * nc)
    c.finish()


_LAYOUTS: tuple[tuple[str, Callable[[Cursor], None]], ...] = (
    ("a relay problem", _relay),
    ("a second-order cone LCP", _soclcp),
    ("a rolling friction problem", _rolling(5)),
    ("a rolling friction problem in 2D, or a plasticity problem of the old layout", _rolling(3)),
    ("a global rolling friction problem", _global_rolling),
    ("a plasticity problem", _plasticity),
)
