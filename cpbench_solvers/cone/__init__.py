"""Programs and complementarity problems over products of cones."""
