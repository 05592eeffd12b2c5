"""Quadratic programs: active sets, interior point, augmented Lagrangian, projections."""
