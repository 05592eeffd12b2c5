"""Kernels: loops over numbers that are compiled when the package is built, and are Python where they were not.

A kernel is a function of a package `kernels` in the part of Python that Numba knows, with the types of its arguments:

    @kernel(float64(DATA, DATA))
    def product(x, y): ...

`hatch_build.py` has Numba compile the kernels of such a package into a library beside them (`kernel_build`), which
`import` then takes the compiled functions from: neither Numba nor LLVM is needed to run it, and nothing is compiled
while somebody waits. Without that library - no C compiler where cpbench was installed - the functions run as the Python
that they are, a hundred times slower or more, and `cpbench doctor` says so.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import os
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

PACKAGES = ("cpbench.formulations.expressions.kernels", "cpbench.conversions.kernels", "cpbench_solvers.kernels")
"""Packages of kernels that come with cpbench."""
LIBRARY = "_compiled"
"""Name of the library in a package of kernels; after it stands the level of instructions."""
CHECKED = "CPBENCH_CHECKED_KERNELS"
"""Variable that has all arguments of kernels looked at: compiled code takes any array for one of its types."""
FAST = frozenset({"reassoc", "contract", "arcp", "nsz"})
"""Freedoms of the compiler where sums may be made in any order: NaN and infinity keep their meaning."""


@dataclass(frozen=True)
class Type:
    """A type in a signature: `float64`, `float64[::1]`, `tuple_of(int64, float64)`, `float64(int64, int64)`.

    Attributes
    ----------
    text : as Numba writes it. numbers : those of an array, as NumPy calls them. dimensions : how many an array has.
    written, by_rows : whether a kernel writes the array, and wants it contiguous by rows. parts : types of the members
    of a tuple, or of the arguments of a signature.
    """

    text: str
    numbers: str = ""
    dimensions: int = 0
    written: bool = False
    by_rows: bool = True
    parts: tuple[Type, ...] = ()

    def __call__(self, *arguments: Type) -> Type:
        return Type(f"{self.text}({', '.join(one.text for one in arguments)})", parts=arguments)

    def __getitem__(self, dimensions: Any) -> Type:
        """Return an array that is written, contiguous by rows: `float64[::1]`, `float64[:, ::1]`."""
        count = len(dimensions) if isinstance(dimensions, tuple) else 1
        text = f"{self.text}[{', '.join([':'] * (count - 1) + ['::1'])}]"
        return Type(text, _numbers(self), count, written=True)

    def takes(self, value: Any) -> bool:
        """Return whether a value is of this type, or may become it where it is no array."""
        if self.dimensions:
            return (
                isinstance(value, np.ndarray)
                and value.dtype == self.numbers
                and value.ndim == self.dimensions
                and (value.flags.c_contiguous or not self.by_rows)
                and (value.flags.writeable or not self.written)
            )
        if self.parts:
            return len(value) == len(self.parts) and all(map(Type.takes, self.parts, value))
        return not isinstance(value, np.ndarray)


def _numbers(kind: Type) -> str:
    return "bool" if kind.text == "boolean" else kind.text


boolean, void = Type("boolean"), Type("void")
int32, int64, uint32, uint64, float64 = map(Type, ("int32", "int64", "uint32", "uint64", "float64"))


def read_only(kind: Type, dimensions: int = 1, *, by_rows: bool = True) -> Type:
    """Return the type of an array that is only read, contiguous by rows unless any order will do."""
    text = f"Array({kind.text}, {dimensions}, '{'C' if by_rows else 'A'}', True)"
    return Type(text, _numbers(kind), dimensions, by_rows=by_rows)


def tuple_of(*kinds: Type) -> Type:
    """Return the type of a tuple."""
    return Type(f"Tuple(({', '.join(one.text for one in kinds)},))", parts=kinds)


DATA, DATA_2D, DATA_3D = (read_only(float64, dimensions) for dimensions in (1, 2, 3))
INDEX, START, COLUMN = read_only(int64), read_only(uint64), read_only(uint32)
"""Arrays that a kernel only reads; START and COLUMN are those of block-CSR."""
VECTOR, MATRIX = float64[::1], float64[:, ::1]
"""Arrays that it writes."""

not_compiled: list[str] = []
"""Kernels that this process runs as Python, as `module.function`."""
compiler: Any = None
"""Compiler that kernels are handed to while a library is built (`kernel_build`), instead of being looked up."""


def kernel(*signatures: Type, fast: frozenset[str] = frozenset()) -> Callable[[Any], Any]:
    """Have a function compiled for these types of arguments: a decorator.

    fast : freedoms of the compiler, see `FAST`. With several signatures the first that takes the arguments is called.
    A division by 0 is ±∞ or NaN, and other threads go on meanwhile. An array of another type is not noticed, and read
    as if it were of the right one: the tests look at all arguments (`CHECKED`).
    """

    def found(function: Any) -> Any:
        if compiler is not None:
            return compiler.kernel(function, signatures, fast)
        package, _, module = function.__module__.rpartition(".")
        names = [symbol(module, function.__name__, number) for number in range(len(signatures))]
        library = _library(package)
        if not library.keys() >= set(names):
            return _interpreted(function, package, f"{module}.{function.__name__}")
        compiled = [library[name] for name in names]
        if len(compiled) == 1 and not os.environ.get(CHECKED):
            return compiled[0]
        return _checked(function.__name__, list(zip(signatures, compiled, strict=True)))

    return found


def helper(*signatures: Type, fast: frozenset[str] = frozenset(), inline: bool = False) -> Callable[[Any], Any]:
    """Have a function compiled as part of the kernels that call it: a decorator.

    Without a signature it is compiled for all types that it is called with. inline : its text is copied into callers,
    where a call would count references to arrays.
    """

    def found(function: Any) -> Any:
        return function if compiler is None else compiler.helper(function, signatures, fast, inline=inline)

    return found


def symbol(module: str, name: str, number: int) -> str:
    """Return the name in the library of a kernel with its signature of that number."""
    return f"{module}__{name}__{number}"


def level() -> str:
    """Return the level of instructions that this processor has, as NumPy finds it or is told (`.ci/arithmetics`)."""
    from platform import machine

    if machine().lower() not in ("x86_64", "amd64"):
        return "generic"
    features: dict[str, bool] = importlib.import_module("numpy._core._multiarray_umath").__cpu_features__
    fast = features.get("X86_V3", all(features.get(name) for name in ("AVX2", "FMA3", "F16C")))
    return "v3" if fast else "v2"


def described(*others: str) -> str:
    """Return what the kernels of cpbench, and of other packages, run as here, and which of them are not compiled."""
    packages = [one for one in dict.fromkeys((*PACKAGES, *others)) if find_spec(one.partition(".")[0])]
    stale = [package for package in packages if not _levels(package)]
    if not stale:
        return f"compiled for this processor's level of instructions ({level()})"
    return (
        f"NOT compiled, or changed since: {', '.join(stale)}. Python runs them, a hundred times slower or more; "
        f"run, with Numba, setuptools and a C compiler: python -m cpbench.foundation.kernel_build {' '.join(stale)}"
    )


def state(folder: Path) -> str:
    """Return a hash of all that the libraries of the package in a folder are made of."""
    files = [*sorted(folder.glob("*.py")), Path(__file__), Path(__file__).with_name("kernel_build.py")]
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()


def is_current(folder: Path, instructions: str) -> bool:
    """Return whether the libraries of the package in a folder are those of its kernels as they are now."""
    stamp = folder / f"{LIBRARY}_{instructions}.sha256"
    return stamp.is_file() and stamp.read_text() == state(folder)


def _levels(package: str) -> list[str]:
    """Return the levels for which a package has libraries that are current and run here, the best first."""
    folder = Path(importlib.import_module(package).__path__[0])
    return [one for one in dict.fromkeys((level(), "v2")) if is_current(folder, one)]


@functools.cache
def _library(package: str) -> Mapping[str, Any]:
    """Return the compiled kernels of a package, the best that this processor can run; none where it has no library that
    is current."""
    for instructions in _levels(package):
        with contextlib.suppress(ModuleNotFoundError):
            found = vars(importlib.import_module(f"{package}.{LIBRARY}_{instructions}_0")).copy()
            with contextlib.suppress(ModuleNotFoundError):  # a small package has one library
                found |= vars(importlib.import_module(f"{package}.{LIBRARY}_{instructions}_1"))
            return found
    return {}


def _interpreted(function: Any, package: str, name: str) -> Any:
    """Run a kernel as Python, with the divisions by 0 that compiled ones have; warn of the first one."""
    not_compiled.append(name)
    if len(not_compiled) == 1:
        warnings.warn(f"kernels: {described(package)}", RuntimeWarning, stacklevel=2)

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        with np.errstate(all="ignore"):
            return function(*arguments)

    return call


def _checked(name: str, choices: list[tuple[Type, Any]]) -> Any:
    """Call the first of several compiled functions whose signature takes the arguments."""

    def call(*arguments: Any) -> Any:
        for signature, function in choices:
            if signature.takes(arguments):
                return function(*arguments)
        raise TypeError(f"{name}: no signature takes these arguments: {[_kind(value) for value in arguments]}")

    return call


def _kind(value: Any) -> Any:
    if isinstance(value, tuple):
        return tuple(map(_kind, value))
    return (value.dtype.name, value.shape, value.flags.c_contiguous) if isinstance(value, np.ndarray) else type(value)
