"""Broken and hostile files: one line that names the file and the place, nothing allocated, nothing run."""

from __future__ import annotations

import io
import pickle
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from tiers import some_by_day

from cpbench import storage
from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations import (
    LCP,
    AnisotropicFrictionContact,
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    MixedFrictionContact,
    Relay,
    RollingFrictionContact,
    Step,
)

LCP_FILE = LCP(M=np.arange(16.0).reshape(4, 4) + np.eye(4), q=-np.ones(4), name="good")
FC_FILE = FrictionContact(W=np.eye(6) + 0.1, q=-np.ones(6), mu=np.array([0.3, 0.5]))

MU = np.array([0.3, 0.5])
MIXED_FILE = MixedFrictionContact(W=np.eye(6), V=np.ones((6, 2)), R=np.eye(2), q=-np.ones(6), s=np.ones(2), mu=MU)
JOINTS: dict[str, Any] = {"M": np.eye(4), "G": np.ones((4, 1)), "f": np.ones(4), "b": np.ones(1), "mu": MU}
GLOBAL_FILE = GlobalFrictionContact(H=np.ones((4, 6)), w=-np.ones(6), **JOINTS)
ROLLING_FILE = GlobalRollingFrictionContact(H=np.ones((4, 10)), w=-np.ones(10), mu_r=MU / 10, **JOINTS)
LOCAL_ROLLING_FILE = RollingFrictionContact(W=np.eye(10), q=-np.ones(10), mu=MU, mu_r=MU / 10)
ELLIPTIC_FILE = AnisotropicFrictionContact(W=np.eye(6), q=-np.ones(6), mu=np.ones((2, 2)))
RELAY_FILE = Relay(M=np.eye(2), q=np.ones(2), lb=-np.ones(2), ub=np.ones(2))


def replace(file: h5py.File, name: str, value: Any) -> None:
    del file[name]
    file[name] = value


def declare(file: h5py.File, name: str, shape: tuple[int, ...], **options: Any) -> None:
    """A data set of that shape that holds nothing."""
    del file[name]
    file.create_dataset(name, shape, "f8", **options)


def cyclic_trace(file: h5py.File) -> None:
    group = file.create_group("provenance/0")
    for name in ("conversion", "kind", "source_node", "source"):
        group.attrs[name] = "x"
    trace = group.create_group("trace")
    trace.attrs["mapping"] = 1
    trace["again"] = trace


