"""`report.html`: one file with everything in it, which opens without a network.

Scripts are allowed by their hash alone (Content-Security-Policy), and nothing may be fetched: were a text of a
results file ever taken for markup, no script in it would run.
"""

from __future__ import annotations

import base64
import hashlib
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

from cpbench.analysis import table as rows_of
from cpbench.errors import FormatError
from cpbench.report.answer import EXPLAINED
from cpbench.report.html import prepared, vega
from cpbench.report.html.columns import DECADES, columns_of
from cpbench.report.html.embedded_data import packed
from cpbench.report.html.sections import sections
from cpbench.report.methods import FLAGS, KINDS
from cpbench.report.run import Run
from cpbench.report.text import one_line

NAME = "report.html"
SCRIPTS = (
    "rows.js", "data.js", "dom.js", "charts.js", "figures.js", "filters.js", "paths.js", "prepared.js", "profiles.js",
    "comparisons.js", "pair.js", "matrix.js", "growth.js", "address.js", "failed.js", "app.js",
)  # fmt: skip
"""Our own scripts, in the order in which they use each other."""


def write(run: Run, title: str) -> Path:
    """Write report.html into the folder of a run and give its path."""
    path = run.folder / NAME
    try:
        run.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(page(run, title), encoding="utf-8", errors="replace", newline="\n")
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None
    return path


def page(run: Run, title: str) -> str:
    """Write the HTML of a run."""
    columns, facts = columns_of(run)
    rankings_of = {ranking.group: ranking for ranking in run.rankings}
    codes = {name: code for code, name in enumerate(facts["labels"]["name"])}
    for group_facts, (group, rows) in zip(facts["groups"], run.parts, strict=True):
        symbols = sorted({symbol for code in group_facts["problems"] for symbol in facts["problems"]["sizes"][code]})
        group_facts |= {
            "order": [codes[one_line(label)] for label in prepared.order(rows)],
            "answer": prepared.answer(rankings_of.get(group)),
            "ranking": prepared.ranking(rows),
            "bands": prepared.bands(rows) if facts["whole"] else None,
            "precision": prepared.precision(rows, run.histories),
            "growth": prepared.growth(rows, symbols),
        }
    problems = [(rows["fingerprint"].nunique(), int(rows_of.solved(rows).sum())) for _, rows in run.parts]
    facts["first"] = problems.index(max(problems)) if problems else 0
    facts["warm"] = prepared.warm(run.read)
    facts["tolerances"] = [float(f"1e-{k}") for k in DECADES]
    facts["notes"] = {"flags": FLAGS, "kinds": KINDS, "answer": EXPLAINED}
    scripts = [_asset(name) for name in (vega.SCRIPT, *SCRIPTS)]
    inside, links = sections(run, title)
    return Template(_asset("page.html")).substitute(
        policy=_policy(scripts),
        title=escape(one_line(title)),
        style=_asset("page.css"),
        links=links,
        sections=inside,
        version=escape(str(run.meta.get("cpbench", ""))),
        licence=escape(vega.LICENCE),
        data=packed(columns, facts),
        scripts="\n".join(f"<script>{script}</script>" for script in scripts),
    )


def _asset(name: str) -> str:
    return resources.files("cpbench.report.html").joinpath("assets", name).read_text(encoding="utf-8")


def _policy(scripts: list[str]) -> str:
    """Return a policy that allows only these scripts, styles and data of the page itself, no network at all."""
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'"
