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
import logging
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

LOG = logging.getLogger(__name__)
"""Hears of every module that has to be compiled, before it is."""
VARIABLE = "NUMBA_CACHE_DIR"
_PACKAGE = Path(__file__).resolve().parents[1]
_PACKAGES = ["cpbench.formulations.expressions.kernels", "cpbench.conversions.kernels"]
"""Packages of kernel modules; plugins add theirs."""
_TAKEN = re.compile(r"^from ([\w.]+\.kernels\.\w+) import", re.MULTILINE)
"""How a kernel module takes functions from another one."""
_KEPT = re.compile(r"^@njit\([\s\S]*?(cache=True|\*\*(COMPILED|KEPT|QUICK))", re.MULTILINE)
"""Decorator of a kernel that is in the cache; others are compiled where they are used."""


@cache
def ensure_cache_dir() -> Path:
    """Return the directory of the compiled kernels; sets ``NUMBA_CACHE_DIR`` unless the default place is writable.

    Called before numba is imported. A setting of the user is left alone where it can be written. Where neither the
    package's nor the user's cache directory can be written, a private temporary one serves this process and its
    children.
    """
    given = os.environ.get(VARIABLE)
    if given and _writable(Path(given)):
        return Path(given)
    beside = _PACKAGE / "__pycache__"
    if _writable(beside):
        if given:  # empty, not absent: processes get variables from this one, and keep those that it lacks
            _set_numba_dir("")
        return beside
    import platformdirs

    chosen = Path(platformdirs.user_cache_dir("cpbench", appauthor=False)) / "numba"
    if not _writable(chosen):
        # mkdtemp, not a fixed name: a cache is code, and no other user may be able to put it there
        chosen = Path(tempfile.mkdtemp(prefix="cpbench-numba-"))
    _set_numba_dir(str(chosen))
    return chosen


def _set_numba_dir(folder: str) -> None:
    os.environ[VARIABLE] = folder
    numba = sys.modules.get("numba")
    if numba is not None:  # imported by somebody else before us: it has read the environment already
        numba.config.reload_config()


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
    for taken, _ in _taken(module):  # before its own lock: no process holds one and waits for another
        if is_kept(taken):
            load(taken)
    with _one_at_a_time(directory / f"{module}.lock"):
        _drop_stale(module, directory)
        if not is_compiled(module) and is_kept(module):
            LOG.info("compiling %s", module)
        return importlib.import_module(module)


def load_all(package: str, names: Sequence[str]) -> None:
    """Load kernel modules of `package`."""
    for name in names:
        load(f"{package}.{name}")


@contextlib.contextmanager
def compiling_reported(report: Callable[[], object]) -> Generator[None]:
    """Call `report`, once, when a kernel has to be compiled within this context: that takes seconds."""
    reported: list[str] = []

    def seen(record: logging.LogRecord) -> bool:
        if not reported:
            report()
        reported.append(record.getMessage())
        return True

    LOG.setLevel(logging.INFO)
    LOG.addFilter(seen)
    try:
        yield
    finally:
        LOG.removeFilter(seen)


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
        for info in pkgutil.iter_modules([str(_folder(package))])
        if not info.name.startswith("_")
    ]


def is_kept(module: str) -> bool:
    """Return whether the cache has kernels of a module."""
    return _KEPT.search(_file(module).read_text("utf-8")) is not None


def is_compiled(module: str) -> bool:
    """Return whether the cache has kernels of this module that are younger than its source."""
    source, directory = _file(module), ensure_cache_dir()
    if os.environ.get(VARIABLE):  # then what lies beside the source is not looked at
        files = directory.rglob(f"{source.stem}.*.nbi")
    else:
        files = (source.parent / "__pycache__").glob(f"{source.stem}.*.nbi")
    changed = source.stat().st_mtime
    return any(index.stat().st_mtime >= changed for index in files)


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
    taken = [_file(module), *(path for _, path in _taken(module))]
    now = "\n".join(f"{path.name} {path.stat().st_mtime_ns} {path.stat().st_size}" for path in taken)
    stamp = directory / f"{module}.taken"
    with contextlib.suppress(OSError):  # a cache that cannot be written is not ours to mend
        if not stamp.is_file() or stamp.read_text() != now:
            own = _file(module)
            for place in {own.parent / "__pycache__", directory}:
                for index in place.rglob(f"{own.stem}.*.nbi"):
                    index.unlink()
            stamp.write_text(now)


def _file(module: str) -> Path:
    package, _, name = module.rpartition(".")
    return _folder(package) / f"{name}.py"


@cache
def _folder(package: str) -> Path:
    """Return where a package lies; nothing of it is imported but the packages above it."""
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise ModuleNotFoundError(f"no package {package}", name=package)
    return Path(next(iter(spec.submodule_search_locations)))


def _taken(module: str) -> list[tuple[str, Path]]:
    """Return the kernel modules that one takes functions from, directly or through others, and their files."""
    found: list[tuple[str, Path]] = []
    names = [module]
    for name in names:
        path = _file(name)
        found.append((name, path))
        names += [other for other in _TAKEN.findall(path.read_text("utf-8")) if other not in names]
    return found[1:]


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
