"""What to run: plans from the command line and from files, down to the pairs."""
