"""Pages that MkDocs makes while it builds: of registries, schemas, commands and decisions, and the tutorial."""

from __future__ import annotations

from collections.abc import Callable

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
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

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


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to those that are written by hand."""
    for path, make in PAGES.items():
        files.append(File.generated(config, path, content=make()))
    for path, content in {**command_page.files(), **tutorial_pages.files()}.items():
        files.append(File.generated(config, path, content=content))
    return files
