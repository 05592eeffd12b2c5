"""Why a solver fails on a problem: the first cause with its evidence, and remedies that were tried.

Detectors look for causes, one in each file of `causes`; they decide nothing by the solver's word. What a cause proposes
is tried before it is shown, and so is the nearby problem that does not have the cause.
"""
