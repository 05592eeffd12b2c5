"""The import arrow of cpbench/ARCHITECTURE.md, read from the sources."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from sources import ADAPTERS, LAB, PACKAGES, PROBLEMS, SOLVERS
from sources import CORE as PACKAGE

FOUNDATION: dict[str, set[str]] = {
    "foundation.matrices": {"errors"},
    "foundation.factorization": {"errors", "foundation.matrices"},
    "foundation.cones": {"foundation.matrices"},
    "foundation.frames": set(),
    "foundation.extensions": {"errors"},
    "foundation.child_processes": set(),
    "foundation.locks": {"errors"},
    "foundation.imports": set(),
    "foundation.kernel_cache": {"foundation.locks", "foundation.imports"},
    "foundation.text": {"errors"},
}
BASE = {"errors", "registry", "foundation", *FOUNDATION, "formulations.expressions", "formulations.ncp_functions"}
ROOMS = {"storage", "conversions", "solvers", "verification"}
DATA = BASE | {"formulations", "proofs"} | ROOMS
ALLOWED: dict[str, set[str]] = {
    "errors": set(),
    "registry": {"errors"},
    "foundation": set(),
    **FOUNDATION,
    "formulations.expressions": {"errors", "foundation.extensions", "foundation.matrices", "foundation.kernel_cache"},
    "formulations.ncp_functions": {"foundation.matrices", "formulations.expressions"},
    "formulations": BASE,
    "formulations.exchange": BASE | {"formulations"},
    **{room: BASE | {"formulations"} for room in ROOMS},
    **{room: BASE | {"formulations", "formulations.exchange"} for room in ("storage", "solvers")},
    "proofs": BASE | {"formulations", "verification"},
    "graph.routes": BASE | {"formulations", "conversions"},
    "graph": DATA | {"graph.routes"},
    "graph.checking": DATA | {"graph"},
    "generators": BASE | {"formulations"},
    "bench.multipliers": BASE | {"formulations", "verification"},
    "bench": DATA | {"formulations.exchange", "graph", "bench.multipliers"},
    "analysis": DATA | {"graph"},
    "report": DATA | {"graph", "analysis"},
    "testing": DATA | {"graph", "graph.checking", "generators"},
    "api": DATA | {"graph", "graph.checking", "testing", "bench", "bench.multipliers"}
    | {"analysis", "report", "generators"},
    "cli": DATA | {"formulations.exchange", "graph", "graph.checking", "testing", "bench"}
    | {"bench.multipliers", "analysis", "report", "generators", "api"},
}  # fmt: skip
"""What each room may import; a part of a room that has rules of its own is named with its room."""
EXCEPTIONS = {"generators/collection.py": {"storage"}}  # it reads what stands in files
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p.parent != PACKAGE or p.stem not in ("__init__", "__main__"))


def _room(module: str) -> str:
    """Return the room of a module, or the part of one that has rules of its own."""
    inside = module.removeprefix("cpbench.").split(".")
    part = ".".join(inside[:2])
    return part if part in ALLOWED else inside[0]


def test_the_first_floor_is_small() -> None:
    assert len({path.relative_to(PACKAGE).parts[0] for path in PACKAGE.glob("*/**/*.py")}) <= 15
    assert len(list(PACKAGE.glob("*.py"))) <= 4


def _modules(path: Path) -> set[str]:
    """Return the modules that a file imports, of all packages."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno} imports relatively: the arrow could not be read"
        if isinstance(node, ast.ImportFrom) and node.module:
            longer = [f"{node.module}.{a.name}" for a in node.names]
            found.update(name if node.module == "cpbench" or _is_part(name) else node.module for name in longer)
        elif isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
    return found


def _is_part(name: str) -> bool:
    return name.startswith("cpbench.") and name.removeprefix("cpbench.") in ALLOWED


def _imports(path: Path) -> set[str]:
    """Return the rooms of cpbench that a file imports."""
    return {_room(n) for n in _modules(path) if n.startswith("cpbench.")} & set(ALLOWED)


def test_imports_point_one_way() -> None:
    wrong: list[str] = []
    for path in FILES:
        relative = path.relative_to(PACKAGE)
        room = _room(".".join(("cpbench", *relative.with_suffix("").parts)))
        up = _imports(path) - ALLOWED[room] - {room} - EXCEPTIONS.get(relative.as_posix(), set())
        wrong += [f"{relative} imports {name}" for name in sorted(up)]
    assert not wrong, "\n".join(wrong)


ALLOWED_TO_SOLVERS = BASE | {"formulations", "solvers"}
"""What native solvers and adapters may import of cpbench."""


def test_the_benchmark_imports_neither_its_contestants_nor_the_laboratory_nor_sources_of_problems() -> None:
    """They come in by entry points, as another package does."""
    outside = {path.name for path in PACKAGES} - {PACKAGE.name}
    wrong = [f"{path.relative_to(PACKAGE)} imports {name}" for path in FILES for name in sorted(_modules(path))
             if name.split(".")[0] in outside]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_no_text_of_the_benchmark_names_a_module_of_the_sources_of_problems() -> None:
    """By which `import_module` or a registry would import it."""
    named = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "cpbench_problems" in node.value
    ]
    assert not named, "\n".join(named)


