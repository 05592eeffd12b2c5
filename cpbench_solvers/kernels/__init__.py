"""Kernels of the native solvers, compiled when the package is built, each with a NumPy reference in the tests."""
