"""The sources of the packages, for tests that read them."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CORE, SOLVERS, LAB = ROOT / "cpbench", ROOT / "cpbench_solvers", ROOT / "cpbench_lab"
ADAPTERS, PROBLEMS = ROOT / "cpbench_adapters", ROOT / "cpbench_problems"
PACKAGES = (CORE, SOLVERS, LAB, ADAPTERS, PROBLEMS)
TEMPLATES = "templates"
"""Folder of sources with gaps, which are no modules."""


def modules() -> list[Path]:
    """Return the files of all packages that are here, without templates."""
    return [path for package in PACKAGES for path in sorted(package.rglob("*.py")) if TEMPLATES not in path.parts]


def module_name(path: Path) -> str:
    """Return the name by which a file is imported."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def parsed(path: Path) -> ast.Module:
    """Return the syntax tree of a file, which several tests walk."""
    return ast.parse(path.read_text())
