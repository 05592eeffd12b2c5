"""Proofs about answers: exact solutions, boxes that hold a solution, boxes that hold none.

The data of a problem are doubles, hence exact numbers. No comparison of doubles decides here: doubles give hints, and
rationals or balls (python-flint) decide.
"""