HDF5: dict[str, tuple[Any, Callable[[h5py.File], None], str]] = {
    "no node": (LCP_FILE, lambda f: f["cpbench"].attrs.__delitem__("node"), "cpbench/@node: is missing"),
    "other node": (LCP_FILE, lambda f: f["cpbench"].attrs.modify("node", "lpc"), "cpbench/@node: unknown formulation"),
    "version": (LCP_FILE, lambda f: f["cpbench"].attrs.modify("format_version", 7), "@format_version: is 7, this"),
    "no M": (LCP_FILE, lambda f: f.__delitem__("cpbench/M"), "cpbench/M: is missing, expected"),
    "no vectors": (LCP_FILE, lambda f: f.__delitem__("cpbench/vectors"), "cpbench/vectors: is missing"),
    "cpbench is data": (LCP_FILE, lambda f: replace(f, "cpbench", 1.0), "cpbench: is a data set, expected a group"),
    "small M": (LCP_FILE, lambda f: replace(f, "cpbench/M", np.eye(3)), "cpbench/M: is 3x3, expected 4x4"),
    "flat M": (LCP_FILE, lambda f: replace(f, "cpbench/M", np.ones(16)), "cpbench/M: has shape (16,), expected 2 dim"),
    "NaN": (LCP_FILE, lambda f: f["cpbench/vectors/q"].__setitem__(2, np.nan), "cpbench/vectors/q: has 1 non-finite"),
    "strings": (LCP_FILE, lambda f: replace(f, "cpbench/vectors/q", [b"a"] * 4), "vectors/q: holds strings"),
    "10 GB": (
        LCP_FILE,
        lambda f: declare(f, "cpbench/M", (40000, 40000)),
        "cpbench/M: declares 12800000000 bytes, the",
    ),
    "10 GB packed": (
        LCP_FILE,
        lambda f: declare(f, "cpbench/vectors/q", (10**10,), chunks=(1000,), compression="gzip"),
        "cpbench/vectors/q: declares 80000000000 bytes, the file holds 0",
    ),
    "cyclic trace": (LCP_FILE, cyclic_trace, "is nested more than 8 deep"),
    "negative mu": (FC_FILE, lambda f: f["fclib_local/vectors/mu"].__setitem__(1, -0.5), "is negative at contact 1"),
    "short q": (
        FC_FILE,
        lambda f: replace(f, "fclib_local/vectors/q", np.ones(5)),
        "fclib_local/vectors/q: has 5 numbers, expected 3 for each of the 2 contacts in vectors/mu",
    ),
    "mis-sized W": (FC_FILE, lambda f: f["fclib_local/W/m"].__setitem__(0, 5), "fclib_local/W: is 5x6, expected 6x6"),
    "index": (
        FC_FILE,
        lambda f: f["fclib_local/W/i"].__setitem__(3, 6),
        "fclib_local/W/i: holds the index 6, expected 0 to 5",
    ),
    "pointers": (FC_FILE, lambda f: f["fclib_local/W/p"].__setitem__(2, 99), "fclib_local/W/p: is not a list of row"),
    "storage code": (FC_FILE, lambda f: f["fclib_local/W/nz"].__setitem__(0, -3), "W/nz: is -3, expected -2 (rows)"),
    "dimension": (FC_FILE, lambda f: f["fclib_local/spacedim"].__setitem__(0, 4), "spacedim: is 4, expected 2 or 3"),
    "no group": (FC_FILE, lambda f: f.__delitem__("fclib_local"), "fclib_local: is missing, expected a group"),
    "properties": (
        FC_FILE,
        lambda f: f.create_group("info").attrs.__setitem__("properties", "{"),
        "info/@properties: is not JSON",
    ),
    "sequence": (FC_FILE, lambda f: f.create_group("cpbench/sequence"), "cpbench/sequence: needs the attributes name"),
    "contacts": (
        FC_FILE,
        lambda f: [f.__setitem__(f"cpbench/contacts/{k}", np.zeros(3)) for k in ("id", "bodies", "position", "frame")],
        "cpbench/contacts: holds float64|cpbench/contacts",
    ),
}


def vector(group: str, name: str, size: int) -> Callable[[h5py.File], None]:
    """A vector of another length."""
    return lambda f: replace(f, f"{group}/vectors/{name}", np.ones(size))


def entry(name: str, index: Any, value: float) -> Callable[[h5py.File], None]:
    return lambda f: f[name].__setitem__(index, value)


def without(name: str) -> Callable[[h5py.File], None]:
    return lambda f: f.__delitem__(name)


