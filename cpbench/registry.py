"""One registry class for everything that can be plugged in.

A plugin registers itself when its module is imported. The modules of cpbench's own rooms are imported on
first use (`pkgutil`), all of them where names are listed, and only those in which a name stands where one item is
asked for. Those of other packages through the entry-point group ``cpbench.plugins``, and single
files through the environment variable ``CPBENCH_PLUGINS`` (paths, separated as in PATH). An import error is
never swallowed: a plugin that is broken says so. A file of tables (.toml) declares solvers that are not Python, and
``CPBENCH_SOLVERS`` has the tables that the process which started this one read.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import pkgutil
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Generic, TypeVar, cast

from cpbench.errors import CpbenchError, DuplicateName, FormatError, UnknownName

T = TypeVar("T")
U = TypeVar("U")

logger = logging.getLogger("cpbench.registry")

PLUGIN_GROUP = "cpbench.plugins"
PLUGIN_FILES = "CPBENCH_PLUGINS"
DECLARED = "CPBENCH_SOLVERS"
PLUGIN_MODULE = "cpbench_plugin_"
"""Prefix of the names of modules that were imported from a plugin's file."""
TABLES = ".toml"
"""Suffix of plugin files that are tables."""
_READER = "cpbench.solvers.external.declared"
"""The module that makes solvers of tables, imported where there are any."""
_included: dict[str, list[str]] = {}
"""Packages that plugins have added to registries, by the kind of what is registered."""
_environment: tuple[str, str] | None = None
"""`CPBENCH_PLUGINS` and `CPBENCH_SOLVERS` as they were when plugins were last loaded."""
_read: set[Path] = set()
"""Files that were loaded."""


def load_plugins() -> None:
    """Import every module named under ``cpbench.plugins`` and every file in ``CPBENCH_PLUGINS``, once.

    Tables are read last: they may declare variants of what is in the files. What the variables name later is loaded
    when this is called again.
    """
    global _environment
    environment = os.environ.get(PLUGIN_FILES, ""), os.environ.get(DECLARED, "")
    if environment == _environment:
        return
    first, _environment = _environment is None, environment
    if first:
        from importlib.metadata import entry_points  # a third of the start-up of `cpbench --help`

        for entry in entry_points(group=PLUGIN_GROUP):
            entry.load()
    files = [path for path in map(Path, filter(None, environment[0].split(os.pathsep))) if path not in _read]
    _read.update(files)
    for path in files:
        if path.suffix != TABLES:
            load_plugin(path)
    tables = [path for path in files if path.suffix == TABLES]
    if tables or environment[1]:
        declared = importlib.import_module(_READER)
        for path in tables:
            declared.declare_file(path)
        declared.declare_environment()


