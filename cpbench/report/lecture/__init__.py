"""The lecture, alive: one page that walks its equations on small problems, every number computed as it is built."""
