"""The import arrow of cpbench/ARCHITECTURE.md, read from the sources."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest
from sources import ADAPTERS, LAB, PROBLEMS, SOLVERS, parsed
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
    "foundation.kernels": set(),
    "foundation.kernel_build": {"foundation.kernels"},
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
    "formulations.expressions": {"errors", "foundation.extensions", "foundation.matrices", "foundation.kernels"},
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


@cache
def _imported(path: Path) -> frozenset[tuple[str, str]]:
    """Return module and name of everything that a file imports; the name is empty where it imports the module."""
    found: set[tuple[str, str]] = set()
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path.name}:{node.lineno} imports relatively: the arrow could not be read"
            found.update((node.module or "", a.name) for a in node.names)
        elif isinstance(node, ast.Import):
            found.update((a.name, "") for a in node.names)
    return frozenset(found)


def _names(path: Path) -> set[str]:
    """Return every name that a file imports, with its full path."""
    return {f"{module}.{name}" if name else module for module, name in _imported(path)}


def _modules(path: Path) -> set[str]:
    """Return the modules that a file imports, of all packages."""
    found: set[str] = set()
    for module, name in _imported(path):
        longer = f"{module}.{name}"
        found.add(longer if name and (module == "cpbench" or _is_part(longer)) else module)
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


APART: dict[Path, tuple[str, ...]] = {
    PACKAGE: ("cpbench_solvers", "cpbench_adapters", "cpbench_problems", "cpbench_lab"),
    SOLVERS: ("cpbench_adapters", "cpbench_problems", "cpbench_lab"),
    ADAPTERS: ("cpbench_solvers", "cpbench_problems", "cpbench_lab"),
    PROBLEMS: ("cpbench_solvers", "cpbench_adapters", "cpbench_lab"),
    LAB: ("cpbench_solvers", "cpbench_adapters", "cpbench_problems"),
}
"""Packages that none of a package's modules imports: they come in by entry points and registries."""


@pytest.mark.parametrize("package", [pytest.param(p, marks=pytest.mark.needs(p.name), id=p.name) for p in APART])
def test_a_package_imports_none_of_the_others(package: Path) -> None:
    files = sorted(package.rglob("*.py"))
    assert files
    wrong = [f"{path.relative_to(package)} imports {name}" for path in files for name in sorted(_modules(path))
             if name.split(".")[0] in APART[package]]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_no_text_of_the_benchmark_names_a_module_of_the_sources_of_problems() -> None:
    """By which `import_module` or a registry would import it."""
    named = [
        f"{path.relative_to(PACKAGE)}:{node.lineno}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for node in ast.walk(parsed(path))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and "cpbench_problems" in node.value
    ]
    assert not named, "\n".join(named)


ALLOWED_TO_PROBLEMS = {
    "generators": BASE | {"formulations", "generators"},
    "formats": BASE | {"formulations", "formulations.exchange", "storage"},
    "scenes": DATA | {"graph", "generators", "api"},
    "simulators.py": BASE | {"formulations"},
    "applications.py": BASE | {"formulations"},
    "cvxpy_program.py": BASE | {"formulations", "storage"},
    "programs.py": BASE | {"api"},
    "recorder.py": BASE | {"formulations", "storage"},
    "pack_command.py": DATA | {"cli"},
    "__init__.py": {"registry"},
}
"""What each room of `cpbench_problems` may import of cpbench."""
OVER_FORMATS = ("pack_command.py", "programs.py")
"""Modules that make problems of arrays, by the forms of the formats."""


def test_sources_of_problems_import_data_and_the_room_that_takes_them() -> None:
    """Families know no file, and formats no family."""
    wrong: list[str] = []
    for path in sorted(PROBLEMS.rglob("*.py")):
        relative = path.relative_to(PROBLEMS)
        wrong += [
            f"{relative} imports {room}" for room in sorted(_imports(path) - ALLOWED_TO_PROBLEMS[relative.parts[0]])
        ]
        others = tuple(f"cpbench_problems.{room}" for room in ALLOWED_TO_PROBLEMS if room != relative.parts[0]
                       and not (room == "formats" and relative.name in OVER_FORMATS))  # fmt: skip
        wrong += [f"{relative} imports {name}" for name in sorted(_modules(path)) if name.startswith(others)]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("package", [SOLVERS, ADAPTERS], ids=lambda path: path.name)
def test_the_contestants_import_data_and_the_base_of_solvers_alone(package: Path) -> None:
    """And so not the judge."""
    wrong = [f"{path.relative_to(package)} imports {room}" for path in sorted(package.rglob("*.py"))
             for room in sorted(_imports(path) - ALLOWED_TO_SOLVERS)]  # fmt: skip
    assert not wrong, "\n".join(wrong)


def test_only_commands_of_the_laboratory_read_options_as_the_command_line_does() -> None:
    wrong = [f"{path.relative_to(LAB)} imports {name}" for path in sorted(LAB.rglob("*.py"))
             for name in sorted(_modules(path)) if name.startswith("cpbench.cli")
             and path.parent.name != "commands"]  # fmt: skip
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
    used = {name.split(".")[0] for file in ("__init__.py", "routes.py") for name in _names(PACKAGE / "graph" / file)}
    assert "cpbench" in used
    assert not used & {"numpy", "scipy"}


JUDGED_DATA = {
    "cpbench.errors", "cpbench.foundation.matrices", "cpbench.formulations.base", "cpbench.formulations.stack.Stack",
    "cpbench.foundation.cones.Cone", "cpbench.foundation.cones.ProductCone",
    "cpbench.foundation.extensions", "cpbench.registry.NodeTable",
}  # fmt: skip
"""What the judge may read from outside its own room: data, errors, and published measures where one is named; and no
mathematics of the solvers."""
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


def test_the_judge_shares_no_mathematics_with_solvers() -> None:
    wrong: list[str] = []
    for path in [*(PACKAGE / "verification").rglob("*.py"), *(PACKAGE / "proofs").rglob("*.py")]:
        own = {"cpbench.verification", *({"cpbench.proofs"} if path.parent.name == "proofs" else ())}
        allowed = JUDGED_DATA | own | (READ_AS_DATA if path.stem == "polyhedra" else set())
        shared = {
            n
            for n in _names(path)
            if n.split(".")[0] == "cpbench" and not any(n == a or n.startswith(f"{a}.") for a in allowed)
        }
        wrong += [f"{path.name} imports {name}" for name in sorted(shared)]
    assert not wrong, "\n".join(wrong)
