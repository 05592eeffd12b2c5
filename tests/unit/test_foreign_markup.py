"""Names and messages with HTML and line feeds in them: text in all that is written or printed, by parsers of others."""

from __future__ import annotations

import csv
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import h5py
import pytest
from command_line import cpbench
from markdown_it import MarkdownIt
from markdown_it.token import Token
from synthetic_results import pair as planned

import cpbench as cp
from cpbench.bench.planning.plan import Limits
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.report.templating import Table
from cpbench.report.text import code, plain

SCRIPT = "<script>alert(36)</script>"
TEXTS = (
    SCRIPT,
    f"a\n\n{SCRIPT}\n",
    f"`{SCRIPT}",
    f"``` \n{SCRIPT}",
    f"a|{SCRIPT}`|`",
    f"\\{SCRIPT}\\`",
    f"--> {SCRIPT} <!--",
    f"[x](javascript:alert(36)) {SCRIPT}",
    "<img src=x onerror=alert(36)>",
    "</td></table><b onclick='alert(36)'>",
    "<?php x ?>",
    "&lt;b&gt;",
)
MARKS = (
    *("a|b", "`x`", "``", "*b* _i_", "[l](http://x)", "![i](x)", "a\nb", "$x$", "\\|", "# h", "~~s~~", "\x1b[31m"),
    *("|", "_under", "é漢"),
)
"""Texts that would be something else than text, though no HTML."""
MARKED = f"a|`*b*`[l](http://x)_i_{SCRIPT}"
FEED = "first\nsecond"
"""A name over two lines."""


def _tokens(tokens: list[Token] | None) -> Iterator[Token]:
    for token in tokens or ():
        yield token
        yield from _tokens(token.children)


def _html(markdown: str) -> list[str]:
    """The pieces of HTML that two readers of Markdown let through."""
    readers = (MarkdownIt("commonmark"), MarkdownIt("gfm-like", {"html": True, "linkify": False}))
    return [
        token.content
        for reader in readers
        for token in _tokens(reader.parse(markdown))
        if token.type.startswith("html")
    ]


class _Tags(HTMLParser):
    """The tags of a page, and the attributes that would run something."""

    def __init__(self) -> None:
        super().__init__()
        self.found: Counter[str] = Counter()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found[tag] += 1
        for name, value in attrs:
            self.found[f"@{name}"] += name.startswith("on") or (
                name in ("href", "src") and "alert(36)" in (value or "")
            )


@pytest.mark.parametrize("text", TEXTS + MARKS)
def test_pieces_of_markdown_are_text(text: str) -> None:
    """Running text, code spans, cells of both; each shows the text, and a table keeps its cells."""
    table = Table.of({"a": "text", "b": "code"}, [[text, text]]).markdown
    pieces = [plain(text), code(text), table]
    assert _html("\n\n".join(pieces)) == []
    words = "".join(letter if letter.isprintable() else " " for letter in text).split()
    for piece in pieces[:2]:
        parser = _Shown()
        parser.feed(MarkdownIt("commonmark").render(f"x {piece} y"))
        assert parser.text.split() == ["x", *words, "y"]
    cells = [token for token in MarkdownIt("commonmark").enable("table").parse(table) if token.type == "inline"]
    assert len(cells) == 4


class _Shown(HTMLParser):
    text = ""

    def handle_data(self, data: str) -> None:
        self.text += data


def test_without_escapes_the_parser_finds_html() -> None:
    """What the test rests on: the same texts, raw."""
    assert [bool(_html(f"| a |\n|---|\n| {text.splitlines()[-1]} |\n\n{text}")) for text in TEXTS] == [
        text != "&lt;b&gt;" for text in TEXTS
    ]


