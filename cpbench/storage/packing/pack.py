"""Problems and sequences from loose files, written as one file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from cpbench import storage
from cpbench.errors import FormatError
from cpbench.formulations import LCP, MLCP, QP, FrictionContact, GlobalFrictionContact, Problem
from cpbench.storage.base import require_new
from cpbench.storage.half_stored import Half
from cpbench.storage.hdf5_files import SUFFIXES
from cpbench.storage.packing import parts, steps
from cpbench.storage.packing.parts import Part

PARTS: Mapping[str, Sequence[str]] = {
    **{kind.node: tuple(kind.shapes()) for kind in (LCP, MLCP, FrictionContact)},
    QP.node: "Qp",
    GlobalFrictionContact.node: ("M", "H", "f", "w", "mu"),
    "game": "AB",
    "least_squares": "Ab",
    "boxed": ("A", "b", "lo", "hi", "findex"),
}
"""Names of the matrices and vectors of a formulation or an application, in the order of its files."""
CONSTRAINTS: Mapping[str, Sequence[str]] = {"inequality": "Ab", "equality": "Cd", "bounds": ("lb", "ub")}
"""The same for the constraints of a quadratic program."""


def problem_from_files(
    node: str, files: Mapping[str, Path], axes: str | None, name: str, half: Half | None = None
) -> Problem:
    """Return the problem whose matrices and vectors stand in files.

    Parameters
    ----------
    node : a formulation of PARTS. files : by the name of the part. axes : order of the rows of a contact (NTT, TTN, NT
    or TN), None for the normal first. name : of the problem. half : the triangle that the files hold of symmetric
    matrices, None for both.

    Raises FormatError with the file whose shape does not fit the others.
    """
    return parts.build(node, {part: _read(node, part, file) for part, file in files.items()}, axes, name, half)


def pack_sequence(
    output: Path,
    name: str,
    dt: float,
    node: str,
    files: Mapping[str, Path],
    known: Mapping[str, Path],
    axes: str | None = None,
    *,
    force: bool = False,
) -> tuple[str, str]:
    """Write a sequence of contact problems; returns its sizes, and a remark where contacts are matched by their order.

    Parameters
    ----------
    dt : size of a step [s]. node : fc, gfc, or problems, whose file is a folder, a glob or a pack of problem files.
    files : a folder, glob or array for each part. known : the same for `ids` and `positions` of contacts.

    Raises FormatError where the files do not have equally many steps or cannot be read.
    """
    if output.suffix.lower() not in SUFFIXES:
        raise FormatError(output, "", f"a sequence is HDF5: expected a name that ends in {' or '.join(SUFFIXES)}")
    require_new(output, force)
    recorder = storage.Recorder(name, dt)
    if node == "problems":
        steps.record_problems(recorder, files["problems"], known)
    else:
        steps.record(recorder, node, files, known, axes)
    recorder.save(output, force=force)
    counts = [step.nc for step in recorder.steps]
    sizes = f"{recorder.steps[0].node}: {len(counts)} steps, {min(counts)} to {max(counts)} contacts"
    if all(step.contacts is not None and step.contacts.count for step in recorder.steps if step.nc):
        return sizes, ""
    cold = ", and are cold where their number changes" if min(counts) < max(counts) else ""
    return sizes, f"starts from the step before match contacts by their order{cold}"


def _read(node: str, part: str, file: Path) -> Part:
    read = storage.read_matrix if parts.is_matrix(node, part) else storage.read_vector
    return Part(file, read(file))
