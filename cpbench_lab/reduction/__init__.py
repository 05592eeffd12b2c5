"""Failures made small: a problem on which a solver fails, reduced while it fails, and the search for such problems."""