ALLOWED_TO_PROBLEMS = {
    "generators": BASE | {"formulations", "generators"},
    "formats": BASE | {"formulations", "formulations.exchange", "storage"},
    "scenes": DATA | {"graph", "generators", "api"},
    "simulators.py": BASE | {"formulations"},
    "applications.py": BASE | {"formulations"},
    "programs.py": BASE | {"api"},
    "recorder.py": BASE | {"formulations", "storage"},
    "pack_command.py": DATA | {"cli"},
    "__init__.py": {"registry"},
}
"""What each room of `cpbench_problems` may import of cpbench."""
OVER_FORMATS = ("pack_command.py", "programs.py")
"""Modules that make problems of arrays, by the forms of the formats."""


def test_sources_of_problems_import_data_and_the_room_that_takes_them() -> None:
    """Families know no file, formats no family, and neither knows a solver."""
    wrong: list[str] = []
    for path in sorted(PROBLEMS.rglob("*.py")):
        relative = path.relative_to(PROBLEMS)
        wrong += [
            f"{relative} imports {room}" for room in sorted(_imports(path) - ALLOWED_TO_PROBLEMS[relative.parts[0]])
        ]
        others = ("cpbench_solvers", "cpbench_adapters", "cpbench_lab", *(f"cpbench_problems.{room}"
                  for room in ALLOWED_TO_PROBLEMS if room != relative.parts[0]
                  and not (room == "formats" and relative.name in OVER_FORMATS)))  # fmt: skip
        wrong += [f"{relative} imports {name}" for name in sorted(_modules(path)) if name.startswith(others)]
    assert not wrong, "\n".join(wrong)


def test_no_other_package_imports_sources_of_problems() -> None:
    wrong = [f"{path.relative_to(root.parent)} imports {name}" for root in (SOLVERS, ADAPTERS, LAB)
             for path in sorted(root.rglob("*.py")) for name in sorted(_modules(path))
             if name.split(".")[0] == "cpbench_problems"]  # fmt: skip
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", [SOLVERS, ADAPTERS], ids=lambda path: path.name)
def test_the_contestants_import_data_and_the_base_of_solvers_alone(package: Path) -> None:
    """And nothing of each other or of the laboratory."""
    others = {path.name for path in PACKAGES} - {PACKAGE.name, package.name}
    files = sorted(package.rglob("*.py"))
    wrong = [f"{path.relative_to(package)} imports {room}" for path in files
             for room in sorted(_imports(path) - ALLOWED_TO_SOLVERS)]  # fmt: skip
    wrong += [f"{path.relative_to(package)} imports {name}" for path in files
              for name in sorted(_modules(path)) if name.split(".")[0] in others]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_the_laboratory_finds_solvers_by_the_registry() -> None:
    """And only its commands read options as the command line does."""
    wrong = [f"{path.relative_to(LAB)} imports {name}" for path in sorted(LAB.rglob("*.py"))
             for name in sorted(_modules(path)) if name.startswith(("cpbench_solvers", "cpbench_adapters"))
             or (name.startswith("cpbench.cli") and path.parent.name != "commands")]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_the_command_line_is_thin() -> None:
    """It reads options and makes the text that it prints; what decides lies below it."""
    lines = {path.name: path.read_text().count("\n") for path in (PACKAGE / "cli").glob("*.py")}
    assert sum(lines.values()) <= 4550
    assert max(lines.values()) <= 330


def test_an_import_is_seen() -> None:
    """The files are found and read: the command line stands on the runs, and a run on the solvers."""
    assert "bench" in _imports(PACKAGE / "cli" / "run_command.py")
    assert any("solvers" in _imports(path) for path in FILES if path.parent.name == "bench")


def test_the_graph_knows_no_mathematics() -> None:
    names = {
        a.name.split(".")[0]
        for file in ("__init__.py", "routes.py")
        for node in ast.walk(ast.parse((PACKAGE / "graph" / file).read_text()))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for a in node.names
    }
    assert not names & {"numpy", "scipy", "np", "sp"}


JUDGED_DATA = {
    "cpbench.errors", "cpbench.foundation.matrices", "cpbench.formulations.base", "cpbench.formulations.stack.Stack",
    "cpbench.foundation.cones.Cone", "cpbench.foundation.cones.ProductCone",
    "cpbench.registry.NodeTable",
}  # fmt: skip
"""What the judge may read from outside its own room: data and errors, and no mathematics of the solvers."""
READ_AS_DATA = {
    f"cpbench.formulations.{module}"
    for module in (
        "linear.AVI",
        "linear.LCP",
        "linear.MLCP",
        "conic.ConeQP",
        "local_contact.FrictionContact",
        "programs.QP",
    )
}
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
    for path in [*(PACKAGE / "verification").rglob("*.py"), *(PACKAGE / "proofs").rglob("*.py")]:
        own = {"cpbench.verification", *({"cpbench.proofs"} if path.parent.name == "proofs" else ())}
        allowed = JUDGED_DATA | own | (READ_AS_DATA if path.stem == "polyhedra" else set())
        shared = {n for n in _names(path) if not any(n == a or n.startswith(f"{a}.") for a in allowed)}
        wrong += [f"{path.name} imports {name}" for name in sorted(shared)]
    assert not wrong, "\n".join(wrong)


def test_solvers_do_not_read_the_judge() -> None:
    wrong: list[str] = []
    for folder in (PACKAGE / "solvers", SOLVERS, ADAPTERS):
        for path in sorted(folder.rglob("*.py")):
            read = sorted(n for n in _names(path) if n.startswith(("cpbench.verification", "cpbench.proofs")))
            wrong += [f"{path.name} imports {name}" for name in read]
    assert not wrong, "\n".join(wrong)
