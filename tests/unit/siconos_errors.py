"""Run by the system's Python, where Debian's python3-siconos lives: prints Siconos' own error of every case.

Reads JSON cases from stdin, writes one JSON list of numbers; needs numpy and siconos only.
"""

import json
import sys

import numpy as np
import siconos.numerics as sn


def lcp(case):
    q, z = np.array(case["q"]), np.array(case["z"])
    return sn.lcp_compute_error(sn.LCP(np.array(case["M"]), q), z, np.zeros(q.size), 1e-8)


def fc3d(case):
    q, mu, r = np.array(case["q"]), np.array(case["mu"]), np.array(case["r"])
    problem = sn.FrictionContactProblem(3, mu.size, np.array(case["W"]), q, mu)
    options = sn.SolverOptions(sn.SICONOS_FRICTION_3D_NSGS)
    return sn.fc3d_compute_error(problem, r, np.zeros(q.size), 1e-8, options, np.linalg.norm(q))[1]


def mlcp(case):
    M, q, z = np.array(case["M"]), np.array(case["q"]), np.array(case["z"])
    return sn.mlcp_compute_error(sn.MLCP(case["n"], M, q), z, np.zeros(q.size), 1e-8)


sn.numerics_set_verbose(0)
values = []
for case in json.load(sys.stdin):
    value = {"lcp": lcp, "fc3d": fc3d, "mlcp": mlcp}[case["kind"]](case)
    values.append(float(value[1] if isinstance(value, (list, tuple)) else value))
print("\nVALUES" + json.dumps(values))
