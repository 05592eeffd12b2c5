"""Scenes of rigid bodies that touch: geometry by formulas, one family a file, and a stepper that lets them move.

A scene says where its bodies are, what holds them and which of their points are near one another; `stepper` makes the
contact problem of each time step and moves the bodies by an answer to it. No physics engine is needed.
"""
