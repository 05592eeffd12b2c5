"""The results file: one SQLite database, one writer, a transaction a row."""
