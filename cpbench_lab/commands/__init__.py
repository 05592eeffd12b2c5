"""Commands of the laboratory: one file each, found by the entry points ``cpbench.commands``."""
