"""Figures of runs: one kind a module, beside those of `cpbench/report/plots`."""
