"""Run by the system's Python, where Debian's python3-siconos lives: prints what Siconos reads in text files.

Arguments are pairs kind, file; writes one JSON list of {q, mu, entries: M row by row (H after it)}; needs numpy only.
"""

import json
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


sn.numerics_set_verbose(0)
read = [globals()[kind](file) for kind, file in zip(sys.argv[1::2], sys.argv[2::2], strict=True)]
print("\nVALUES" + json.dumps(read))
