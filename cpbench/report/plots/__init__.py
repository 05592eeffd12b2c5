"""Single figures of runs for `cpbench plot`: a module a kind, drawn from `analysis` without further arithmetic."""
