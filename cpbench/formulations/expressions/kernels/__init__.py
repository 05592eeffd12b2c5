"""The compiled loop (numba, cached) that evaluates maps; imported through :func:`cpbench.foundation.kernel_cache.load`."""

from cpbench.foundation.kernel_cache import ensure_cache_dir

ensure_cache_dir()
