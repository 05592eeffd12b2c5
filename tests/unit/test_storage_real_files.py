"""Every real file is read, or refused for the reason in this table; sizes are those of its manifest."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse as sp
from tiers import by_night, some_by_day

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import QP, FrictionContact

NODES = {
    "lcp": "lcp",
    "mlcp": "mlcp",
    "fc2d_local": "fc",
    "fc3d_local": "fc",
    "fc2d_global": "gfc",
    "fc3d_global": "gfc",
    "qp": "qp",
    "qps": "qp",
    "box_qp": "qp",
    "relay": "relay",
    "rolling_local": "rfc",
    "rolling_global": "grfc",
    "soclcp": "soclcp",
    "plasticity": "",
}
"""Node of the problems of every folder of real files."""
COUNTS = {
    "lcp": 20,
    "mlcp": 13,
    "fc2d_local": 8,
    "fc3d_local": 45,
    "fc2d_global": 2,
    "fc3d_global": 20,
    "qp": 104,
    "qps": 13,
    "box_qp": 23,
    "relay": 5,
    "rolling_local": 5,
    "rolling_global": 2,
    "soclcp": 2,
    "plasticity": 3,
}
OTHERWISE = {"soclcp/Example1_Fc3D_SBM.dat": "fc"}
"""Files whose content is not what their folder says."""
REFUSED = {
    "mlcp/Rectangular_mlcp.dat": "M: is 3x2, expected 2x2, rectangular problems are not known here",
    "plasticity/plasticity_2d_footing_1.dat": "is a plasticity problem",
    "plasticity/plasticity_2d_footing_10.dat": "plasticity as older files have it and siconos-rfc2d",
    "plasticity/plasticity_2d_vonmises_example1.dat": "is a plasticity problem",
}


@pytest.mark.parametrize("folder", [*(f for f in NODES if f != "qp"), *by_night(["qp"])])
def test_folder(folder: str, shared_data: Path) -> None:
    addresses = storage.problem_files([shared_data / folder])
    assert len(addresses) == COUNTS[folder]
    for address in addresses:
        file = str(Path(address).relative_to(shared_data))
        if file in REFUSED:
            continue
        problem = storage.load(address)
        assert problem.node == OTHERWISE.get(file, NODES[folder]), address
        if folder.startswith(("fc", "rolling")):
            assert getattr(problem, "dimension", 0) == (int(folder[2]) if folder.startswith("fc") else 5), address


def test_every_folder_is_in_the_table(shared_data: Path) -> None:
    """The models of GAMS are of several kinds: test_gams.py has them."""
    folders = {folder.name for folder in shared_data.iterdir() if folder.is_dir()}
    assert {name for name in folders if storage.problem_files([shared_data / name])} == {*NODES, "gams"}


@pytest.mark.parametrize("file", REFUSED)
def test_refused(file: str, shared_data: Path) -> None:
    with pytest.raises(FormatError) as refusal:
        storage.load(shared_data / file)
    assert REFUSED[file] in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.nightly
def test_sizes_are_those_of_the_manifest(shared_data: Path) -> None:
    lines = (shared_data / "MANIFEST.tsv").read_text().splitlines()[1:]
    checked = 0
    for line in lines:
        file, kind, size = line.split("\t")[:3]
        if file in REFUSED or kind not in NODES or "-q" in file or file.startswith(("qp/", "box_qp/")):
            continue
        said = dict(part.split("=") for part in size.split() if "=" in part)
        sizes = storage.load(shared_data / file).sizes()
        for key, symbol in (("n", "n"), ("nc", "nc"), ("nv", "n"), ("m", "m")):
            if key in said:
                assert sizes[symbol] == int(said[key]), file
                checked += 1
    assert checked > 80


def test_a_folder_s_name_is_no_evidence(shared_data: Path) -> None:
    """This file of the SOCLCP folder has the FC3D layout, and no other fits."""
    problem = storage.load(shared_data / "soclcp" / "Example1_Fc3D_SBM.dat")
    assert problem.fingerprint == storage.load(shared_data / "fc3d_local" / "FC3D_Example1_SBM.dat").fingerprint


def test_the_same_rolling_problem_as_text_and_as_fclib(shared_data: Path) -> None:
    """Chute, 768 degrees of freedom, 4 contacts: the text has 6 digits of M and H, and all of the vectors."""
    text: Any = storage.load(shared_data / "rolling_global" / "GRFC3D_Chute-ndof-768-nc-4-3.dat")
    fclib: Any = storage.load(shared_data / "rolling_global" / "Chute-ndof-768-nc-4-3.hdf5")
    assert (fclib.nc, fclib.f.size, fclib.dimension) == (4, 768, 5)
    for name in ("M", "H"):
        theirs, ours = getattr(text, name), getattr(fclib, name)
        assert abs(theirs - ours).max() <= 5e-6 * abs(ours).max(), name
    for name in ("f", "w", "mu", "mu_r"):
        assert np.array_equal(getattr(text, name), getattr(fclib, name)), name


def test_relays_are_read_to_their_bounds(shared_data: Path) -> None:
    problem: Any = storage.load(shared_data / "relay" / "step_2x2.dat")
    assert (problem.lb < problem.ub).all()
    z = problem.lb + 0.0
    w = problem.M @ z + problem.q
    assert problem.slacks(problem.point_type(z=z))["w"].tolist() == w.tolist()


def test_no_contact(shared_data: Path) -> None:
    problem: Any = storage.load(shared_data / "fc2d_global" / "gfc2d_granularflowonwall_00000_00117.dat")
    assert (problem.nc, problem.H.shape, problem.dimension) == (0, (900, 0), 2)


def test_the_normal_of_contactbench_goes_first(shared_data: Path) -> None:
    file = shared_data / "fc3d_local" / "sliding_cube.npz"
    problem = storage.load(file)
    assert isinstance(problem, FrictionContact)
    with np.load(file, allow_pickle=False) as raw:
        G, g = raw["G"], raw["g"].ravel()
    r = np.arange(12.0)  # N T1 T2 a contact
    theirs = r.reshape(4, 3)[:, [1, 2, 0]].ravel()
    u = np.asarray(problem.W @ r + problem.q).reshape(4, 3)
    assert np.allclose(u[:, [1, 2, 0]].ravel(), G @ theirs + g, rtol=1e-14)
    assert np.array_equal(problem.q[::3], g[2::3])


@pytest.mark.parametrize("name", some_by_day(["HS118", "QAFIRO", "QPCBOEI1", "DUALC2", "STADAT2", "TAME", "VALUES"], 2))
def test_mat_constraints_are_the_file_s(name: str, shared_data: Path, rng: np.random.Generator) -> None:
    """Violations of random points agree with those of l ≤ Ax ≤ u, row by row in the largest one."""
    file = shared_data / "qp" / f"{name}.mat"
    problem = storage.load(file)
    assert isinstance(problem, QP)
    raw = scipy.io.loadmat(file, spmatrix=False)
    A, lower, upper = sp.csr_array(raw["A"]), raw["l"].ravel().astype(float), raw["u"].ravel().astype(float)
    lower[lower <= -1e20], upper[upper >= 1e20] = -np.inf, np.inf
    for _ in range(5):
        x = 10.0 ** rng.uniform(-1, 2) * rng.standard_normal(problem.p.size)
        Ax = A @ x
        theirs = max(0.0, float((lower - Ax).max()), float((Ax - upper).max()))
        ours = max(
            0.0,
            float((problem.b - problem.A @ x).max(initial=0)),
            float(np.abs(problem.C @ x - problem.d).max(initial=0)),
            float((problem.lb - x).max()),
            float((x - problem.ub).max()),
        )
        assert ours == pytest.approx(theirs, rel=1e-12)
        assert problem.objective(x) == pytest.approx(
            0.5 * x @ (raw["P"] @ x) + raw["q"].ravel().astype(float) @ x, rel=1e-12
        )


def test_npz_constraints_are_qpsolvers_s(shared_data: Path) -> None:
    problem = storage.load(shared_data / "qp" / "QUADCMPC3.npz")
    assert isinstance(problem, QP)
    with np.load(shared_data / "qp" / "QUADCMPC3.npz", allow_pickle=False) as raw:
        assert np.array_equal(problem.A, -raw["G"])
        assert np.array_equal(problem.b, -raw["h"])
        assert np.array_equal(problem.C, raw["A"])
        assert np.array_equal(problem.lb, raw["lb"])
    absent = storage.load(shared_data / "qp" / "LIPMWALK0.npz")  # its A, b, lb, ub are pickled None
    assert isinstance(absent, QP)
    assert (absent.C.shape, absent.has_bounds) == ((0, 16), False)
