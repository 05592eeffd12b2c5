"""Sets of problem files that others publish: their manifests (`NAME.toml`), and the copies that the user has added."""

PREFIX = "collection"
"""First part of an address in an added set: `collection/NAME`."""
