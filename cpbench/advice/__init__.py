"""Advice from measurements: recommend, tune, history and select. Optional: only their commands import it."""
