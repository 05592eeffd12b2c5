"""Read a certificate's file, and hash what it holds."""

from __future__ import annotations

import hashlib
import itertools
from typing import Any

import h5py
import numpy as np
from flint import fmpq

ORDER = {
    "lcp": "M q", "relay": "M q lb ub", "mlcp": "A B C D a b", "avi": "M q A b C d lb ub", "qp": "Q p A b C d lb ub",
    "coneqp": "Q p A b cone_kind cone_size cone_mu cone_mu_r",
    "fc": "W q mu", "fcm": "W V R q s mu", "gfc": "M H G f w b mu",
    "ncp": "start F", "micp": "lb ub start F", "equation": "start F",
}  # fmt: skip
"""The data of a problem of every node, in the order in which they are hashed."""


def exact(value: float) -> Any:
    """Return a double as a rational."""
    return fmpq(*float(value).as_integer_ratio())


class Matrix:
    """Rows as dictionaries column -> double."""

    def __init__(self, shape: Any, rows: list[dict[int, float]]) -> None:
        self.shape, self.rows = shape, rows

    @classmethod
    def read(cls, item: Any) -> Matrix:
        """Read a dense data set, or a group of compressed rows."""
        if isinstance(item, h5py.Dataset):
            return cls(item.shape, [{j: v for j, v in enumerate(row) if v} for row in item[()].tolist()])
        ends, columns, values = item["indptr"][()].tolist(), item["indices"][()].tolist(), item["data"][()].tolist()
        rows = [dict(sorted(zip(columns[a:b], values[a:b], strict=True))) for a, b in itertools.pairwise(ends)]
        shape = tuple(item["shape"][()].tolist())
        require(len(rows) == shape[0] and sum(map(len, rows)) == len(values), "a matrix is not what its shape says")
        require(all(0 <= j < shape[1] for j in columns), "a matrix has a column that its shape has not")
        return cls(shape, [{j: v for j, v in row.items() if v} for row in rows])

    @property
    def T(self) -> Matrix:
        """The transposed."""
        rows: list[dict[int, float]] = [{} for _ in range(self.shape[1])]
        for i, row in enumerate(self.rows):
            for j, value in row.items():
                rows[j][i] = value
        return Matrix(self.shape[::-1], rows)

    def digest(self) -> bytes:
        """Return the SHA-256 of its entries, as cpbench takes it."""
        ends = np.concatenate([[0], np.cumsum([len(row) for row in self.rows])]).astype(np.int64)
        h = hashlib.sha256(f"matrix {self.shape[0]} {self.shape[1]};".encode() + ends.tobytes())
        h.update(np.array([j for row in self.rows for j in row], dtype=np.int64).tobytes())
        h.update(np.array([v for row in self.rows for v in row.values()], dtype=np.float64).tobytes())
        return h.digest()


def require(condition: bool, what: str) -> None:
    """Raise ValueError with `what` unless the condition holds."""
    if not condition:
        raise ValueError(what)


def fingerprint(node: str, data: dict[str, Any]) -> str:
    """Return the hash of a problem."""
    h = hashlib.sha256(f"cpbench {node};".encode())
    for name, value in data.items():
        own = value.digest() if isinstance(value, Matrix) else _digest(value)
        h.update(f"{name}:".encode() + own)
    return h.hexdigest()[:32]


def _digest(x: Any) -> bytes:
    if isinstance(x, dict):
        return map_digest(x)
    return hashlib.sha256(f"vector {x.size};".encode() + np.ascontiguousarray(x + 0.0).tobytes()).digest()


def map_digest(arrays: dict[str, Any]) -> bytes:
    """Return the hash of a nonlinear map, as cpbench takes it."""
    sizes = [int(arrays["inputs"]), arrays["constants"].size, arrays["heads"].size, arrays["outputs"].size]
    h = hashlib.sha256("map {} {} {} {};".format(*sizes).encode())
    h.update(np.asarray(arrays["constants"], "<f8").tobytes())
    for name in ("heads", "left", "right", "outputs"):
        h.update(np.asarray(arrays[name], "<i8").tobytes())
    return h.digest()


def seal(group: Any) -> str:
    """Return the SHA-256 of everything in a group but its own attribute `seal`: a change by hand is seen."""
    h = hashlib.sha256()

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            value = np.asarray(item[()])
            h.update(f"{name} {value.dtype.str} {value.shape};".encode() + np.ascontiguousarray(value).tobytes())

    group.visititems(add)
    for name in sorted(group.attrs):
        if name != "seal":
            value = group.attrs[name]
            h.update(f"@{name} {value.decode() if isinstance(value, bytes) else value!s};".encode())
    return h.hexdigest()


def read(path: str) -> tuple[dict[str, Any], dict[str, Any], Any, dict[str, Any]]:
    """Attributes, problem data by name, answer and evidence; raises ValueError where the file was changed."""
    with h5py.File(path, "r") as file:
        group: Any = file["certificate"]
        return parts(group, group["data"])


def parts(group: Any, stored: Any) -> tuple[dict[str, Any], dict[str, Any], Any, dict[str, Any]]:
    """Return the same of a certificate and of the data of its problem; raises ValueError where they were changed."""
    own = {k: v.decode() if isinstance(v, bytes) else v for k, v in group.attrs.items()}
    require(own["format_version"] == 5 and own["node"] in ORDER, "is no certificate that is known here")
    require(own["seal"] == seal(group), "the file was changed after it was written")
    data: dict[str, Any] = {}
    for name in ORDER[own["node"]].split():
        item = stored[name]
        if isinstance(item, h5py.Group) and "heads" in item:
            data[name] = {part: np.asarray(item[part])[()] for part in item}
        else:
            data[name] = item[()] if getattr(item, "ndim", 2) == 1 else Matrix.read(item)
    evidence = {name: item[()] for name, item in group["evidence"].items()}
    answer: Any = np.asarray(group["answer"])
    require(fingerprint(own["node"], data) == own["fingerprint"], "the problem is not the one of the certificate")
    return own, data, answer, evidence
