"""Ways to hand a problem to another program in a format of this package: one module each."""
