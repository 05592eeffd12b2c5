"""The search for problems on which one solver fails and another one does not."""
