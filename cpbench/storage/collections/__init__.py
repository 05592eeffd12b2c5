"""Sets of problem files that others publish: their manifests (`NAME.toml`), and the folders of the user."""

PREFIX = "collection"
"""First part of an address in a set: `collection/NAME`."""
