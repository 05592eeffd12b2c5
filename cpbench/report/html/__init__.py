"""The offline report: one HTML file that needs no network, and computes its figures anew for what is filtered."""
