"""Kernels of the conversions of large sparse problems, compiled when the package is built."""
