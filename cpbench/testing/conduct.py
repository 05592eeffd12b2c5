"""One check of one plugin, and the mark it earns; what a plugin file registers.

A plugin that is being checked may do anything: code of others is called in a separate process
(`cpbench check` does).
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest import SkipTest

from cpbench.conversions.base import conversions, make
from cpbench.errors import DuplicateName, FormatError, UnknownName, described
from cpbench.formulations import formulations
from cpbench.generators import generators
from cpbench.registry import Registry, load_plugin
from cpbench.solvers.base import solvers
from cpbench.solvers.external.declared import declare_file
from cpbench.storage import formats
from cpbench.testing import Case, cases, checks, only_for

REGISTRIES: dict[str, Registry[Any]] = {
    "formulation": formulations,
    "conversion": conversions,
    "solver": solvers,
    "format": formats,
    "problem": generators,
}
"""Kind of plugin -> where it is registered."""
WORDS = 400
"""Characters of a reason."""


@dataclass(frozen=True)
class Item:
    """Something registered: its kind, its name, and the formulations it is for."""

    kind: str
    name: str
    nodes: tuple[str, ...]

    @property
    def plugin(self) -> Any:
        """Object that its checks get; raises UnknownName."""
        return make(self.name) if self.kind == "conversion" else REGISTRIES[self.kind].get(self.name)

    @property
    def tested_on(self) -> tuple[str, ...]:
        """Nodes whose planted cases its checks get; a collection brings its own problems."""
        if self.kind == "problem":
            return ()
        return self.nodes if self.kind == "format" else self.nodes[:1]

    @property
    def checks(self) -> list[str]:
        return list(checks(self.kind))


@dataclass(frozen=True)
class Mark:
    """Result of a check: `passed`, `failed`, `does not apply`, or `known failure` (in the spec, with its reason)."""

    word: str
    reason: str = ""


def named(name: str) -> list[Item]:
    """Return everything registered under a name; raises UnknownName."""
    result = [_item(kind, name) for kind, registry in REGISTRIES.items() if name in registry]
    if not result:
        raise UnknownName("plugin", name, {n for registry in REGISTRIES.values() for n in registry.names()})
    return result


def registered_by(path: Path) -> list[Item]:
    """Load a plugin file; what it adds to the registries.

    Raises FormatError when it fails or adds nothing, DuplicateName when it takes the name of something else.
    """
    before = {kind: {name: registry.get(name) for name in registry.names()} for kind, registry in REGISTRIES.items()}
    (declare_file if path.suffix == ".toml" else load_plugin)(path)
    result: list[Item] = []
    for kind, registry in REGISTRIES.items():
        for name in registry.names():
            if name not in before[kind]:
                result.append(_item(kind, name))
            elif registry.get(name) is not before[kind][name]:
                raise DuplicateName(f"{path}: the {kind} '{name}' exists already: rename one")
    if not result:
        raise FormatError(path, "", f"registers nothing; expected a {', '.join(REGISTRIES)}")
    return result


def _item(kind: str, name: str) -> Item:
    plugin: Any = REGISTRIES[kind].get(name)
    nodes = {
        "formulation": lambda: (name,),
        "conversion": lambda: (plugin.source, plugin.target),
        "solver": lambda: (plugin.spec.node,),
        "format": lambda: tuple(sorted(plugin.writes)),
        "problem": lambda: (plugin.node,),
    }[kind]()
    return Item(kind, name, nodes)


def conduct(item: Item, check: str) -> Mark:
    """Run one check. An exception that is not an AssertionError is a failure, too, and says where it was raised."""
    plugin, run = item.plugin, checks(item.kind)[check]
    excuse: str | None = plugin.spec.known_failures.get(check) if item.kind == "solver" else None
    try:
        only_for(item.kind != "format" or bool(item.nodes), "formats that write")
        for some in [planted(node) for node in item.tested_on] or [[]]:
            run(plugin, some)
    except SkipTest as why:
        return Mark("does not apply", _line(str(why).removeprefix("does not apply: ")))
    except AssertionError as why:
        if excuse is not None:
            return Mark("known failure", _line(excuse))
        return Mark("failed", _line(str(why) or "an assertion of the check does not hold"))
    except Exception as why:
        return Mark("failed", _line(described(why)))
    if excuse is not None:
        return Mark("failed", f"passes, and known_failures says that it fails: take {check} out of it")
    return Mark("passed")


def planted(node: str) -> list[Case]:
    """Return cases of a node for one check: copies, so that a plugin that spoils them spoils its own alone.

    Raises AssertionError without any.
    """
    known = cases(node)
    assert known, f"no problem of '{node}' with a known solution: register a collection of them (cpbench new problem)"
    return [dataclasses.replace(case, problem=dataclasses.replace(case.problem)) for case in known]


def _line(text: str) -> str:
    one = " ".join(text.split())
    return one if len(one) <= WORDS else f"{one[: WORDS - 3]}..."
