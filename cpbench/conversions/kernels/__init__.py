"""Compiled loops (numba, cached) of the conversions of large sparse problems.

Every kernel has explicit signatures, so it is compiled (or read from the cache) when its module is imported and
never afterwards. Modules are imported through :func:`cpbench.foundation.kernel_cache.load`, by conversions of large
problems only: a small one costs less by NumPy than numba's import.
"""

from cpbench.foundation.kernel_cache import ensure_cache_dir

ensure_cache_dir()
