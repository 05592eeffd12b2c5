"""Processes that may do anything, and what comes of them."""
