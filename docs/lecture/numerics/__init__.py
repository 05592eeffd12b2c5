"""What the tutorial computes: small problems, round trips of conversions, iterations, sets."""
