"""Compiled hot loops (numba, cached) of the native solvers, each with a NumPy reference in the tests.

Every kernel has one explicit signature, so it is compiled (or read from the cache) when its module is
imported and never afterwards. Modules are imported through :func:`cpbench.foundation.kernel_cache.load`.
"""

from cpbench.foundation.kernel_cache import ensure_cache_dir

ensure_cache_dir()
