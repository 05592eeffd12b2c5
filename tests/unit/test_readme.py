"""The README's tables are those of the registries; `cpbench list readme-tables` prints them."""

from __future__ import annotations

import re
from pathlib import Path

from cpbench.formulations import formulations
from cpbench.graph import edges
from cpbench.report.registry_tables import promise, registry_tables, replace_between_marks

README = Path(__file__).resolve().parents[2] / "README.md"


def test_tables_are_those_of_the_registries() -> None:
    text = README.read_text()
    assert text == replace_between_marks(text, registry_tables()), (
        "python -m cpbench list readme --write README.md brings the tables up to date"
    )


def test_the_table_of_conversions_is_the_graph() -> None:
    """Read from the README itself: names, ends and promises of every registered conversion, and of no other."""
    rows = re.findall(r"^\| `(\S+)` \| (\w+) \| (\w+) \| ([\w -]+) \| .*\|$", README.read_text(), re.MULTILINE)
    known = {(e.name, e.source, e.target, promise(e)) for e in edges()}
    nodes = set(formulations.names())
    assert {row for row in rows if {row[1], row[2]} <= nodes} == known


def test_every_picture_and_file_named_exists() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README.read_text()):
        if "://" not in target:
            assert (README.parent / target).exists(), target
