"""Pure functions on tables of results: nothing here reads a file, draws, or changes what it is given."""
