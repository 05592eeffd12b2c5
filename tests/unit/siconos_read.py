"""Run by the system's Python, where Debian's python3-siconos lives: prints what Siconos reads in text files.

Arguments are pairs kind, file; writes one JSON list of {q, mu, mu_r, entries: M row by row (H after it), and what else
the kind has}; needs numpy only. Python knows no relay: that one is read by the C library.
"""

import ctypes
import json
import os
import sys

import numpy as np
import siconos.numerics as sn


def entries(M, rows, cols):
    if isinstance(M, np.ndarray):
        return M.tolist()
    value = sn.NM_get_value if isinstance(M, sn.NumericsMatrix) else sn.SBM_get_value
    return [[value(M, i, j) for j in range(cols)] for i in range(rows)]


def lcp(file):
    p = sn.LCP(np.array([[1.0]]), np.array([1.0]))
    sn.linearComplementarity_newFromFilename(p, file)
    return {"q": p.q.tolist(), "entries": entries(p.M, p.size, p.size)}


def mlcp(file):
    p = sn.MLCP()
    sn.mixedLinearComplementarity_newFromFilename(p, file)
    return {"q": p.q.tolist(), "entries": entries(p.M, p.n + p.m, p.n + p.m)}


def fc(file):
    p = sn.frictionContact_new_from_filename(file)
    size = p.dimension * p.numberOfContacts
    return {"q": p.q.tolist(), "mu": p.mu.tolist(), "entries": entries(p.M, size, size)}


def gfc(file):
    p = sn.globalFrictionContact_new_from_filename(file)
    n, m = len(p.q), len(p.b)
    both = entries(p.M, n, n) + entries(p.H, n, m)
    return {"q": p.q.tolist() + p.b.tolist(), "mu": p.mu.tolist(), "entries": both}


def numbers(pointer, count, kind=ctypes.c_double):
    return list(ctypes.cast(int(pointer), ctypes.POINTER(kind))[:count])


def rfc(file):
    p = sn.rollingFrictionContact_new_from_filename(file)
    nc, size = p.numberOfContacts, p.dimension * p.numberOfContacts
    found = {"q": p.q.tolist(), "mu": p.mu.tolist(), "mu_r": numbers(p.mu_r, nc)}
    return found | {"entries": entries(p.M, size, size)}


def grfc(file):
    p = sn.globalRollingFrictionContact_new_from_filename(file)
    n, m, nc = len(p.q), len(p.b), p.numberOfContacts
    found = {"q": p.q.tolist() + p.b.tolist(), "mu": p.mu.tolist(), "mu_r": numbers(p.mu_r, nc)}
    return found | {"entries": entries(p.M, n, n) + entries(p.H, n, m)}


def soclcp(file):
    """With the answer of Siconos' own solver, which tells what tau means."""
    p = sn.SecondOrderConeLinearComplementarityProblem()
    sn.secondOrderConeLinearComplementarityProblem_newFromFilename(p, file)
    options = sn.SolverOptions(sn.SICONOS_SOCLCP_NSGS)
    options.dparam[sn.SICONOS_DPARAM_TOL], options.iparam[sn.SICONOS_IPARAM_MAX_ITER] = 1e-12, 10000
    r, u = (ctypes.c_double * p.n)(), (ctypes.c_double * p.n)()
    LIBRARY.soclcp_driver(ctypes.c_void_p(int(p.this)), r, u, ctypes.c_void_p(int(options.this)))
    found = {"q": p.q.tolist(), "mu": numbers(p.tau, p.nc), "entries": entries(p.M, p.n, p.n)}
    return found | {"ends": numbers(p.coneIndex, p.nc + 1, ctypes.c_uint), "answer": list(r)}


def avi(file):
    p = sn.AVI()
    kept.append(p)  # its destructor frees a set that was never made
    sn.AVI_newFromFilename(p, file)
    return {"q": p.q.tolist(), "entries": entries(p.M, p.size, p.size)}


class RelayProblem(ctypes.Structure):
    _fields_ = [("size", ctypes.c_int)] + [(name, ctypes.c_void_p) for name in ("M", "q", "lb", "ub")]


def relay(file):
    p = LIBRARY.relay_new_from_filename(file.encode()).contents
    found = {name: numbers(getattr(p, name), p.size) for name in ("q", "lb", "ub")}
    return found | {"entries": [[LIBRARY.NM_get_value(p.M, i, j) for j in range(p.size)] for i in range(p.size)]}


LIBRARY = ctypes.CDLL("libsiconos_numerics.so.7")
LIBRARY.relay_new_from_filename.restype = ctypes.POINTER(RelayProblem)
LIBRARY.NM_get_value.restype = ctypes.c_double
LIBRARY.NM_get_value.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int]
kept = []
sn.numerics_set_verbose(0)
read = [globals()[kind](file) for kind, file in zip(sys.argv[1::2], sys.argv[2::2], strict=True)]
print("\nVALUES" + json.dumps(read))
sys.stdout.flush()
os._exit(0)
