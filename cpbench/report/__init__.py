"""Documents and figures made from the tables of `analysis`; no arithmetic of its own."""
