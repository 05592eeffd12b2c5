"""Pieces of Markdown. Whatever comes from a table is text in it: no name can become markup, a link or a new line.

In running text and in cells of tables (`plain`) & < > are written as entities. In code spans (`code`) they stand as
they are: every reader of Markdown shows them as text there, and would show entities as they are spelled. That does not
hold within HTML, so no document of cpbench puts these pieces between tags.
"""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from cpbench.foundation.text import counted as counted  # part of the words of a report
from cpbench.foundation.text import some_of

_SPECIAL = re.compile(r"([\\`*\[\]#~$!|])|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])")
_FACETS = re.compile(r"(inner|outer)(\d+)(?:-(\w+))?")
_EDGE = re.compile(r"([^\[\]+]+)(?:\[([^\]]*)\])?")


def plain(value: Any) -> str:
    """Write `value` as running text on one line, every character standing for itself.

    >>> plain("<script> a|b *c* [d](e) max_iter _x")
    '&lt;script&gt; a\\\\|b \\\\*c\\\\* \\\\[d\\\\](e) max_iter \\\\_x'
    """
    line = one_line(value).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _SPECIAL.sub(lambda match: "\\" + match[0], line)


def code(value: Any) -> str:
    """Write `value` as a code span on one line; — for nothing.

    >>> code("lemke@inner8"), code("a`b"), code("")
    ('`lemke@inner8`', '`` a`b ``', '—')
    """
    line = one_line(value)
    if not line:
        return "—"
    longest = max((len(run) for run in re.findall(r"`+", line)), default=0)
    return f"{'`' * (longest + 1)} {line} {'`' * (longest + 1)}" if longest else f"`{line}`"


def one_line(value: Any) -> str:
    """Return text without line breaks and control characters, blanks merged."""
    line = str(value)
    if not line.isprintable():
        line = "".join(c if c.isprintable() else " " for c in line)
    return " ".join(line.split())


def cut(value: Any, length: int = 160) -> str:
    """Cut text to one line of at most `length` characters."""
    line = one_line(value)
    return line if len(line) <= length else line[: length - 1] + "…"


def number(value: float) -> str:
    """Write three significant digits, without an exponent up to 10⁵; — for a value that is not a number.

    >>> number(1234.5), number(1e6), number(math.inf), number(math.nan)
    ('1230', '1e+06', '∞', '—')
    """
    if math.isnan(value):
        return "—"
    if math.isinf(value):
        return "∞"
    digits = f"{value:.3g}"
    return f"{float(digits):.0f}" if 1e3 <= abs(value) < 1e5 else digits


def seconds(value: float) -> str:
    """Write a time with its unit.

    >>> seconds(12.345), seconds(0.00123), seconds(4.5e-5), seconds(math.inf)
    ('12.3 s', '1.23 ms', '45 µs', '∞')
    """
    if not math.isfinite(value):
        return number(value)
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-6:.3g} µs"


def listed(labels: Sequence[str], most: int = 6) -> str:
    """List labels as code, the rest counted.

    >>> listed(["a", "b", "c"], 2)
    '`a`, `b` and 1 more'
    """
    shown = ", ".join(code(label) for label in labels[:most])
    return f"{shown} and {len(labels) - most} more" if len(labels) > most else shown


def listed_plainly(labels: Sequence[str], most: int = 4) -> str:
    """List labels in running text, the rest counted.

    >>> listed_plainly(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    return some_of([one_line(label) for label in labels], most)


def solve_command(row: Any, metadata: Mapping[str, Any] | None = None) -> str:
    """Return the command that runs one row of a table again; `metadata` names the source of a declared solver.

    >>> solve_command({"address": "a b.h5", "label": "lemke@inner8", "solver": "lemke", "request": "inner8",
    ...                "tolerance": 1e-6, "seconds": 10.0, "start": "cold"})
    "cpbench solve 'a b.h5' -s lemke --via 'inner[facets=8]' --tolerance 1e-06 --timeout 10s"
    """
    request, label = one_line(row["request"]), one_line(row["label"])
    solver = label if request == "exact" else label.removesuffix(f"@{request}")
    source = metadata or {}
    words = ["cpbench", "solve", one_line(row["address"]), "-s", one_line(solver), *_route_options(request)]
    words += ["--tolerance", f"{row['tolerance']:g}"]
    if math.isfinite(row["seconds"]):
        words += ["--timeout", f"{row['seconds']:g}s"]
    start = row.get("began") or row["start"]
    if start == "previous":  # one step needs those before it
        file = one_line(row["address"]).partition("::")[0]
        words[1:3] = ["run", file, "--plan", "none", "-o", "again.sqlite"]
    if start != "cold":
        words += ["--start", start]
    for file in dict.fromkeys(filter(None, (source.get("variant_of"), source.get("plugin")))):
        words += ["--plugin", one_line(file)]
    return shlex.join(words)


def _route_options(request: str) -> list[str]:
    """Return options of `cpbench solve` that ask for a route request."""
    if request in ("exact", ""):
        return []
    facets = _FACETS.fullmatch(request)
    if facets:
        how, count, target = facets.groups()
        return ["--via", f"{f'fc-{target}-{how}' if target else how}[facets={count}]"]
    edges = [_EDGE.fullmatch(part) for part in request.split("+")]
    if all(edges) and "-" in request:
        return [word for edge in edges if edge is not None for word in ("--via", edge[0])]
    return ["--routes", "all"]
