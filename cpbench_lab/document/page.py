"""`report.tex` with `numbers.tex` and `refs.bib`: one document that compiles, and numbers that a paper can input.

    pdflatex report && bibtex report && pdflatex report && pdflatex report

It needs pgfplots and booktabs (Debian: texlive-pictures, texlive-latex-recommended).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.analysis import cautions, means, profiles, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import participating
from cpbench.analysis.quotation import quotation
from cpbench.analysis.run_table import RunTable
from cpbench.analysis.table import ResultGroup
from cpbench.analysis.tolerances import judged_at
from cpbench.errors import UnknownName
from cpbench.report.legend import EMPHASISED
from cpbench.report.methods import METHODS
from cpbench.report.run import Run, assembled, group_name_text
from cpbench.report.text import counted, one_line
from cpbench_lab.document import curves
from cpbench_lab.document.bibliography import Bibliography
from cpbench_lab.document.escape import label, markdown, text
from cpbench_lab.document.macros import Macros, letters
from cpbench_lab.document.tables import duration, small, solved_table, table

FACETS = ("family", "tolerance")
LOOSER = (1e-2, 1e-4)
"""Tolerances, beside its own, of the panels of a run that was asked for one only."""
FAMILIES = 12
"""The most families that have a panel: those with most problems."""
HEAD = Path(__file__).parent / "head.tex"
"""The packages of the document, and how floats are placed."""


def write_document(
    given: RunTable,
    folder: str | Path,
    title: str,
    *,
    citations: Mapping[str, str] | None = None,
    facets: Collection[str] = (),
    publishable: bool = False,
    with_imported: bool = False,
    count_stationary: bool = False,
) -> Path:
    """Write the three files into `folder`; gives the path of report.tex.

    Parameters
    ----------
    given : the rows and facts of the run.
    citations : of the collections, by family. facets : FACETS, a figure of small multiples each.

    Raises UnknownName for another facet.
    """
    for facet in facets:
        if facet not in FACETS:
            raise UnknownName("facet", facet, FACETS)
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    run = assembled(
        given, folder, publishable=publishable, with_imported=with_imported, count_stationary=count_stationary
    )
    macros, references = Macros(), Bibliography()
    body = list(_body(run, macros, references, dict(citations or {}), facets))
    parts = [
        HEAD.read_text(encoding="utf-8") + curves.styles() + "\\input{numbers}\n\\begin{document}",
        f"\\title{{{text(title)}}}\n\\author{{}}\n\\date{{{text(given.meta.get('date', ''))}}}\n\\maketitle",
        *body,
        "\\bibliographystyle{plain}\n\\bibliography{refs}\n\\end{document}",
    ]
    (folder / "numbers.tex").write_text(macros.text(), encoding="utf-8")
    (folder / "refs.bib").write_text(references.text(), encoding="utf-8")
    path = folder / "report.tex"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def _body(
    run: Run, macros: Macros, references: Bibliography, citations: Mapping[str, str], facets: Collection[str]
) -> Iterator[str]:
    rows = run.rows
    if not len(rows):
        yield "No pair was planned: no solver is reached from the problems that were read."
        return
    pairs = macros.define(("pairs",), str(len(rows)))
    solved = macros.define(("solved",), str(int(rows_of.solved(rows).sum())))
    problems = macros.define(("problems",), str(rows["fingerprint"].nunique()))
    sentence = f"{solved} of {pairs} pairs of a problem and a solver were solved; there are {problems} problems."
    if run.stationary:
        sentence += f" {text(run.stationary.capitalize())}."
    sentence += "".join(f" {text(remark)}." for remark in run.remarks)
    yield f"\\section{{Overview}}\n{sentence}"
    yield from _methods(run, macros)
    for group, own in rows_of.groups(rows):
        yield from _group(run, macros, group, participating(own), facets)
    yield "\\onecolumn"  # a wide table stands where it is written
    yield from _solvers(run, references)
    yield from _collections(run, macros, references, citations)
    yield f"\\twocolumn\n\\appendix\n\\section{{Definitions}}\n{{\\footnotesize {markdown(METHODS)}\\par}}"


def _methods(run: Run, macros: Macros) -> Iterator[str]:
    """Yield the paragraph that a paper needs."""
    tolerances = ", ".join(small(t) for t in sorted(set(run.rows["tolerance"])))
    most = rows_of.limit(run.rows)
    limit = macros.define(("limit",), duration(most) if math.isfinite(most) else "none")
    tolerance = macros.define(("tolerance",), tolerances)
    machine = run.meta.get("machine") or {}
    where = f" Solved on {text(machine['cpu'])}." if machine.get("cpu") else ""
    quoted = quotation(run.meta)
    where += f" The problems include {text(quoted)}." if quoted else ""
    yield (
        "\\section{Methods}\nEvery answer is carried back to the problem that was asked, and its error is computed "
        "there from the problem's data by code that shares nothing with the solver. A pair is solved when that error "
        f"is at most the tolerance ({tolerance}), whatever the solver said. A solve may take {limit}. Time is "
        "conversion, set-up, solve and carrying the answer back; a pair that is not solved has none. Performance "
        "profiles are those of Dolan and Mor{\\'e}~\\cite{cpbench-DolanMore}; the order of the curves below the "
        f"highest may change when solvers are left out~\\cite{{cpbench-GouldScott}}.{where}"
    )


def _group(run: Run, macros: Macros, group: ResultGroup, rows: pd.DataFrame, facets: Collection[str]) -> Iterator[str]:
    """Yield section of a formulation: sentences, table, profile, small multiples."""
    name = group_name_text(run, group)
    words = (name,)
    problems = int(rows["fingerprint"].nunique())
    most = rows_of.limit(rows)
    ranked = rows[rows_of.ranked(rows)]
    times = rows_of.times(ranked)
    counts = summary.solve_counts(rows, means.charge(times, means.LIMIT, most))
    number = macros.define((*words, "problems"), str(problems))
    some = macros.define((*words, "by some"), str(rows.loc[rows_of.solved(rows), "fingerprint"].nunique()))
    scope = f"{number} problems, tolerance {small(group.tolerance)}, limit {duration(most)}"
    best = counts.iloc[0]
    caption = (
        f"{text(name)}: {scope}. \\emph{{Solved}}: error at most the tolerance. \\emph{{False}}: claimed and is not. "
        "\\emph{Median} of the times of solved problems; \\emph{mean}: shifted geometric over all problems, a failure "
        "charged the limit."
    )
    notes = cautions.footnotes(rows, run.meta.get("solvers") or {})
    table_text = solved_table(macros, words, counts, f"{caption}\\label{{tab:{letters(name)}}}", notes)
    profile = profiles.performance_profile(times, problems, lost=rows_of.lost(ranked))
    labels = profile.leading(EMPHASISED)
    key = f"fig:{letters(name)}"
    yield f"\\section{{{text(name)}}}"
    where = f"table~\\ref{{tab:{letters(name)}}}" + (f", figure~\\ref{{{key}}}" if labels else "")
    most_solved = macros.define((*words, str(best["label"]), "solved"), str(best["solved"]))
    yield f"Of {number} problems {some} are solved by some solver, {most_solved} by {label(best['label'])} ({where})."
    yield table_text
    if not labels:
        return
    kinds = rows_of.label_kinds(rows)
    rest = sum(1 for curve in profile.curves if curve.solved) - len(labels)
    guide = (
        f"Performance profile of {text(name)}: fraction of the {scope} solved within $\\tau$ times the time of the "
        "fastest solver; at the left end where it was the fastest, at the right end at all."
        + (f" Of {rest + len(labels)} solvers those with the largest area; all count for $\\tau$." if rest else "")
    )
    yield curves.figure(profile, labels, kinds, run.looks, guide, key)
    for facet in facets:
        found, caption_end = _by_family(ranked) if facet == "family" else _by_tolerance(run, group, ranked)
        if len(found) > 1:
            caption = f"Performance profiles of {text(name)}, by {facet}, of the same solvers. {caption_end}"
            yield curves.panels(found, labels, kinds, run.looks, caption, f"{key}{facet}")


def _by_family(rows: pd.DataFrame) -> tuple[dict[str, profiles.Profile], str]:
    """Return a profile a family, by its title in TeX; its ratios are taken among its own problems."""
    sizes = rows.groupby("family")["fingerprint"].nunique().sort_index().sort_values(ascending=False, kind="stable")
    found: dict[str, profiles.Profile] = {}
    for family in sizes.index[:FAMILIES]:
        own = rows[rows["family"] == family]
        title = text(f"{one_line(family) or '(no family)'}: {counted(int(sizes[family]), 'problem')}")
        whole = _with_labels(own, rows)
        found[title] = profiles.performance_profile(rows_of.times(whole), lost=rows_of.lost(whole))
    rest = len(sizes) - len(found)
    return found, f"Not shown: {counted(rest, 'family', 'families')} with fewer problems." if rest else ""


def _with_labels(own: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Add every label to the rows: one without a pair in this family gets a pair that is not solved."""
    absent = rows.drop_duplicates("label")
    absent = absent[~absent["label"].isin(own["label"])]
    first = own.iloc[0]
    filled = absent.assign(
        **{name: first[name] for name in ("fingerprint", "problem", "address")}, status="unsupported"
    )
    return pd.concat([own, filled], ignore_index=True)


