"""Figures of problems: one kind a module, drawn from what `analysis` computes."""