LOCAL, GLOBAL, ROLLING, OWN = "fclib_local", "fclib_global", "fclib_global_rolling", "cpbench"
NEW_GROUPS: dict[str, tuple[Any, Callable[[h5py.File], None], str]] = {
    "V of other contacts": (MIXED_FILE, entry(f"{LOCAL}/V/m", 0, 5), "fclib_local/V: is 5x2, expected 6x2"),
    "s is NaN": (MIXED_FILE, entry(f"{LOCAL}/vectors/s", 0, np.nan), "fclib_local/vectors/s: has 1 non-finite"),
    "no V": (MIXED_FILE, without(f"{LOCAL}/V"), "fclib_local/V: is missing beside R, vectors/s"),
    "fcm said fc": (MIXED_FILE, lambda f: f[OWN].attrs.modify("node", "fc"), "V: couples bilateral constraints, but"),
    "G of many joints": (
        GLOBAL_FILE,
        entry(f"{GLOBAL}/G/n", 0, 2**31 - 1),
        "fclib_global/G: is 4x2147483647, expected 4x1",
    ),
    "no b": (GLOBAL_FILE, without(f"{GLOBAL}/vectors/b"), "fclib_global/vectors/b: is missing beside G"),
    "no G": (GLOBAL_FILE, without(f"{GLOBAL}/G"), "fclib_global/G: is missing beside vectors/b"),
    "no mu_r": (ROLLING_FILE, without(f"{ROLLING}/vectors/mu_r"), "fclib_global_rolling/vectors/mu_r: is missing"),
    "rolling, 3 rows": (ROLLING_FILE, entry(f"{ROLLING}/spacedim", 0, 3), "vectors/w: has 10 numbers, expected 3"),
    "local long mu_r": (LOCAL_ROLLING_FILE, vector(OWN, "mu_r", 3), "cpbench/vectors/mu_r: has shape (3,), but nc"),
    "dimension is text": (
        LOCAL_ROLLING_FILE,
        lambda f: f[OWN].attrs.__setitem__("fields", '{"dimension": "five"}'),
        "cpbench/@fields: has dimension = 'five', expected int",
    ),
    "one coefficient": (
        ELLIPTIC_FILE,
        lambda f: replace(f, f"{OWN}/mu", np.ones((2, 1))),
        "cpbench/mu: has shape (2, 1), expected nc x 2",
    ),
    "crossed bounds": (RELAY_FILE, entry(f"{OWN}/vectors/lb", 1, 2.0), "cpbench/vectors/lb: exceeds ub at 1"),
}


def refused(path: Path | str, expected: str, **options: Any) -> str:
    """The message of the refusal: one line, with the file, from no more than 8 MB of memory."""
    tracemalloc.start()
    try:
        with pytest.raises(FormatError) as refusal:
            storage.load(path, **options)
        assert tracemalloc.get_traced_memory()[1] < 8e6
    finally:
        tracemalloc.stop()
    message = str(refusal.value)
    assert any(part in message for part in expected.split("|")), message
    assert message.startswith(str(path).split("::")[0])
    assert "\n" not in message
    return message


@pytest.mark.parametrize("name", some_by_day(HDF5 | NEW_GROUPS, 30))
def test_hdf5(name: str, tmp_path: Path) -> None:
    problem, damage, expected = (HDF5 | NEW_GROUPS)[name]
    path = tmp_path / "a.h5"
    storage.save(problem, path)
    with h5py.File(path, "r+") as file:
        damage(file)
    refused(path, expected)
    assert storage.problem_files([tmp_path]) == [str(path)]  # listed, so that a run says why it is refused


