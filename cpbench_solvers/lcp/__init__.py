"""Linear complementarity problems: pivoting, splittings, faces, Newton, interior point."""
