"""Search for the options of a solver: where, how it is judged, in which order, and what is written of it."""
