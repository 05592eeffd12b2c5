"""Bundles: a run with everything that repeats it in one zip file, anonymous where asked; and running one again."""
