"""Frictional contact: local and global, sliding and rolling, linear and nonlinear dynamics."""
