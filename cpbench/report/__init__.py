"""Documents and figures made from the tables of `analysis`, without further arithmetic."""