def _problem(folder: Path, name: str) -> str:
    """A file with markup in its name, in the problem's name and in other attributes; its address."""
    path = folder / f"{name}.h5"
    cp.save(cp.LCP(M=[[2.0, 0.0], [1.0, 3.0]], q=[-4.0, -7.0], name=f"{SCRIPT} {FEED}"), path)
    with h5py.File(path, "a") as file:
        info = file.require_group("info")
        for label in ("family", "description", "source", "licence", "citation", "title"):
            info.attrs[label] = f"{SCRIPT} {FEED}"
    return path.name


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of two solvers on problems whose names, files and messages have markup in them, and a copy without."""
    place = tmp_path_factory.mktemp("markup")
    for name, script, feed in (("r", MARKED, FEED), ("plain", "tag", "first second")):
        pairs = [
            planned(
                k, label, address=f"f{script}{feed}{k}.h5".replace("/", "_"), problem=f"{script}{feed} {k}",
                family=script, fingerprint=f"{k:064x}", limits=Limits(5.0, 2**30, 1, 1),
            )
            for k in range(4) for label in ("lemke", "pgs", "psor", "bpp")
        ]  # fmt: skip
        with Store(place / f"{name}.sqlite", create=True) as store:
            store.plan(pairs)
            sheet = dict.fromkeys(("summary", "licence", "publishing", "method"), script)
            store.set_meta(
                command=f"cpbench run {script}", date="2026-11-27", machine={"cpu": script, script: 1}, seed=1,
                versions={script: script}, solvers={"lemke": {"name": "lemke", "node": "lcp", **sheet}},
                left_out=[{"status": "missing", "node": "", "reason": script, "solvers": {script: 1}, "keys": []}],
            )  # fmt: skip
            store.note_files([], [(f"{script}{feed}.h5", f"is no file {script}{feed}")])
            bad = Outcome(status="error", message=f"{script}\n{feed}", version=script, host=script)
            endings = {
                "lemke": Outcome(status="solved", claim="solved", route="direct", error=1e-9, solve=0.1, host=script),
                "pgs": bad,
                "psor": replace(bad, status="unavailable", message=f"broken: {script}{feed}"),
                "bpp": replace(bad, status="wrong", claim="solved", error=0.5, solve=0.2, flags="clock"),
            }
            for pair in pairs:
                store.finish(pair.key, endings[pair.entry.solver])
    return place


def _run(folder: Path, *arguments: str) -> None:
    """Run a command; no line that it prints begins in the middle of a name."""
    done = cpbench(folder, *arguments)
    assert done.returncode in (0, 1), done.stderr
    assert not [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("second")], arguments


@pytest.fixture(scope="module")
def written(folder: Path) -> Path:
    for name in ("r", "plain"):
        _run(folder, "report", f"{name}.sqlite", "-o", name, "--title", SCRIPT if name == "r" else "tag")
        _run(folder, "results", "export", f"{name}.sqlite", "--rows", f"{name}/export.csv")
        _run(folder, "compare", f"{name}.sqlite", f"{name}.sqlite", *_outputs(name))
        _run(folder, "plot", "profile", f"{name}.sqlite", "-o", f"{name}/plot.svg")
        _run(folder, "info", f"{name}.sqlite")
    return folder


def _outputs(name: str) -> list[str]:
    return [word for suffix in ("md", "json") for word in ("-o", f"{name}/compare.{suffix}")]


def _kinds(path: Path) -> list[str]:
    """What a file of Markdown is made of, but for text and code."""
    tokens = _tokens(MarkdownIt("gfm-like", {"linkify": False}).parse(path.read_text("utf-8")))
    return [token.type for token in tokens if token.type not in ("text", "text_special", "code_inline")]


def test_markdown_has_no_html(written: Path) -> None:
    """In all files; a script stands there in code alone, and names make no cell, link, heading or emphasis."""
    for name in ("report.md", "details.md"):
        assert _kinds(written / "r" / name) == _kinds(written / "plain" / name), name
    files = sorted((written / "r").glob("*.md"))
    assert {"report.md", "details.md", "compare.md"} <= {file.name for file in files}
    for file in files:
        text = file.read_text("utf-8")
        assert "alert(36)" in text
        assert _html(text) == [], file.name
        tokens = list(_tokens(MarkdownIt("gfm-like", {"html": True, "linkify": False}).parse(text)))
        outside = [t.content for t in tokens if t.type == "text" and not t.children]
        raw = text.count("<script")
        inside = sum(t.content.count("<script") for t in tokens if t.type in ("code_inline", "fence", "code_block"))
        assert raw == inside, file.name
        assert outside


def test_pages_have_the_tags_of_a_harmless_run(written: Path) -> None:
    found = []
    for name in ("r", "plain"):
        parser = _Tags()
        parser.feed((written / name / "report.html").read_text("utf-8"))
        found.append(parser.found)
    assert found[0]["script"] == found[1]["script"]
    assert {name for name, count in found[0].items() if name[0] == "@" and count} == set()
    assert found[0].keys() == found[1].keys()


def test_tables_have_no_tag_and_one_line_a_row(written: Path) -> None:
    for file in ("results.csv", "export.csv"):
        with open(written / "r" / file, encoding="utf-8", newline="") as opened:
            text = opened.read()
        assert "<script" not in text
        assert len(list(csv.reader(text.splitlines()))) == text.count("\n") == 17
        assert "&lt;script>" in text
        assert FEED.replace("\n", "\\n") in text


def test_a_figure_has_no_foreign_element(written: Path) -> None:
    names = [{node.tag for node in ElementTree.parse(written / name / "plot.svg").iter()} for name in ("r", "plain")]
    assert names[0] == names[1]


@pytest.mark.needs("cpbench_solvers")
def test_terminals_get_one_line_for_each_name(tmp_path: Path) -> None:
    """Of a file, of a problem in it, of what it says, in tables and in refusals."""
    address = _problem(tmp_path, FEED)
    for arguments in (
        ("info", address),
        ("info", *(_problem(tmp_path, f"{FEED}{k}") for k in range(4))),
        ("verify", address, "--answer", "no\nsecond.npy"),
        ("solve", address, "-s", "lemke"),
        ("convert", address, "to\nsecond.h5", "--to", "qp", "--routes", "all"),
        ("run", address, f"no\nsecond{os.sep}file.h5", "-s", "lemke", "--no-report", "--repeats", "1"),
        ("info", "no\nsecond.h5"),
    ):
        done = cpbench(tmp_path, *arguments)
        assert done.returncode in (0, 1, 2), (arguments, done.stderr)
        lines = (done.stdout + done.stderr).splitlines()
        assert not [line for line in lines if line.startswith("second")], arguments
        assert [line for line in lines if "\\nsecond" in line], arguments
