"""What other installed packages add to cpbench, by entry points; nothing is imported before it is asked for.

Groups of entry points, and what stands behind a name in each:

- ``cpbench.plugins``: a module that registers solvers, conversions, formats and the like when it is imported
  (`cpbench.registry` loads it);
- ``cpbench.commands``: a click command of the command line. The first paragraph of its module's docstring is its help.
  A name as ``results.NAME`` is one of the group ``cpbench results``;
- ``cpbench.functions``: a function or class, offered as ``cpbench.NAME``;
- ``cpbench.hooks``: a function that cpbench's own commands call, as ``info`` does;
- ``cpbench.executors``: a module that connects a run to other machines (`bench/run`);
- ``cpbench.figures``: a package of modules, each with a kind of figure (`report/figure_kinds`): of runs where its name
  is ``runs``, else of problems.
"""

from __future__ import annotations

from functools import cache

TYPE_CHECKING = False  # as of `typing`, whose import takes as long as the start of Python
if TYPE_CHECKING:
    from importlib.metadata import EntryPoint
    from typing import Any

NATIVE = "cpbench_solvers"
"""The package whose solvers count as cpbench's own: they run in its processes, as trusted as it is itself."""
ADAPTERS = "cpbench_adapters"
"""The package whose solvers hand problems to those of other people; it comes with cpbench, too."""
COMMANDS, FUNCTIONS, HOOKS = "cpbench.commands", "cpbench.functions", "cpbench.hooks"
EXECUTORS, FIGURES = "cpbench.executors", "cpbench.figures"


@cache
def added(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name, in order of names."""
    from importlib.metadata import entry_points  # a third of the start-up of `cpbench --help`

    return {entry.name: entry for entry in sorted(entry_points(group=group), key=lambda entry: entry.name)}


def load(group: str, name: str) -> Any:
    """Import what has a name in a group; raises CpbenchError where no installed package has it."""
    entry = added(group).get(name)
    if entry is None:
        from cpbench.errors import CpbenchError

        raise CpbenchError(f"'{name}' is in no installed package (entry points {group}): install cpbench again")
    return entry.load()


def commands(group: str = "") -> dict[str, EntryPoint]:
    """Return the added commands of a group of commands by name, or those that are in none."""
    parts = {name: name.rpartition(".") for name in added(COMMANDS)}
    return {name: added(COMMANDS)[whole] for whole, (of, _, name) in parts.items() if of == group}


def function(name: str) -> Any:
    """Return the function of this name (``cpbench.functions``); raises CpbenchError where no package has it."""
    return load(FUNCTIONS, name)


def hook(name: str) -> Any:
    """Return the function of this name (``cpbench.hooks``); raises CpbenchError where no package has it."""
    return load(HOOKS, name)


def summary(module: str) -> str:
    """Return the first paragraph of a module's docstring, '' where there is none; neither the module nor a package
    above it is imported."""
    import ast
    from importlib.util import find_spec
    from pathlib import Path

    package, *inner = module.split(".")
    spec = find_spec(package)  # that of a module within would import its package
    above = [] if spec is None else [Path(folder, *inner) for folder in spec.submodule_search_locations or ()]
    files = [file for path in above for file in (path.with_suffix(".py"), path / "__init__.py")]
    if spec is not None and spec.origin is not None and not inner:
        files = [Path(spec.origin)]
    text = next((file.read_text("utf-8") for file in files if file.is_file()), "")
    return " ".join((ast.get_docstring(ast.parse(text)) or "").split("\n\n")[0].split())
