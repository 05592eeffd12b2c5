"""Affine variational inequalities on polyhedra, and relays."""
