"""`report.html`: one file with everything in it, which opens without a network.

Its texts and tables are those of the Markdown. Scripts are allowed by their hash alone (Content-Security-Policy), and
nothing may be fetched: were a text of a results file ever taken for markup, no script in it would run.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

from markdown_it import MarkdownIt

from cpbench.errors import FormatError
from cpbench.report.page_data import columns_of, packed
from cpbench.report.run import Run
from cpbench.report.templating import environment, rendered
from cpbench.report.text import one_line

NAME = "report.html"
SCRIPTS = ("vega.js", "page.js")
"""Vega, Vega-Lite and Vega-Embed as one script without imports, which vl-convert-python 1.9.0 made (84 MB, of which
this is what a page needs): `vl_convert.javascript_bundle("window.vega=vega; window.vegaLite=vegaLite;
window.vegaEmbed=vegaEmbed;")`; and what draws with it."""
SECTIONS = {
    "answer": ("Answer", (("report.md.j2", "top"),)),
    "claims": ("False claims", (("report.md.j2", "false"), ("details.md.j2", "claims"))),
    "hardest": ("Hardest problems", (("report.md.j2", "hardest"),)),
    "limitations": ("Limitations", (("report.md.j2", "limitations"),)),
    "failures": ("Failures", (("details.md.j2", "failures"), ("details.md.j2", "warm"))),
    "solvers": ("Solvers", (("details.md.j2", "solvers"),)),
    "problems": ("Problems", (("details.md.j2", "problems"),)),
    "machine": ("Machine", (("details.md.j2", "machine"),)),
    "methods": ("Methods", (("details.md.j2", "columns"), ("details.md.j2", "methods"))),
}
"""The sections of text by the name in their address: title in the navigation, blocks of the templates."""


def write(run: Run, given: Mapping[str, Any]) -> Path:
    """Write report.html into the folder of a run and give its path; `given` is what the templates are given."""
    path = run.folder / NAME
    try:
        run.folder.mkdir(parents=True, exist_ok=True)
        path.write_text(page(run, given), encoding="utf-8", errors="replace", newline="\n")
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None
    return path


def page(run: Run, given: Mapping[str, Any]) -> str:
    """Write the HTML of a run."""
    columns, facts = columns_of(run)
    shown = {
        name: html
        for name, (_, blocks) in SECTIONS.items()
        if (html := as_html("\n".join(rendered(template, dict(given), block) for template, block in blocks)))
    }
    scripts = [_asset(name) for name in SCRIPTS]
    links = {"answer": "Answer", "charts": "Charts", "pairs": "Pairs", **{name: SECTIONS[name][0] for name in shown}}
    title = escape(one_line(given["title"]))
    figures = {"profile": "Performance profile", "scatter": "Two solvers, problem by problem",
               "size": "Cost against size", "errors": "Error against time"}  # fmt: skip
    if not len(run.histories):
        del figures["errors"]
    return (
        environment()
        .get_template("page.html.j2")
        .render(
            policy=_policy(scripts),
            title=title,
            style=_asset("page.css"),
            links={name: link for name, link in links.items() if len(run.rows) or name in shown},
            sections=shown,
            figures=figures if len(run.rows) else {},
            version=escape(str(run.meta.get("cpbench", ""))),
            licence=escape(_asset("vega.LICENSE")),
            data=packed(columns, facts),
            scripts=scripts,
        )
    )


def as_html(text: str) -> str:
    """Return Markdown as HTML, each table in a box that scrolls; HTML in it is text."""
    html = MarkdownIt("commonmark", {"html": False}).enable("table").render(text)
    box = '<div class="scroll" tabindex="0" role="region" aria-label="Table"><table>'
    return html.replace("<table>", box).replace("</table>", "</table></div>")


def _asset(name: str) -> str:
    return resources.files("cpbench.report").joinpath("assets", name).read_text(encoding="utf-8")


def _policy(scripts: list[str]) -> str:
    """Return a policy that allows only these scripts, styles and data of the page itself, no network at all."""
    hashes = " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'" for s in scripts)
    return f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; base-uri 'none'"
