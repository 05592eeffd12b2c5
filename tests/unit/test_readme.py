"""The README's tables are those of the registries; `cpbench list readme-tables` prints them."""

from __future__ import annotations

from pathlib import Path

from cpbench.report.registry_tables import registry_tables, replace_between_marks

README = Path(__file__).resolve().parents[2] / "README.md"


def test_tables_are_those_of_the_registries() -> None:
    text = README.read_text()
    assert text == replace_between_marks(text, registry_tables()), (
        "python -m cpbench list readme --write README.md brings the tables up to date"
    )


def test_every_picture_and_file_named_exists() -> None:
    import re

    for target in re.findall(r"\]\(([^)#]+)\)", README.read_text()):
        if "://" not in target:
            assert (README.parent / target).exists(), target
