"""Sheets: the solvers of the run with their sources, and the machine that it was made on."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cpbench.analysis import multi_start
from cpbench.analysis.quotation import quotation
from cpbench.report.html.markup import Markup, element, table
from cpbench.report.run import Run, tuned_sentence
from cpbench.report.run_sections import DRIFT
from cpbench.report.text import cut, seconds
from cpbench.verification import Status


def solvers(run: Run) -> Iterator[Markup]:
    """Yield versions, licences, methods and citations; which were tuned by an earlier version."""
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    here = set(run.rows.loc[run.rows["status"] != str(Status.UNAVAILABLE), "solver"].unique())
    used = run.rows[run.rows["version"] != ""].groupby("solver")["version"].unique()
    by_name = {str(sheet.get("name", "")): sheet for _, sheet in sorted(sheets.items())}
    lines = []
    for name in sorted(set(by_name) & here):
        sheet = by_name[name]
        versions = ", ".join(sorted(used.get(name, []))) or sheet.get("version", "")
        restriction = sheet.get("publishing", "")
        licence = sheet.get("licence", "") or "—"
        cited = sheet.get("citation", "")
        method = element("div", sheet.get("summary", "")) + (element("div", cited, class_="scope") if cited else "")
        terms = f"{licence}; publishing: {restriction}" if restriction else licence
        lines.append([name, sheet.get("node", ""), versions or "—", terms, Markup(method)])
    if lines:
        yield table("Solvers", ["solver", "solves", "version", "licence", "method and source"], lines)
    if tuned_sentence(run):
        yield element("p", tuned_sentence(run), class_="scope")


def problems(run: Run) -> Iterator[Markup]:
    """Yield families of problems with their source and licence, as far as their files give them; nothing where none
    does.
    """
    thumbnails = run.thumbnails()
    first = run.rows.drop_duplicates("fingerprint")
    found: dict[tuple[str, str, str, str], int] = {}
    for fingerprint, node, family in zip(first["fingerprint"], first["node"], first["family"], strict=True):
        thumbnail = thumbnails.get(multi_start.original(str(fingerprint)), {})
        source = "; ".join(filter(None, (thumbnail.get("source", ""), thumbnail.get("citation", ""))))
        key = (str(node), str(family) or "(none)", source, str(thumbnail.get("licence", "")))
        found[key] = found.get(key, 0) + 1
    if any(source or licence for _, _, source, licence in found):
        yield element("p", "What the files of the problems say; the sheet of each pair says it of its problem.")
        lines = (
            [family, node, count, source or "not given", licence or "not given"]
            for (node, family, source, licence), count in sorted(found.items())
        )
        yield table("Problems", ["family", "formulation", "problems", "source", "licence"], lines, right=[2])


def machine(run: Run) -> Iterator[Markup]:
    """Yield facts of the machine, its drift during the run, files that were refused."""
    facts: dict[str, Any] = {**(run.meta.get("machine") or {})}
    hosts = sorted(set(run.rows["host"].unique()) - {""})
    facts |= {"hosts": ", ".join(hosts)} if hosts else {}
    facts |= {"problems": quoted} if (quoted := quotation(run.meta)) else {}
    facts |= {f"{name} (package)": version for name, version in sorted((run.meta.get("versions") or {}).items())}
    if facts:
        yield table("Machine and versions", ["what", "value"], ([name, value] for name, value in facts.items()))
    took = [float(r["seconds"]) for r in run.meta.get("references") or [] if r["seconds"] == r["seconds"]]
    if len(took) > 1:
        spread = max(took) / min(took)
        sentence = (
            f"A solve that is always the same was repeated {len(took)} times during the run: it took "
            f"{seconds(min(took))} to {seconds(max(took))}, a drift of the machine by a factor {spread:.2f}."
        )
        if spread > DRIFT:
            yield element(
                "p",
                sentence,
                f" Time ratios below {spread:.2g} are within this machine's noise.",
                class_="note warning",
            )
        else:
            yield element("p", sentence)
    refused = [(str(address), str(reason)) for address, reason in run.meta.get("refused") or []]
    if refused:
        here = str(Path.cwd()) + os.sep
        yield element("h3", f"Refused files ({len(refused)})")
        lines = ([a.removeprefix(here), cut(r.replace(here, ""), 300)] for a, r in sorted(refused))
        yield table("Refused files", ["file", "reason"], lines)
