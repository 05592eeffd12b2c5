"""Contradictions between the rows of a run, by their answers: found after the run, and arbitrated by certificates."""
