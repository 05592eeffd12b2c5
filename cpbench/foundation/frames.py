"""A header and arrays as one piece of bytes: messages, kept histories, problems on their way, the data of a page.

    length of the header (uint32, little-endian) | header (JSON, UTF-8) | array | array | ...

The header lists the arrays under `vectors`: name, size in bytes, and type (little-endian, as NumPy writes it; null for
plain bytes). With an alignment, blanks after the header and zeros after each array let every array begin at a multiple
of it. Nothing is unpickled: the sender of the bytes may have run foreign code.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Collection, Mapping
from typing import Any

FLOATS = frozenset({"<f8"})
NUMBERS = FLOATS | {"<f4", "|u1", "<u2", "<u4", "<i4", "<i8"}
"""Types of arrays that a reader may allow."""
UNTRUSTED_HEADER = 2**20
"""Bytes of a header that are read of a process that ran foreign code: to parse a gigabyte of JSON takes minutes."""
_LENGTH = struct.Struct("<I")
_encode = json.JSONEncoder(default=vars, separators=(",", ":")).encode
_encode_finite = json.JSONEncoder(default=vars, separators=(",", ":"), allow_nan=False).encode


class FrameError(ValueError):
    """Refusal of bytes that are not a frame."""


def pack(header: Mapping[str, Any], arrays: Mapping[str, Any] | None = None, aligned: int = 1) -> bytes:
    """Return the frame of a header (dataclasses as objects, non-finite floats allowed) and arrays of float64, or bytes.

    >>> import numpy as np
    >>> header, arrays = unpack(pack({"claim": "solved"}, {"z": np.array([1.0, 2.0])}))
    >>> header["claim"], arrays["z"].tolist()
    ('solved', [1.0, 2.0])
    """
    import numpy as np  # here, for processes begin before it is imported (`bench.processes.launch`)

    whole = {name: a if isinstance(a, bytes) else np.asarray(a, np.float64) for name, a in (arrays or {}).items()}
    return b"".join(parts(header, whole, aligned))


def parts(header: Mapping[str, Any], arrays: Mapping[str, Any], aligned: int = 1, *, finite: bool = False) -> list[Any]:
    """Return the same in parts, arrays with their types, so that large ones are written without a copy.

    finite : whether the header is for a reader that knows no NaN; raises ValueError where it has one.
    """
    import numpy as np

    listed: list[tuple[str, int, str | None]] = []
    contents: list[Any] = []
    for name, a in arrays.items():
        if isinstance(a, bytes):
            listed.append((name, len(a), None))
            contents.append(a)
        else:
            kind = a.dtype.newbyteorder("<")
            listed.append((name, a.nbytes, kind.str))
            contents.append(np.ascontiguousarray(a, kind).data)
    head = (_encode_finite if finite else _encode)({**header, "vectors": listed}).encode()
    if aligned > 1:
        head += b" " * (-(len(head) + 4) % aligned)
    written: list[Any] = [_LENGTH.pack(len(head)), head]
    for content, (_, size, _) in zip(contents, listed, strict=True):
        written.append(content)
        if padding := -size % aligned:
            written.append(bytes(padding))
    return written


def unpack(
    data: Any, header_bytes: float = math.inf, types: Collection[str] = FLOATS, aligned: int = 1
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the header and the arrays, which share the memory of `data`; plain bytes are copied.

    Raises FrameError where `data` is malformed, its header longer than `header_bytes`, or an array not of one of the
    `types`.
    """
    import numpy as np

    whole = memoryview(data)
    try:
        (length,) = _LENGTH.unpack_from(whole)
        if length > header_bytes:
            raise ValueError(f"a header of {length} bytes, over the limit of {header_bytes:g}")
        at = 4 + length
        header = json.loads(bytes(whole[4:at]))
        if not isinstance(header, dict):
            raise ValueError(f"a header of type {type(header).__name__}")
        arrays = dict[str, Any]()
        for name, size, kind in header.pop("vectors"):
            part = whole[at : at + int(size)]
            if kind is not None and kind not in types:
                raise ValueError(f"an array of type {kind!s:.20}")
            arrays[str(name)] = bytes(part) if kind is None else np.frombuffer(part, kind)
            at += int(size) + -int(size) % aligned
        if at != len(whole):
            raise ValueError(f"{len(whole) - at} bytes left over")
    except (struct.error, ValueError, KeyError, TypeError, RecursionError, OverflowError) as cause:
        raise FrameError(f"malformed frame of {len(whole)} bytes: {cause}") from None
    return header, arrays
