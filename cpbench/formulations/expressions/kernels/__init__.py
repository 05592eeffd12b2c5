"""The kernel that evaluates maps, compiled when the package is built."""
