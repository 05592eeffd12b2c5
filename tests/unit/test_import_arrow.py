"""The import arrow of cpbench/ARCHITECTURE.md, read from the sources."""

from __future__ import annotations

import ast
from pathlib import Path

from sources import CORE as PACKAGE
from sources import LAB, SOLVERS

BASE = {
    "errors", "definite", "matrices", "transversal", "factorization", "cones", "product_cones", "registry",
    "extensions", "kernel_cache", "imports", "toml_text", "plain_text", "plurals", "expressions", "brackets", "locks",
    "temporary",
    "ncp_functions", "frames", "child_processes", "help_text",
}  # fmt: skip
ROOMS = {"storage", "conversions", "solvers", "verification"}
ALLOWED: dict[str, set[str]] = {
    "errors": set(),
    "definite": {"errors"},
    "matrices": {"errors", "definite"},
    "transversal": {"matrices"},
    "factorization": {"errors", "matrices", "transversal"},
    "cones": {"matrices"},
    "product_cones": {"matrices", "cones"},
    "registry": {"errors"},
    "frames": set(),
    "extensions": {"errors"},
    "help_text": {"extensions"},
    "child_processes": set(),
    "locks": set(),
    "ncp_functions": {"matrices", "expressions"},
    "temporary": {"errors", "locks"},
    "imports": set(),
    "kernel_cache": {"locks", "imports", "child_processes"},
    "brackets": {"errors"},
    "toml_text": set(),
    "plain_text": set(),
    "plurals": set(),
    "expressions": {"errors", "matrices", "kernel_cache"},
    "formulations": BASE,
    "facts": BASE | {"formulations"},
    "exchange": BASE | {"formulations"},
    **{room: BASE | {"formulations"} for room in ROOMS},
    **{room: BASE | {"formulations", "exchange"} for room in ("storage", "solvers")},
    "routes": BASE | {"formulations", "conversions"},
    "graph": BASE | {"formulations", "routes"} | ROOMS,
    "checking": BASE | {"formulations", "graph"} | ROOMS,
    "multipliers": BASE | {"formulations", "verification"},
    "generators": BASE | {"formulations"},
    "bench": BASE | {"formulations", "exchange", "graph", "multipliers"} | ROOMS,
    "analysis": BASE | {"formulations", "graph"} | ROOMS,
    "report": BASE | {"formulations", "graph", "analysis"} | ROOMS,
    "testing": BASE | {"formulations", "graph", "checking", "generators"} | ROOMS,
    "api": BASE
    | {"multipliers"}
    | {"formulations", "facts", "graph", "checking", "testing", "bench", "analysis", "report", "generators"}
    | ROOMS,
    "cli": BASE
    | {"formulations", "facts", "exchange", "graph", "checking", "testing", "bench", "analysis", "report", "generators"}
    | {"api", "multipliers"}
    | ROOMS,
}
EXCEPTIONS = {"generators/collection.py": {"storage"}}  # it reads what stands in files
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem not in ("__init__", "__main__"))


