"""Solvers that are programs of their own, in any language: served over pipes, or run once a solve."""