def load_plugin(path: Path) -> None:
    """Import a Python file, so that it registers what is in it.

    Raises FormatError with the line and the exception when that fails, DuplicateName.
    """
    spec = importlib.util.spec_from_file_location(f"{PLUGIN_MODULE}{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise FormatError(path, "", "is no plugin: expected a .py or .toml" if path.exists() else "no such file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except CpbenchError:
        raise
    except (Exception, SystemExit) as cause:
        lines = [frame.lineno for frame in traceback.extract_tb(cause.__traceback__) if frame.filename == str(path)]
        where = lines[-1] if lines else getattr(cause, "lineno", None)
        reason = " ".join(str(cause).split()) or "no message"
        raise FormatError(path, f"line {where}" if where else "", f"{type(cause).__name__}: {reason}") from cause


def include(kind: str, *packages: str) -> None:
    """Have the registry of a kind ("format") import the modules of these packages, too, on first use.

    A plugin calls it where the module of the registry would take long to import; `Registry.include` does the same.
    """
    listed = _included.setdefault(kind, [])
    listed += [package for package in packages if package not in listed]


class Registry(Generic[T]):
    """Named plugins of one kind, in name order whatever the order of registration.

    Parameters
    ----------
    kind : what an item is called in messages ("solver").
    packages : packages whose modules are imported on first use.
    """

    def __init__(self, kind: str, *packages: str) -> None:
        self.kind = kind
        self._packages = packages
        self._items: dict[str, T] = {}
        self._imported: set[str] = set()

    def add(self, name: str, item: T) -> T:
        """Register `item`; raises DuplicateName when `name` is taken by another one."""
        known = self._items.get(name)
        if known is not None and _home(known) != _home(item):
            raise DuplicateName(
                f"{self.kind} '{name}' is defined twice, in {_home(known)} and in {_home(item)}: rename one"
            )
        self._items[name] = item
        return item

    def register(self, name: str) -> Callable[[U], U]:
        """Return a decorator that adds what it decorates (:meth:`add`) and keeps its type."""

        def keep(item: U) -> U:
            self.add(name, cast(T, item))
            return item

        return keep

    def include(self, *packages: str) -> None:
        """Import the modules of these packages, too, on first use: a plugin with many modules calls it."""
        self._packages += tuple(package for package in packages if package not in self._packages)

    def discover(self) -> None:
        """Import the registry's packages, each once, and plugins that were not loaded yet."""
        load_plugins()  # first: they may have packages of their own
        for package in self._waiting():
            self._imported.add(package)
            module = importlib.import_module(package)
            for info in pkgutil.iter_modules(module.__path__, f"{package}."):
                importlib.import_module(info.name)

    def _waiting(self) -> list[str]:
        """Return the packages whose modules were not imported yet."""
        return [name for name in (*self._packages, *_included.get(self.kind, ())) if name not in self._imported]

    def get(self, name: str) -> T:
        """Return the item called `name`; raises UnknownName with the nearest names."""
        if name in self._items:  # plugins can add no other one of this name
            return self._items[name]
        load_plugins()
        if name not in self._items:
            self._seek(name)
        if name not in self._items:
            self.discover()
        try:
            return self._items[name]
        except KeyError:
            raise UnknownName(self.kind, name, self._items) from None

    def knows(self, name: str) -> bool:
        """Return whether an item has this name; imports plugins, and only those modules in which the name stands."""
        load_plugins()
        if name not in self._items:
            self._seek(name)
        return name in self._items

    def _seek(self, name: str) -> None:
        """Import the modules in which `name` stands as a string, or in their tables, until one registers it.

        One solver is asked for more often than all: to import every module takes longer than most problems.
        """
        quoted, likely = f'"{name}"', name.replace("-", "_")
        for package in self._waiting():
            module_spec = importlib.util.find_spec(package)
            folders = list(module_spec.submodule_search_locations or ()) if module_spec else []
            files = [file for folder in folders for file in Path(folder).glob("*.py")]
            for file in sorted(files, key=lambda file: (not likely.startswith(file.stem), file.stem)):
                texts = [path for path in (file, file.with_suffix(TABLES)) if path.exists()]
                if any(quoted in path.read_text("utf-8") for path in texts):
                    importlib.import_module(f"{package}.{file.stem}")
                    if name in self._items:
                        return

    def names(self) -> list[str]:
        """Return all names, sorted."""
        self.discover()
        return sorted(self._items)

    def __iter__(self) -> Iterator[T]:
        return (self._items[name] for name in self.names())

    def __contains__(self, name: str) -> bool:
        self.discover()
        return name in self._items

    def __len__(self) -> int:
        return len(self.names())


class NodeTable(Mapping[str, T], Generic[T]):
    """Table of what one package knows of formulations, by node. A plugin enters its own formulation in the same way.

    Parameters
    ----------
    entry : what an entry is, for messages.
    """

    def __init__(self, entry: str) -> None:
        self.entry = entry
        self._entries: dict[str, T] = {}

    def enter(self, entry: T, *nodes: str) -> T:
        """Enter `entry` for some nodes; raises DuplicateName where one of them has another entry."""
        for node in nodes:
            if self._entries.setdefault(node, entry) is not entry:
                raise DuplicateName(f"{self.entry} of '{node}' is defined twice: remove one")
        return entry

    def of(self, *nodes: str) -> Callable[[T], T]:
        """Return a decorator that enters what it decorates for some nodes; raises DuplicateName as `enter` does."""
        return lambda entry: self.enter(entry, *nodes)

    def __getitem__(self, node: str) -> T:
        return self._entries[node]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)


def _home(item: object) -> str:
    owner = item if isinstance(item, type) or callable(item) else type(item)
    return f"{getattr(owner, '__module__', '?')}.{getattr(owner, '__qualname__', '?')}"
