"""Writes all pages as Markdown, and makes the site of them.

    python docs/generate [FOLDER]

It needs the extra `docs`, and no network. Pages are in FOLDER/pages, the site is in FOLDER/site; FOLDER is `build`,
unless it is given. Whatever Sphinx warns of, as of a link that leads nowhere, or a page in no table of contents, is an
error.
"""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import command_page
import decision_index
import difficulty_page
import engine_laws_page
import interface_page
import motion_page
import optima_page
import registry_pages
import reproductions_page
import schema_page
import tolerance_page
import tutorial_pages
from sphinx.cmd.build import main as build

DOCS = Path(__file__).resolve().parents[1]
PAGES: dict[str, Callable[[], str | bytes]] = {
    "reference/python.md": interface_page.page,
    "reference/formulations.md": registry_pages.formulations_page,
    "reference/conversions.md": registry_pages.conversions_page,
    "reference/solvers.md": registry_pages.solvers_page,
    "reference/formats.md": registry_pages.formats_page,
    "reference/schemas.md": schema_page.page,
    "methods/statistics.md": registry_pages.statistics_page,
    "methods/tolerances.md": tolerance_page.page,
    "methods/engine-laws.md": engine_laws_page.page,
    "methods/motion.md": motion_page.page,
    "methods/optima.md": optima_page.page,
    "methods/reproductions.md": reproductions_page.page,
    "methods/difficulty.md": difficulty_page.page,
    "decisions/index.md": decision_index.page,
}


def write(folder: Path) -> None:
    """Write the pages that are made, and copies of what is written by hand, into `folder`, whose content goes."""
    shutil.rmtree(folder, ignore_errors=True)
    by_hand = [DOCS / "conf.py", *DOCS.rglob("*.md"), *DOCS.glob("guides/*/*.py")]
    files: dict[str, str | bytes] = {str(path.relative_to(DOCS)): path.read_bytes() for path in by_hand}
    files |= {path: make() for path, make in PAGES.items()} | command_page.files() | tutorial_pages.files()
    for path, content in files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else DOCS.parent / "build")
    pages, site, memory = (str(target / name) for name in ("pages", "site", "doctrees"))
    write(Path(pages))
    sys.exit(build(["-nqEW", "--keep-going", "-d", memory, pages, site]) or print(Path(site, "index.html")))
