"""The compiled loop (numba, cached) that evaluates maps; :func:`cpbench.foundation.kernel_cache.load` imports it."""

from cpbench.foundation.kernel_cache import ensure_cache_dir

ensure_cache_dir()
