"""Messages between the runner and its processes: a JSON header and named vectors, never pickle.

A worker may have been corrupted by the solver it ran; nothing it sends is executed.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpbench.bench.processes.channel import WireError

_LENGTH = struct.Struct("<I")
_encode = json.JSONEncoder(default=vars).encode


HEADER = 2**20
"""Bytes of a header that are read of a process that ran foreign code: to parse a gigabyte of JSON takes minutes."""


def pack(header: Mapping[str, Any], vectors: Mapping[str, Any] | None = None) -> bytes:
    """Header (JSON, non-finite floats allowed, dataclasses as objects) followed by the raw vectors, or by bytes.

    >>> import numpy as np
    >>> header, vectors = unpack(pack({"claim": "solved"}, {"z": np.array([1.0, 2.0])}))
    >>> header["claim"], vectors["z"].tolist()
    ('solved', [1.0, 2.0])
    """
    raw = {name: v if isinstance(v, bytes) else _float_bytes(v) for name, v in (vectors or {}).items()}
    listed = [[name, len(raw[name]), isinstance(v, bytes)] for name, v in (vectors or {}).items()]
    head = _encode({**header, "vectors": listed}).encode()
    return b"".join([_LENGTH.pack(len(head)), head, *raw.values()])


def unpack(message: bytes, header_bytes: float = math.inf) -> tuple[dict[str, Any], dict[str, Any]]:
    """Unpack; raises WireError when `message` is malformed, or its header longer than `header_bytes`."""
    try:
        (length,) = _LENGTH.unpack_from(message)
        if length > header_bytes:
            raise ValueError(f"a header of {length} bytes, over the limit of {header_bytes:g}")
        header = json.loads(message[4 : 4 + length])
        if not isinstance(header, dict):
            raise ValueError(f"a header of type {type(header).__name__}")
        at, vectors = 4 + length, dict[str, Any]()
        for name, size, is_bytes in header.pop("vectors"):
            part = memoryview(message)[at : at + int(size)]
            vectors[str(name)] = bytes(part) if is_bytes else np.frombuffer(part, np.float64)
            at += int(size)
        if at != len(message):
            raise ValueError(f"{len(message) - at} bytes left over")
    except (struct.error, ValueError, KeyError, TypeError, RecursionError, OverflowError) as cause:
        raise WireError(f"malformed message of {len(message)} bytes: {cause}") from None
    return header, vectors


def _float_bytes(vector: Any) -> bytes:
    return np.ascontiguousarray(vector, dtype=np.float64).tobytes()
