"""Advice from measurements: tune, history and select. Optional: only their commands import it."""
