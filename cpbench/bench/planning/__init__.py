"""Plans of what to run, from the command line and from files, down to the pairs."""
