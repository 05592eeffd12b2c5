"""What other programs read and write: one exchange, or one family of them, a module."""
