"""The tutorial is a user of cpbench: it stands on the interface and on few public modules, and nothing needs it."""

from __future__ import annotations

import ast
from pathlib import Path

import cpbench

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = {
    "errors", "foundation.matrices", "foundation.cones", "formulations.expressions", "graph",
    "formulations.base", "formulations.conic", "formulations.ncp_functions", "conversions.base", "solvers.base",
    "storage", "report.canvas", "report.show",
}  # fmt: skip
"""Beside `cpbench` itself: registries that it walks through, and the figures of problems that it shows."""


def imports(path: Path) -> set[str]:
    """Return every imported name of a module, with its full path."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
    return names


def test_nothing_imports_the_tutorial() -> None:
    for path in (ROOT / "cpbench").rglob("*.py"):
        assert not [name for name in imports(path) if name.split(".")[0] in ("lecture", "docs")], path


def test_the_tutorial_stands_on_the_interface() -> None:
    for path in (ROOT / "docs" / "lecture").rglob("*.py"):
        for name in imports(path):
            package, _, rest = name.partition(".")
            if package == "cpbench":
                public = rest in cpbench.__all__ or any(f"{rest}.".startswith(f"{module}.") for module in LIBRARY)
                assert public, f"{path.name}: {name}"
                assert "._" not in name.replace(".__version__", ""), f"{path.name}: {name} is private"
