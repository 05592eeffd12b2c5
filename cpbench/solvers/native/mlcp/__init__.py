"""Mixed linear complementarity problems."""
