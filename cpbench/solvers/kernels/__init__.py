"""Compiled hot loops (numba, cached) of the native solvers, each with a NumPy reference in the tests."""
