"""Exchanges with other programs: one exchange, or one family of them, a module."""
