"""Boxes with nonlinear functions, variational and quasi-variational inequalities, equations."""