def test_not_hdf5(tmp_path: Path) -> None:
    storage.save(LCP_FILE, tmp_path / "good.h5")
    good = (tmp_path / "good.h5").read_bytes()
    for name, content, expected in (
        ("text.h5", b"not HDF5 at all", "is not an HDF5 file"),
        ("cut.hdf5", good[: len(good) // 2], "is a truncated HDF5 file"),
        ("signature.h5", good[:8], "is a truncated HDF5 file|is a damaged HDF5 file"),
        ("empty.h5", b"", "is empty (0 bytes)"),
        ("empty.dat", b"", "is empty (0 bytes)"),
        (
            "lfs.hdf5",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 27172252\n",
            "run 'git lfs pull'",
        ),
        (
            "lfs.dat",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:ab\nsize 27172252\n",
            "run 'git lfs pull'",
        ),
        ("unknown.xyz", b"hello", "is in no known format"),
        ("scene.xml", b"<mujoco/>", "is for cpbench audit mujoco FILE, and in Python for cpbench.from_mujoco"),
        ("binary.dat", b"3 \x00\x01", "is not a text file"),
    ):
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, expected)
    with h5py.File(tmp_path / "good.h5"):
        refused(tmp_path / "good.h5", "is open in this process already, by h5py; close that file first")
    refused(tmp_path / "missing.h5", "no such file")
    refused(tmp_path, "is a folder, expected a file")
    refused(tmp_path / "good.h5", "is not a text file", format="siconos-lcp")
    refused(tmp_path / "text.h5", "n: is 'not', expected a whole number", format="siconos-lcp")
    refused(f"{tmp_path / 'good.h5'}::x", "has no member 'x'")
    with pytest.raises(CpbenchError, match="unknown format 'fclibb': did you mean fclib"):
        storage.load(tmp_path / "good.h5", format="fclibb")


HEAD = "3\n1\n0\n3\n3\n3 3\n"
TEXT = {
    "cut": (f"{HEAD}1 0 0 0 2", "M: has 5 numbers left in the file, expected 9"),
    "word in M": (f"{HEAD}1 0 0 0 x 0 0 0 3 -1 0 0 0.3", "M: holds something that is not a number"),
    "sizes differ": ("3\n1\n0\n3\n3\n3 4\n1 0 0 0 2 0 0 0 3 -1 0 0 0.3", "M: repeats its size"),
    "storage": ("3\n1\n7\n3\n3\n3 3\n1 0 0", "M/storage: is 7, expected 0 (dense), 1 (blocks) or 2 (sparse)"),
    "huge": ("99999999999\n0\n99999999999\n99999999999\n99999999999 99999999999\n1 2", "numbers left in the file"),
    "huge blocks": ("3 333333333 1 999999999 999999999 1 1 1 999999999 999999999 2 1 0 1 0 0 5", "numbers left"),
    "huge sparse": (
        "2\n2\n2\n2\n2\n1\nCSparse\ntriplet: 2-by-2, nzmax: 9 nnz: 999999999\n 0 0 : 1\n",
        "M/triplet: has 4 numbers left in the file, expected 3999999996",
    ),
    "sparse index": (
        "2\n2\n2\n2\n1\nCSparse\ntriplet: 2-by-2, nzmax: 1 nnz: 1\n 0 2 : 1\n 0 0\n",
        "M: holds the index 2",
    ),
    "sparse size": (
        "2\n2\n2\n2\n1\nCSparse\ntriplet: 3-by-2, nzmax: 1 nnz: 1\n 0 1 : 1\n 0 0\n",
        "M: is 3x2 for CSparse",
    ),
    "block labels": ("2 1 2 2 1 1 1 2 2 2 1 0 1 0 5 2 1 1 2 -5 -6", "M/values: do not number the 1 blocks"),
    "block pointers": ("2 1 2 2 1 1 1 2 2 2 1 0 4 0 0 2 1 1 2 -5 -6", "M/index2: does not place 1 blocks"),
    "block ends": ("2 1 2 2 1 1 1 3 2 2 1 0 1 0 0 2 1 1 2 -5 -6", "M/row ends: do not rise to 2"),
    "mlcp disagrees": ("1 1 1 0 0 1 0 0 1 1 1 1 5 7 6 7", "A: differs from the one in M and q by 1"),
    "mlcp blocks": ("1 0 1 1 0 3 2 1 0 0 2 2 2 2 1 0 0 1 5 6", "blocks: end at [0, 3] with kinds"),
    "mlcp blocks fall": ("1 0 2 1 0 2 1 3 0 1 0 0 3 3 3 3 1 0 0 0 1 0 0 0 1 5 6 7", "blocks: end at [0, 2, 1, 3]"),
    "huge empty blocks": (
        "99999999999 1 99999999999 99999999999 0 1 2 3",
        "M: is 99999999999x0, expected 99999999999x99999999999",
    ),
    "relay cut": ("1 0 1 1 1 1 2 -1 0", "no Siconos layout fits"),
    "relay crossed": ("1 0 1 1 1 1 2 -1 1 0", "lb: exceeds ub at 0"),
    "cone ends": ("3 1 0 3 3 3 3 1 0 0 0 1 0 0 0 1 1 1 1 0 2 0.5", "no Siconos layout fits"),
    "cone ends fall": ("2 2 0 2 2 2 2 1 0 0 1 1 1 0 3 2 0.5 0.5", "cone ends: do not rise from 0 to 2"),
    "empty cone": ("2 2 0 2 2 2 2 1 0 0 1 1 1 0 0 2 0.5 0.5", "cone ends: do not rise from 0 to 2"),
    "huge cones": ("2 999999999 0 2 2 2 2 1 0 0 1 1 1 0 2 0.5", "no Siconos layout fits"),
    "negative tau": ("1 1 0 1 1 1 1 5 -1 0 1 -0.5", "cone_mu: is -0.5 at factor 0"),
    "negative mu_r": (f"5 1 0 5 5 5 5 {'1 ' * 25} 1 1 1 1 1 0.5 -0.1", "mu_r: is negative at contact 0"),
    "rolling cut": (f"5 1 0 5 5 5 5 {'1 ' * 25} 1 1 1 1 1 0.5", "mu_r: has 0 numbers left in the file, expected 1"),
    "4 rows": (f"4 1 0 4 4 4 4 {'1 ' * 16} 1 1 1 1 0.5 0.1", "d: is 4, expected|no Siconos layout fits"),
    "words": ("once upon a time", "is 'once', expected a whole number"),
}


@pytest.mark.parametrize("name", TEXT)
def test_siconos_text(name: str, tmp_path: Path) -> None:
    text, expected = TEXT[name]
    (tmp_path / "a.dat").write_text(text)
    refused(tmp_path / "a.dat", expected)


class Bomb:
    """Unpickled, it leaves a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return (open, (str(self.path), "w"))


def npy(array: Any, allow_pickle: bool = False) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asanyarray(array), allow_pickle=allow_pickle)
    return stream.getvalue()


def archive(path: Path, **entries: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as file:
        for name, content in entries.items():
            file.writestr(f"{name}.npy", content)
    return path


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    trap = tmp_path / "trap"
    array = np.array(None, dtype=object)
    array[()] = Bomb(trap)
    poison = npy(array, allow_pickle=True)
    good = {"P": npy(np.eye(2)), "q": npy(np.ones(2))}
    for entries in (
        {**good, "A": poison},
        {"P": poison, "q": good["q"]},
        {**good, "lb": npy(np.array([None, 1], dtype=object), allow_pickle=True)},
        {**good, "lb": npy(np.array(1.5, dtype=object), allow_pickle=True)},  # not None: no absent part
    ):
        refused(archive(tmp_path / "p.npz", **entries), "holds Python objects: they are never loaded")
    for read in (storage.read_matrix, storage.read_vector):
        (tmp_path / "m.npy").write_bytes(poison)
        with pytest.raises(FormatError, match="holds Python objects"):
            read(tmp_path / "m.npy")
        (tmp_path / "m.npy").write_bytes(pickle.dumps(Bomb(trap)))
        with pytest.raises(FormatError, match=r"is not an array in NumPy's \.npy format"):
            read(tmp_path / "m.npy")
    assert not trap.exists()
    absent = archive(tmp_path / "n.npz", **good, A=npy(np.array(None, dtype=object), allow_pickle=True))
    assert storage.load(absent).sizes()["k"] == 0


@pytest.mark.nightly
def test_numpy_and_matlab_files(tmp_path: Path) -> None:
    eye, q = npy(np.eye(2)), npy(np.ones(2))
    header = npy(np.zeros(1)).replace(b"(1,)", b"(10000000000,)")[: len(npy(np.zeros(1)))]
    box = {"data": npy(np.ones(2)), "indices": npy(np.arange(2)), "indptr": npy(np.arange(3)), "shape": npy([2, 2])}
    box |= {"q": q, "l": npy(np.zeros(2)), "u": npy(np.ones(2))}
    cases: dict[str, tuple[dict[str, bytes], str]] = {
        "sizes": ({"P": eye, "q": npy(np.ones(3))}, "P: is 2x2, expected 3x3 (q has 3 numbers)"),
        "rows": ({"P": eye, "q": q, "G": eye, "h": npy(np.ones(3))}, "G: is 2x2, expected 3x2 (h has 3 numbers)"),
        "strings": ({"P": eye, "q": npy(np.array(["a", "b"]))}, "q: holds <U1"),
        "short": ({"P": eye, "q": header}, "q: declares|q: is not an array"),
        "not symmetric": ({"P": npy(np.array([[1.0, 2], [1, 1]])), "q": q}, "Q: is not symmetric"),
        "one half": ({"P": npy(np.array([[1.0, 2], [0, 1]])), "q": q}, "P: is not symmetric: the lower triangle is"),
        "bounds": ({"P": eye, "q": q, "lb": npy(np.ones(2)), "ub": npy(np.zeros(2))}, "lb: exceeds ub at 0"),
        "box index": ({**box, "indices": npy(np.array([0, 5]))}, "indices: hold 5, expected 0 to 1"),
        "box pointers": ({**box, "indptr": npy(np.array([0, 2]))}, "indptr: is not a list of 3 increasing pointers"),
        "box shape": ({**box, "shape": npy([2**40, 2**40])}, "indptr: is not a list of"),
        "box count": ({**box, "data": npy(np.ones(1))}, "indices: has 2 numbers, expected 1 (data has 1 numbers)"),
        "contacts": ({"G": npy(np.eye(3)), "g": npy(np.ones(3)), "mus": npy(np.ones(2))}, "G: has shape (3, 3)"),
    }
    for entries, expected in cases.values():
        refused(archive(tmp_path / "a.npz", **entries), expected)
    (tmp_path / "b.npz").write_bytes(b"PK\x03\x04 broken")
    refused(tmp_path / "b.npz", "is not a readable .npz archive")
    refused(tmp_path / "b.npz", "is not a readable .npz archive", format="qp-npz")
    (tmp_path / "c.mat").write_bytes(b"no MATLAB file at all" * 20)
    refused(tmp_path / "c.mat", "is not a readable MATLAB file")
    good = {"P": np.eye(2), "q": np.ones(2), "r": 0.0, "A": np.eye(2), "l": np.zeros(2), "u": np.ones(2)}
    for change, expected in (
        ({"l": np.ones(3)}, "u: has 2 numbers, expected 3 (l has 3 numbers)"),
        ({"P": np.eye(3)}, "P: is 3x3, expected 2x2 (q has 2 numbers)"),
        ({"l": np.array([5.0, 0])}, "row 0 of A: has the limits l = 5, u = 1"),
        ({"u": np.array([np.nan, 1])}, "row 0 of A: has the limits"),
        ({"q": np.array([np.nan, 1])}, "p: has 1 non-finite entries"),
        ({"A": "text"}, "A: holds <U"),
    ):
        scipy.io.savemat(tmp_path / "d.mat", good | change)
        refused(tmp_path / "d.mat", expected)
    scipy.io.savemat(tmp_path / "d.mat", {k: v for k, v in good.items() if k != "A"})
    refused(tmp_path / "d.mat", "A: is missing, expected the form OSQP (P, q, r, A, l, u)")


def test_a_zip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "z.npz", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("P.npy", npy(np.eye(2)))
        vector = npy(np.zeros(125_000))
        file.writestr("q.npy", vector)
    content = (tmp_path / "z.npz").read_bytes()
    declared = len(vector).to_bytes(4, "little")
    assert content.count(declared) == 2
    (tmp_path / "z.npz").write_bytes(content.replace(declared, (4 * 10**9).to_bytes(4, "little")))
    refused(tmp_path / "z.npz", "q: declares 1000000 bytes, the file holds 3999999")


def test_the_refusal_of_a_step_names_its_path(tmp_path: Path) -> None:
    trace = {"factor": np.ones((2, 3))}
    step = Step("a-b", {}, "equivalent", "lcp", "00", trace)
    problem = LCP(M=np.eye(1), q=np.ones(1), provenance=(step,))
    storage.save(problem, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        file["provenance/0/trace/factor"].attrs["factorization"] = 1
    refused(tmp_path / "a.h5", "provenance/0/trace/factor: has shape (2, 3) of float64, a factorization needs a square")
