"""Compiles packages of kernels into libraries: `python -m cpbench.foundation.kernel_build`, and what the build calls.

Numba's compiler of modules (`numba.pycc`) makes extension modules of a package, which need neither Numba nor LLVM when
they run; a C compiler links them. The build runs this file as a script where nothing of cpbench is installed: the
packages above the kernels are stood in for by empty ones, since kernels take nothing from them.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import os
import pkgutil
import re
import subprocess
import sys
import tempfile
import types
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
MODELS = {"v2": "x86-64-v2", "v3": "x86-64-v3", "generic": ""}
"""Processors as LLVM names them, by level of instructions."""
LARGE = 100_000
"""Bytes of source from which on a package is compiled into two libraries, side by side."""


@dataclass
class Compiler:
    """The kernels of a library, as `cpbench.foundation.kernels` hands them over when their modules are imported.

    Attributes
    ----------
    modules : those whose kernels it has; others are helpers. exported : name, function and signature of each kernel.
    """

    modules: Sequence[str]
    exported: list[tuple[str, Any, str]] = field(default_factory=list)

    def kernel(self, function: Any, signatures: Sequence[Any], fast: frozenset[str]) -> Any:
        """Note a kernel for the library, and return what other kernels call."""
        from cpbench.foundation.kernels import symbol

        compiled = self.helper(function, signatures, fast, inline=False)
        module = function.__module__.rpartition(".")[2]
        if module in self.modules:
            for number, signature in enumerate(signatures):
                self.exported.append((symbol(module, function.__name__, number), compiled, signature.text))
        return compiled

    def helper(self, function: Any, signatures: Sequence[Any], fast: frozenset[str], *, inline: bool) -> Any:
        """Return what other kernels call."""
        from numba import njit

        options: dict[str, Any] = {"error_model": "numpy", "fastmath": set(fast)}
        options |= {"inline": "always" if inline else "never", "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return njit([signature.text for signature in signatures] or None, **options)(function)


def compile_library(package: str, level: str, number: int) -> None:
    """Compile a library of a package, and put it beside the kernels."""
    gc.disable()  # a compiler makes many objects and hardly any garbage
    _stand_in(package)
    from cpbench.foundation import kernels

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pycc is to be replaced some day: pyproject.toml bounds Numba's version
        from numba.pycc.cc import CC
    library = CC(f"{kernels.LIBRARY}_{level}_{number}", package)
    library.output_dir, library.target_cpu = str(folder_of(package)), MODELS[level]
    library._extra_ldflags = {"linux": ["-s"]}  # names that only a debugger reads are a third
    with tempfile.TemporaryDirectory() as folder:
        parts = library._compile_mixins(folder)  # fails at once without a C compiler or Python's headers
        library._compile_mixins = lambda _: parts  # type: ignore[method-assign]
        _optimise_once()
        compiler = kernels.compiler = Compiler(_divided(package)[number])
        for module in compiler.modules:
            importlib.import_module(f"{package}.{module}")
        for name, compiled, signature in compiler.exported:
            library.export(name, signature)(_calling(compiled))
        library.compile()


def _calling(compiled: Any) -> Any:
    """Return a function that calls a kernel: pycc compiles what it exports without the freedoms of the kernel."""
    names = ", ".join(compiled.py_func.__code__.co_varnames[: compiled.py_func.__code__.co_argcount])
    return eval(f"lambda {names}: compiled({names})", {"compiled": compiled})


def _optimise_once() -> None:
    """Have the code of a library optimised once, as a whole, and nothing be made ready to run here.

    Numba does both for every function by itself, and again in each that calls it: ten times the work.
    """
    from numba.core import codegen, cpu
    from numba.core.compiler import Flags
    from numba.pycc import compiler

    def optimise(library: Any) -> None:
        if isinstance(library, codegen.AOTCodeLibrary):
            whole(library)

    def without_lock() -> Any:
        flags: Any = Flags()
        flags.release_gil = True
        return flags

    whole = codegen.CPUCodeLibrary._optimize_final_module
    codegen.CPUCodeLibrary._optimize_final_module = optimise  # type: ignore[method-assign]
    codegen.JITCodeLibrary._finalize_specific = lambda _: None  # type: ignore[method-assign]  # no machine code here
    # Numba wants some builtin function for each, a different one
    cpu.CPUContext.get_executable = lambda *_: [].append  # type: ignore[method-assign]
    compiler.Flags = without_lock  # type: ignore[attr-defined]


def build(packages: Sequence[str], levels: Sequence[str]) -> list[str]:
    """Compile the libraries that are not there or not current, one a core; return the errors."""
    from cpbench.foundation import kernels

    stale = [
        (package, level)
        for level in levels
        for package in packages
        if not kernels.is_current(folder_of(package), level)
    ]
    tasks = [(package, level, number) for package, level in stale for number in range(len(_divided(package)))]
    tasks.reverse()  # the largest of `PACKAGES` is the last
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    running: list[tuple[str, subprocess.Popen[str]]] = []
    errors: list[str] = []
    for package, level, number in tasks:
        if len(running) >= (os.cpu_count() or 1):
            errors += _ended(*running.pop(0))
        print(f"compiling {package} ({level})", file=sys.stderr, flush=True)
        command = [sys.executable, __file__, "--library", package, level, str(number)]
        running.append((package, subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)))
    for package, process in running:
        errors += _ended(package, process)
    for package, level in stale if not errors else []:
        folder = folder_of(package)
        folder.joinpath(f"{kernels.LIBRARY}_{level}.sha256").write_text(kernels.state(folder))
    return errors


def _ended(package: str, process: subprocess.Popen[str]) -> list[str]:
    _, text = process.communicate()
    return [f"{package}: {text.strip()}"] if process.returncode else []


def present() -> list[str]:
    """Return the packages of kernels that came with cpbench: the core does without `cpbench_solvers`."""
    from cpbench.foundation import kernels

    return [package for package in kernels.PACKAGES if ROOT.joinpath(*package.split(".")).is_dir()]


def folder_of(package: str) -> Path:
    """Return where a package lies, and import nothing. Raises ModuleNotFoundError."""
    for path in (ROOT, *sys.path):
        folder = Path(path, *package.split("."))
        if folder.is_dir():
            return folder
    raise ModuleNotFoundError(f"no package {package}", name=package)


def _source(package: str, module: str) -> Path:
    return folder_of(package) / f"{module}.py"


def _divided(package: str) -> list[list[str]]:
    """Return the modules whose kernels each library of a package has.

    What a kernel calls is compiled in its library: a module goes where it adds the least to the longer of the two.
    """
    folder = str(folder_of(package))
    modules = [module.name for module in pkgutil.iter_modules([folder]) if not module.name.startswith("_")]
    needs = {module: _needed(package, module) for module in modules}
    bytes_of = {module: _source(package, module).stat().st_size for module in modules}
    if sum(bytes_of.values()) < LARGE:
        return [modules]

    def size(compiled: set[str]) -> int:
        return sum(bytes_of.get(module, 0) for module in compiled)

    libraries: tuple[list[str], list[str]] = ([], [])
    compiled: list[set[str]] = [set(), set()]
    for module in sorted(modules, key=lambda module: -size(needs[module])):
        longer = [max(size(compiled[k] | needs[module]), size(compiled[1 - k])) for k in (0, 1)]
        added = [size(needs[module] - compiled[k]) for k in (0, 1)]
        k = min((0, 1), key=lambda k: (longer[k], added[k]))
        libraries[k].append(module)
        compiled[k] |= needs[module]
    return list(libraries)


def _needed(package: str, module: str) -> set[str]:
    """Return the modules of a package that one imports, with itself and what those import."""
    needed, open_ = set(), [module]
    while open_:
        name = open_.pop()
        if name not in needed and _source(package, name).is_file():
            needed.add(name)
            open_ += re.findall(rf"^from {re.escape(package)}\.(\w+) import", _source(package, name).read_text(), re.M)
    return needed


def _stand_in(package: str) -> None:
    """Make the packages above modules of kernels importable without what they import."""
    sys.path.insert(0, str(ROOT))
    for name in (package, "cpbench.foundation"):
        above = name.split(".")
        for depth in range(1, len(above) + 1):
            part = ".".join(above[:depth])
            if part not in sys.modules:
                module = types.ModuleType(part)
                module.__path__ = [str(folder_of(part))]
                sys.modules[part] = module


def main() -> int:
    """Compile what has changed, or one library, and return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("packages", nargs="*", help="packages of kernels (default: those of cpbench)")
    parser.add_argument("--level", action="append", choices=MODELS, help="instructions (default: this processor's)")
    parser.add_argument("--library", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.library:
        package, level, number = arguments.library
        compile_library(package, level, int(number))
        return 0
    _stand_in("cpbench.foundation")
    from cpbench.foundation import kernels

    errors = build(arguments.packages or present(), arguments.level or [kernels.level()])
    for line in errors:
        print(line, file=sys.stderr)
    return 2 if errors else 0


if __name__ == "__main__":
    if Path(sys.path[0]) == Path(__file__).parent:  # as a script: its neighbours are not to be found by short names
        sys.path.pop(0)
    sys.exit(main())
