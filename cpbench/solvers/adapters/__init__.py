"""Third-party packages, one a file; the guest is imported inside `solve` only."""
