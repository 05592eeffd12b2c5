"""File formats in which other programs keep problems: one format a module. Nothing in a file is executed."""
