"""Bundles: a run with everything that repeats it in one zip file; and running one again."""