def _room(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


def _modules(path: Path) -> set[str]:
    """Return the modules that a file imports, of all packages."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno} imports relatively: the arrow could not be read"
        if isinstance(node, ast.ImportFrom) and node.module:
            found.update([f"cpbench.{a.name}" for a in node.names] if node.module == "cpbench" else [node.module])
        elif isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
    return found


def _imports(path: Path) -> set[str]:
    return {_room(n) for n in _modules(path) if n.startswith("cpbench.")} & set(ALLOWED)


def test_imports_point_one_way() -> None:
    wrong: list[str] = []
    for path in FILES:
        relative = path.relative_to(PACKAGE)
        room = relative.parts[0].removesuffix(".py")
        up = _imports(path) - ALLOWED[room] - {room} - EXCEPTIONS.get(relative.as_posix(), set())
        wrong += [f"{relative} imports {name}" for name in sorted(up)]
    assert not wrong, "\n".join(wrong)


ALLOWED_TO_SOLVERS = BASE | {"formulations", "solvers"}
NOT_TO_SOLVERS = ("cpbench_lab", "cpbench.solvers.adapters")


def test_the_benchmark_imports_neither_its_contestants_nor_the_laboratory() -> None:
    """They come in by entry points, as another package does."""
    outside = ("cpbench_solvers", "cpbench_lab")
    wrong = [f"{path.relative_to(PACKAGE)} imports {name}" for path in FILES for name in sorted(_modules(path))
             if name.split(".")[0] in outside]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_the_contestants_import_data_and_the_base_of_solvers_alone() -> None:
    wrong = [f"{path.relative_to(SOLVERS)} imports {room}" for path in sorted(SOLVERS.rglob("*.py"))
             for room in sorted(_imports(path) - ALLOWED_TO_SOLVERS)]  # fmt: skip
    wrong += [f"{path.relative_to(SOLVERS)} imports {name}" for path in sorted(SOLVERS.rglob("*.py"))
              for name in sorted(_modules(path)) if name.startswith(NOT_TO_SOLVERS)]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_the_laboratory_finds_solvers_by_the_registry() -> None:
    """And only its commands read options as the command line does."""
    wrong = [f"{path.relative_to(LAB)} imports {name}" for path in sorted(LAB.rglob("*.py"))
             for name in sorted(_modules(path)) if name.startswith("cpbench_solvers")
             or (name.startswith("cpbench.cli") and path.parent.name != "commands")]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_the_command_line_is_thin() -> None:
    """It reads options and prints; what decides lies below it, where scripts reach it too."""
    lines = {path.name: path.read_text().count("\n") for path in (PACKAGE / "cli").glob("*.py")}
    assert sum(lines.values()) <= 3900
    assert max(lines.values()) <= 250


def test_an_import_is_seen() -> None:
    """The files are found and read: the command line stands on the runs, and a run on the solvers."""
    assert "bench" in _imports(PACKAGE / "cli" / "run_command.py")
    assert any("solvers" in _imports(path) for path in FILES if path.parent.name == "bench")


def test_the_graph_knows_no_mathematics() -> None:
    names = {
        a.name.split(".")[0]
        for file in ("graph.py", "routes.py")
        for node in ast.walk(ast.parse((PACKAGE / file).read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for a in node.names
    }
    assert not names & {"numpy", "scipy", "np", "sp"}


JUDGED_DATA = {
    "cpbench.errors", "cpbench.foundation.matrices", "cpbench.formulations.base", "cpbench.formulations.stack.Stack",
    "cpbench.foundation.product_cones.Cone", "cpbench.foundation.product_cones.ProductCone",
}  # fmt: skip
"""What the judge may read from outside its own room: data and errors, and no mathematics of the solvers."""
READ_AS_DATA = {
    f"cpbench.formulations.{node}.{name}"
    for node, name in {
        "avi": "AVI", "coneqp": "ConeQP", "fc": "FrictionContact", "lcp": "LCP", "mlcp": "MLCP", "qp": "QP"
    }.items()
}  # fmt: skip
"""Problems whose kind is asked for by exact certificates, which read their arrays."""


def _names(path: Path) -> set[str]:
    """Every name of cpbench that a module imports, with its full path."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.update(f"{node.module}.{a.name}" for a in node.names if node.module.split(".")[0] == "cpbench")
        elif isinstance(node, ast.Import):
            found.update(a.name for a in node.names if a.name.split(".")[0] == "cpbench")
    return found


def test_the_judge_shares_no_mathematics_with_solvers() -> None:
    wrong: list[str] = []
    for path in sorted((PACKAGE / "verification").rglob("*.py")):
        allowed = JUDGED_DATA | {"cpbench.verification"} | (READ_AS_DATA if path.stem == "polyhedra" else set())
        shared = {n for n in _names(path) if not any(n == a or n.startswith(f"{a}.") for a in allowed)}
        wrong += [f"{path.name} imports {name}" for name in sorted(shared)]
    assert not wrong, "\n".join(wrong)


def test_solvers_do_not_read_the_judge() -> None:
    wrong: list[str] = []
    for path in [*sorted((PACKAGE / "solvers").rglob("*.py")), *sorted(SOLVERS.rglob("*.py"))]:
        read = sorted(n for n in _names(path) if n.startswith("cpbench.verification"))
        wrong += [f"{path.name} imports {name}" for name in read]
    assert not wrong, "\n".join(wrong)
