"""Families of problems with what is known of their solutions, and the collection that they make.

The families are in other packages; each registers itself (`base.collection`).
"""

from cpbench.generators.base import Collection, Instance, generators

__all__ = ["Collection", "Instance", "generators"]
