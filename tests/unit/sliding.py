"""A formulation and its generator as a plugin writes them, for tests of what a new one takes."""

SLIDING = """
import numpy as np
from cpbench.formulations import LCPPoint, Relay, formulations
from cpbench.generators.base import Instance, collection

@formulations.register("sliding")
class Sliding(Relay):
    node = "sliding"

@collection("steps", "sliding", "steps", "a stranger", builtin=False)
def build():
    problem = Sliding(M=np.eye(1), q=[0.5], lb=[-1.0], ub=[1.0], name="one")
    return [Instance(problem, LCPPoint(z=[-0.5]), "closed form")]
"""
