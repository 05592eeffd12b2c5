"""Where compiled kernels are kept, and how several processes share them.

Kernels live in packages called `kernels`, of cpbench and of plugins, and numba writes its cache beside
the source. Where that is not writable (a system-wide installation, a read-only image) the user's cache directory is
taken. One process compiles a module: the others wait and then read what it wrote, instead of compiling the same code
and racing for the index. Different modules are compiled side by side.
"""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import pkgutil
import re
import sys
import tempfile
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from cpbench.foundation import locks
from cpbench.foundation.imports import uncollected

VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGE = Path(__file__).resolve().parents[1]
_PACKAGES = ["cpbench.formulations.expressions.kernels", "cpbench.conversions.kernels"]
"""Packages of kernel modules; plugins add theirs."""
_TAKEN = re.compile(r"^from ([\w.]+\.kernels\.\w+) import", re.MULTILINE)
"""How a kernel module takes functions from another one."""


@cache
def ensure_cache_dir() -> Path:
    """Return the directory of the compiled kernels; sets ``NUMBA_CACHE_DIR`` unless the default place is writable.

    Called before numba is imported. A setting of the user is left alone where it can be written. Where neither the
    package's nor the user's cache directory can be written, a private temporary one serves this process and its
    children.
    """
    given = os.environ.get(VARIABLE, "")
    if given and _writable(Path(given)):
        return Path(given)
    chosen, setting = _PACKAGE / "__pycache__", ""
    if not _writable(chosen):
        import platformdirs

        chosen = Path(platformdirs.user_cache_dir("cpbench", appauthor=False)) / "numba"
        if not _writable(chosen):
            # mkdtemp, not a fixed name: a cache is code, and no other user may be able to put it there
            chosen = Path(tempfile.mkdtemp(prefix="cpbench-numba-"))
        setting = str(chosen)
    if setting != given:
        os.environ[VARIABLE] = setting  # empty, not absent: processes get our variables, and keep those that we lack
        if (numba := sys.modules.get("numba")) is not None:  # it has read the environment already
            numba.config.reload_config()
    return chosen


def load(module: str) -> ModuleType:
    """Load the kernel module of that full name, compiled on the first call on this machine, then read from the
    cache."""
    if _is_loaded(module):
        return sys.modules[module]
    with _around[-1]():
        return _load(module)


def load_within(context: Callable[[], AbstractContextManager[None]]) -> None:
    """Have modules loaded within such a context from here on, in which what loads them counts the time."""
    _around.append(context)


_around: list[Callable[[], AbstractContextManager[None]]] = [contextlib.nullcontext]


def _load(module: str) -> ModuleType:
    directory = ensure_cache_dir()
    with uncollected():
        importlib.import_module("numba")  # slow, and needs no lock
    _listen()
    for taken in _taken(module):  # before its own lock: no process holds one and waits for another
        load(taken)
    with _one_at_a_time(directory / f"{module}.lock"):
        _drop_stale(module, directory)
        return importlib.import_module(module)


def load_all(package: str, names: Sequence[str]) -> None:
    """Load kernel modules of `package`."""
    for name in names:
        load(f"{package}.{name}")


@contextlib.contextmanager
def compiling_reported(report: Callable[[], object]) -> Generator[None]:
    """Call `report`, once, when numba compiles within this context: that takes seconds."""
    _reports.append(report)
    try:
        yield
    finally:
        with contextlib.suppress(ValueError):  # it was called
            _reports.remove(report)


_reports: list[Callable[[], object]] = []


@cache
def _listen() -> None:
    """Have numba say when it compiles what its cache has not."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            while _reports:
                _reports.pop()()

        def on_end(self, event: Any) -> None:
            pass

    event.register("numba:compile", Listener())


@cache
def compiled(kernel: Any) -> Callable[..., Any]:
    """Return the compiled code of a kernel of one explicit signature, without numba's search by the arguments'
    types, which takes longer than a small problem. Raises TypeError on arguments of other types; that an array is
    read-only makes no difference."""
    (version,) = kernel.overloads.values()
    return version.entry_point


def include(package: str) -> None:
    """Add a package of kernel modules to those that `modules` lists."""
    if package not in _PACKAGES:
        _PACKAGES.append(package)


def modules(*packages: str) -> list[str]:
    """Return full names of the kernel modules in these packages, in all that are known where none is named."""
    return [
        f"{package}.{info.name}"
        for package in packages or _PACKAGES
        for info in pkgutil.iter_modules(importlib.import_module(package).__path__)
        if not info.name.startswith("_")
    ]


def _is_loaded(module: str) -> bool:
    """Return whether it was loaded to its end: what another thread is reading is among the modules already."""
    found = sys.modules.get(module)
    # the flag by which the import statement itself knows
    return found is not None and not getattr(found.__spec__, "_initializing", False)


def _drop_stale(module: str, directory: Path) -> None:
    """Remove what was compiled of `module` when it, or a kernel module from which it takes functions, is not what it
    was.

    numba looks at the module's own file only: without this, code compiled from an older one would go on running. And it
    reads the index of what was compiled before it looks, which fails where a class in a signature has another name now.
    """
    taken = [file(name) for name in (module, *_taken(module))]
    now = "\n".join(f"{path.name} {path.stat().st_mtime_ns} {path.stat().st_size}" for path in taken)
    stamp = directory / f"{module}.taken"
    with contextlib.suppress(OSError):  # a cache that cannot be written is not ours to mend
        if not stamp.is_file() or stamp.read_text() != now:
            for folder in {taken[0].parent / "__pycache__", directory}:
                for index in folder.rglob(f"{taken[0].stem}.*.nbi"):
                    index.unlink()
            stamp.write_text(now)


def file(module: str) -> Path:
    """Return the source of a kernel module, of which nothing is imported but the packages above it; raises
    ModuleNotFoundError."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModuleNotFoundError(f"no module {module}", name=module)
    return Path(spec.origin)


def _taken(module: str) -> list[str]:
    """Return the kernel modules that one takes functions from, directly or through others."""
    names = [module]
    for name in names:
        names += [other for other in _TAKEN.findall(file(name).read_text("utf-8")) if other not in names]
    return names[1:]


def _writable(directory: Path) -> bool:
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


@contextlib.contextmanager
def _one_at_a_time(path: Path) -> Generator[None]:
    """Hold the lock file while compiling; the system frees it when the holder dies.

    Without lock files (a file system that refuses) numba's own atomic renames have to do.
    """
    try:
        handle = path.open("w")
    except OSError:
        yield
        return
    with handle:
        with contextlib.suppress(OSError):
            locks.exclusive(handle.fileno(), wait=True)
        yield
