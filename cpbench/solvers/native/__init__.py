"""Native solvers, one algorithm a file."""
