"""The LaTeX document: it compiles, its numbers are those of the analysis, and names from results stay text."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner
from synthetic_results import meta, results_file, row, suite, table

from cpbench.analysis import means, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.run_table import RunTable
from cpbench.bench.results.citations import citations
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.errors import CpbenchError
from cpbench_lab.document.bibliography import Bibliography
from cpbench_lab.document.escape import text
from cpbench_lab.document.macros import Macros, letters
from cpbench_lab.document.page import write_document
from cpbench_lab.document.tables import duration

HOSTILE = "\\input{x}$^_%#&~{}<script>"
SUITE = suite(15, 10)
SHEETS = {
    "lemke": {
        "name": "lemke",
        "node": "lcp",
        "version": "1.0",
        "licence": "Apache-2.0",
        "citation": "Lemke 1965; Júdice",
    },
    "pgs": {"name": "pgs", "node": "lcp", "version": "1.0", "licence": "Apache-2.0", "citation": "Cryer 1971 & 50 %"},
    "psor": {"name": "psor", "node": "lcp", "version": "1.0", "licence": "Apache-2.0", "citation": "Cryer 1971 & 50 %"},
    "bpp": {"name": "bpp", "node": "lcp", "version": "1.0", "licence": "Apache-2.0", "citation": ""},
}


def hostile_suite() -> pd.DataFrame:
    copied = SUITE[SUITE["label"] == "pgs"]
    named = copied.assign(label=HOSTILE, solver=HOSTILE, key=copied["key"] + "h", family=HOSTILE)
    return pd.concat([SUITE, named], ignore_index=True)


def written(folder: Path, rows: pd.DataFrame = SUITE, **given: object) -> Path:
    return write_document(RunTable.of(rows, meta(solvers=SHEETS)), folder, "A run", **given).parent  # type: ignore[arg-type]


def defined(folder: Path) -> dict[str, str]:
    found = re.findall(r"\\newcommand\{\\(\w+)\}\{(.*)\}\n", (folder / "numbers.tex").read_text())
    assert len(dict(found)) == len(found)
    return dict(found)


def counts() -> pd.DataFrame:
    rows = rows_of.normalised(SUITE)
    times = rows_of.times(rows)
    return summary.solve_counts(rows, means.charge(times, means.LIMIT, 10.0)).set_index("label")


def test_a_table_says_whose_time_has_the_launch_of_a_program_in_it(tmp_path: Path) -> None:
    sheets = {**SHEETS, "pgs": {**SHEETS["pgs"], "launches": True}}
    write_document(RunTable.of(SUITE, meta(solvers=sheets)), tmp_path, "A run")
    document = (tmp_path / "report.tex").read_text()
    assert r"\texttt{pgs}\ensuremath{^\dagger} &" in document
    assert r"\ensuremath{^\dagger} Every solve of pgs launches a program" in document
    assert r"\texttt{psor} &" in document


def test_macros_tables_and_analysis_have_the_same_numbers(tmp_path: Path) -> None:
    folder = written(tmp_path)
    numbers, document = defined(folder), (folder / "report.tex").read_text()
    for label, record in counts().iterrows():
        name = f"cpbenchLcp{letters(str(label))}"
        assert numbers[f"{name}Solved"] == str(record["solved"])
        assert numbers[f"{name}Fastest"] == str(record["fastest"])
        assert numbers[f"{name}Median"] == duration(float(record["median"]))
        if record["solved"]:
            assert numbers[f"{name}Mean"] == duration(float(record["mean"]))
            assert re.search(rf"& \\{name}Solved\{{\}} &.*& \\{name}Mean\{{\}}", document)
    assert numbers["cpbenchLcpProblems"] == "15"
    assert all(re.fullmatch("[A-Za-z]+", name) for name in numbers)


def test_the_order_of_the_table_is_that_of_the_analysis(tmp_path: Path) -> None:
    document = (written(tmp_path) / "report.tex").read_text()
    shown = re.findall(r"& \\(cpbenchLcp\w+)Solved\{\}", document)
    order = [f"cpbenchLcp{letters(str(label))}" for label in counts().index]
    assert shown == [name for name in order if name in shown]


def test_names_that_would_be_one_macro_are_two() -> None:
    macros = Macros()
    calls = [macros.define((name, "solved"), str(k)) for k, name in enumerate(["a-b", "a_b", "a b", "a.b"])]
    assert len(set(calls)) == 4
    assert list(macros.values.values()) == ["0", "1", "2", "3"]
    again = macros.define(("a_b", "solved"), "7")
    assert again == calls[1]


def test_whatever_is_named_stays_text(tmp_path: Path) -> None:
    folder = written(tmp_path, hostile_suite(), citations={HOSTILE: HOSTILE}, facets=("family",))
    for path in folder.iterdir():
        body = path.read_text()
        assert body.isascii()
        assert "\\input{x}" not in body
        assert "{x}$" not in body


def test_every_ascii_character_is_escaped_or_harmless() -> None:
    for code in range(32, 127):
        found = text(f"a{chr(code)}b")
        if chr(code) in "\\{}$&#^_%~":
            assert found != f"a{chr(code)}b"
    assert text("line\nbreak\x00\x1b") == "line break"


def test_solvers_with_one_citation_share_an_entry(tmp_path: Path) -> None:
    references = (written(tmp_path) / "refs.bib").read_text()
    assert references.count("Cryer 1971") == 1
    assert r"\texttt{pgs}, \texttt{psor}" in references
    assert r"J{\'u}dice" in references
    document = (tmp_path / "report.tex").read_text()
    cited = {key for group in re.findall(r"\\cite\{([^}]*)\}", document) for key in group.split(",")}
    assert cited == set(re.findall(r"@\w+\{([^,]+),", references))
    assert Bibliography().cite("solver", "bpp", " ") == ""


def test_facets_have_a_panel_a_family_and_a_tolerance(tmp_path: Path) -> None:
    document = (written(tmp_path, facets=("family", "tolerance")) / "report.tex").read_text()
    titles = re.findall(r"title=\{([^}]*(?:\{-\})?[^}]*): ", document)
    assert len(re.findall(r"\\nextgroupplot", document)) == 5 + 3
    assert titles[:2] == ["chain", "fathi"]
    assert "are judged at each" in document


def test_curves_are_those_of_the_profile(tmp_path: Path) -> None:
    rows = table(
        row("a", "fast", "solved", 1.0), row("b", "fast", "timeout"),
        row("a", "slow", "solved", 4.0), row("b", "slow", "solved", 1.0),
    )  # fmt: skip
    document = (written(tmp_path, rows) / "report.tex").read_text()
    plots = re.findall(r"coordinates \{([^}]*)\}", document)
    assert sorted(plots) == ["(1,0.5)(4,1)(8,1)", "(1,0.5)(8,0.5)"]


def test_an_empty_run_is_a_document_too(tmp_path: Path) -> None:
    assert "No pair was planned" in (written(tmp_path, table()) / "report.tex").read_text()


@pytest.mark.nightly
def test_citations_of_collections_are_read_from_their_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    problems = Path(__file__).parents[2] / "problems" / "lcp" / "lcp-classics.h5"
    run = tmp_path / "r.sqlite"
    given = [
        "run",
        "--plan",
        "none",
        str(problems),
        "-s",
        "lemke",
        "--where",
        "name in ['murty-4', 'murty-8']",
        "-o",
        str(run),
        "--repeats",
        "1",
    ]
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(cli, given)
    assert done.exit_code == 0, done.output
    with Store(run) as store:
        found = citations(store)
    assert list(found) == ["lcp-classics"]
    assert found["lcp-classics"].startswith("Murty 1978, Math. Prog. 7:61")


def tex_is_there() -> bool:
    if shutil.which("pdflatex") is None or shutil.which("kpsewhich") is None:
        return False
    asked = subprocess.run(["kpsewhich", "pgfplots.sty", "booktabs.sty"], capture_output=True, text=True, check=False)
    return len(asked.stdout.split()) == 2


@pytest.mark.nightly
def test_it_compiles_and_says_the_numbers(tmp_path: Path) -> None:
    """What pdflatex expands the macros to, written to its log, is what the analysis says."""
    if not tex_is_there():
        assert os.environ.get("CPBENCH_REQUIRE") != "all", "pdflatex, pgfplots or booktabs is missing"
        pytest.skip("needs a program: pdflatex with pgfplots and booktabs, apt-get install texlive-pictures")
    folder = written(tmp_path, hostile_suite(), citations={"chain": "Ägidius – 1999"}, facets=("family", "tolerance"))
    path = folder / "report.tex"
    path.write_text(
        path.read_text().replace("\\end{document}", "\\typeout{SOLVED=\\cpbenchLcpPsorSolved=}\n\\end{document}")
    )
    options = ["-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape"]
    for words in (["pdflatex", *options, "report"], ["bibtex", "report"], *([["pdflatex", *options, "report"]] * 2)):
        done = subprocess.run(
            words, cwd=folder, capture_output=True, text=True, timeout=600, errors="replace", check=False
        )
        assert done.returncode == 0, done.stdout[-2000:]
    log = (folder / "report.log").read_text(errors="replace")
    assert f"SOLVED={counts().loc['psor', 'solved']}=" in log
    assert not re.search(r"(Citation|Reference|Label).*(undefined|multiply)", log)
    assert "undefined references" not in log
    assert "Missing character" not in log
    assert (folder / "report.pdf").stat().st_size > 20_000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--format", "tex", "--facet", "famly"], "unknown facet 'famly': did you mean family"),
        (["--format", "tex", "--baseline", "other.sqlite"], "leave --format tex out"),
        (["--facet", "family"], "add --format tex"),
        (["--format", "pdf"], "'pdf' is not one of 'html', 'tex'"),
        (["--baseline", "other.sqlite"], "other.sqlite"),
    ],
)
def test_bad_input_is_refused(tmp_path: Path, options: list[str], message: str) -> None:
    file = results_file(tmp_path / "r.sqlite", SUITE)
    done = CliRunner().invoke(cli, ["report", str(file), "-o", str(tmp_path / "out"), *options])
    assert done.exit_code != 0
    said = str(done.exception) if isinstance(done.exception, CpbenchError) else done.output
    assert message in said


@pytest.mark.nightly
def test_a_baseline_has_a_section_in_the_markdown_report(tmp_path: Path) -> None:
    base = SUITE.copy()
    changed = SUITE.copy()
    worse = (changed["label"] == "pgs") & (changed["status"] == "solved")
    changed.loc[worse, ["status", "error"]] = ["wrong", 0.5]
    old, new = (results_file(tmp_path / f"{n}.sqlite", rows) for n, rows in (("old", base), ("new", changed)))
    done = CliRunner().invoke(cli, ["report", str(new), "-o", str(tmp_path / "out"), "--baseline", str(old)])
    assert done.exit_code == 0, done.output
    report = (tmp_path / "out" / "report.md").read_text()
    assert f"### Regressed ({int(worse.sum())} pairs)" in report
    assert "## Compared with `" in report
    assert "solved → wrong" in report