def _by_tolerance(run: Run, group: ResultGroup, rows: pd.DataFrame) -> tuple[dict[str, profiles.Profile], str]:
    """Return a profile a tolerance: those that were run, or looser ones that the answers are held against."""
    same = [
        (other.tolerance, own)
        for other, own in rows_of.groups(run.rows)
        if (other.node, other.start, other.threads, other.set, other.measure)
        == (group.node, group.start, group.threads, group.set, group.measure)
    ]
    caption_end = ""
    if len(same) == 1:
        same = [(looser, judged_at(rows, looser)) for looser in LOOSER if looser > group.tolerance] + same
        caption_end = (
            f"The answers, asked for at {small(group.tolerance)}, are judged at each; times are of what was asked."
        )
    labels = set(rows["label"])
    found: dict[str, profiles.Profile] = {}
    for tolerance, own in sorted(same, key=lambda pair: -pair[0]):
        ranked = own[rows_of.ranked(own) & own["label"].isin(labels)]
        problems = counted(int(own["fingerprint"].nunique()), "problem")
        profile = profiles.performance_profile(rows_of.times(ranked), lost=rows_of.lost(ranked))
        found[f"tolerance {small(tolerance)}: {problems}"] = profile
    return found, caption_end


def _solvers(run: Run, references: Bibliography) -> Iterator[str]:
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    present = set(run.rows["solver"])
    named = {str(sheet.get("name", "")): sheet for _, sheet in sorted(sheets.items())}
    rows: list[Sequence[str]] = []
    for name in sorted(named.keys() & present):
        sheet = named[name]
        used = sorted(set(run.rows.loc[run.rows["solver"] == name, "version"]) - {""})
        version = text(", ".join(used) or sheet.get("version", "")) or "---"
        cited = references.cite("solver", name, str(sheet.get("citation") or "")) or "---"
        rows.append([label(name), text(sheet.get("node", "")), version, text(sheet.get("licence", "")) or "---", cited])
    if rows:
        yield "\\section{Solvers}"
        head = ["solver", "solves", "version", "licence", "source"]
        spec = r">{\raggedright\arraybackslash}p{0.26\columnwidth}ll>{\raggedright\arraybackslash}p{0.34\columnwidth}l"
        yield table(head, rows, spec, "Solvers, what they solve, versions, licences.")


def _collections(run: Run, macros: Macros, references: Bibliography, citations: Mapping[str, str]) -> Iterator[str]:
    sizes = run.rows[run.rows["family"] != ""].groupby("family")["fingerprint"].nunique()
    rows: list[Sequence[str]] = []
    for family in sorted(map(str, sizes.index)):
        number = macros.define(("family", family, "problems"), str(int(sizes[family])))
        cited = references.cite("collection", family, citations.get(family, "")) or "---"
        rows.append([label(family), number, cited])
    if rows:
        yield "\\section{Collections}"
        spec = r">{\raggedright\arraybackslash}p{0.34\columnwidth}rl"
        yield table(["family", "problems", "source"], rows, spec, "Families of problems.")
