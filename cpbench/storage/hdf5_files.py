"""HDF5 files: one problem in the root, or a pack with a problem in every child group; FCLIB's and our own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import BinaryIO

import h5py

from cpbench.errors import FormatError
from cpbench.formulations import formulations
from cpbench.formulations.base import Point, Problem
from cpbench.storage import fclib, native
from cpbench.storage.base import SEPARATOR, Format, formats, stem
from cpbench.storage.hdf5_points import put_guesses, put_solution
from cpbench.storage.hdf5_tree import SIGNATURE, Tree, new_file, open_tree

SUFFIXES = (".hdf5", ".h5")
_PARTS = {"local": fclib.LOCAL, "global": fclib.GLOBAL, "rolling": fclib.ROLLING}
"""Names of the members of a file that holds a local and a global problem side by side."""


def members_of(root: Tree) -> list[str]:
    """Return the names of the problems under the root: [""] for a root problem; empty when there is none."""
    side_by_side = [name for name, group in _PARTS.items() if group in root]
    if "cpbench" in root or len(side_by_side) == 1:
        return [""]
    if side_by_side:
        return side_by_side
    return [name for name in root.names() if _is_member(root, name)]


def locate(root: Tree, member: str) -> tuple[Tree, str]:
    """Group of the problem `member`, and its FCLIB group ("" for a native one); raises FormatError."""
    # one of many is looked for by its name: reading all would list them as often
    direct = member and "/" not in member and not _is_problem(root) and member in root and _is_member(root, member)
    members = [member] if direct else members_of(root)
    if not members:
        raise root.error("", _nothing(root))
    if not member:
        if len(members) > 1:
            shown = ", ".join(members[:4]) + (", ..." if len(members) > 4 else "")
            raise root.error(
                "", f"holds {len(members)} problems ({shown}): name one, as in {root.path}{SEPARATOR}{members[0]}"
            )
        member = members[0]
    elif member not in members:
        shown = ", ".join(members[:8]) + (", ..." if len(members) > 8 else "")
        what = "is one problem, it has no members" if members == [""] else f"has the members {shown}"
        raise root.error("", f"has no member '{member}': it {what}")
    if member in _PARTS and _PARTS[member] in root:
        return root, _PARTS[member]
    parent = root.child(member) if member else root
    if "cpbench" in parent or not _is_problem(parent):
        return parent, ""
    return parent, next(group for group in _PARTS.values() if group in parent)


def read_problem(root: Tree, member: str) -> Problem:
    """Read the problem `member` of an open file; raises FormatError."""
    parent, group = locate(root, member)
    name = member or stem(root.path)
    return fclib.read(parent, group, name) if group else native.read(parent, name)


def encode_pack(
    problems: Mapping[str, Problem],
    solutions: Mapping[str, Point] | None = None,
    guesses: Mapping[str, Sequence[Point]] | None = None,
    *,
    compress: bool = True,
) -> bytes:
    """Encode a pack: every problem in a separate group, with its solution and starting points.

    Raises FormatError on a name that cannot be one.
    """
    with new_file() as (root, image):
        for name, problem in problems.items():
            if not name or "/" in name or SEPARATOR in name or name in (".", ".."):
                raise FormatError(
                    name or "''", "", f"is not a name for a member: it may not be empty or hold '/' or '{SEPARATOR}'"
                )
            group = root.create_group(name)
            write_problem(group, problem, compress=compress)
            if solutions and name in solutions:
                put_solution(group, problem, solutions[name], {"name": problem.name})
            put_guesses(group, problem, (guesses or {}).get(name, ()))
    return image[0]


class HDF5(Format):
    """Base of the native and the FCLIB format, which differ in content only."""

    suffixes = SUFFIXES
    keeps_provenance = True
    keeps_guesses = True

    def recognises(self, path: Path, head: bytes) -> bool:
        return head.startswith(SIGNATURE) or path.suffix.lower() in self.suffixes

    def in_folder(self, path: Path, head: bytes) -> bool:
        if not self.recognises(path, head):
            return False
        try:
            with open_tree(path) as root:
                return bool(members_of(root)) or "solution" not in root
        except FormatError:
            return True

    def members(self, path: Path) -> list[str]:
        with open_tree(path) as root:
            result = members_of(root)
            if not result:
                raise root.error("", _nothing(root))
            return result

    def load(self, path: Path, member: str) -> Problem:
        with open_tree(path) as root:
            self._require(*locate(root, member))
            return read_problem(root, member)

    def load_any(self, others: Sequence[Format], path: Path, member: str) -> Problem:
        with open_tree(path) as root:
            return read_problem(root, member)

    def write(self, problem: Problem, file: BinaryIO, *, compress: bool, guesses: Sequence[Point] = ()) -> None:
        with h5py.File(file, "w", track_order=False) as root:  # straight into the file: it may be large
            write_problem(root, problem, compress=compress)
            put_guesses(root, problem, guesses)

    def _require(self, parent: Tree, group: str) -> None:
        """Raise FormatError when the problem is not in this format."""


class Native(HDF5):
    name = "native"
    summary = "cpbench's own HDF5: any formulation, with provenance, sequence and contact geometry"

    @property
    def writes(self) -> frozenset[str]:  # pyright: ignore[reportIncompatibleVariableOverride]  (plugins may add nodes)
        return frozenset(formulations.names())

    def _require(self, parent: Tree, group: str) -> None:
        if group:
            raise parent.error("cpbench", f"is missing, expected a native problem: this is one of FCLIB ({group})")


class FCLIB(HDF5):
    name = "fclib"
    summary = "FCLIB's HDF5: frictional contact, local and global, with joints and global rolling"
    writes = frozenset(fclib.GROUPS)
    by_suffix = False  # .h5 is the native format

    def why_not(self, node: str) -> str:
        return {
            "afc": "FCLIB has one coefficient of friction a contact",
            "rfc": "FCLIB has rolling friction in global form alone",
        }.get(node, "")

    def _require(self, parent: Tree, group: str) -> None:
        if not group and not any(name in parent for name in _PARTS.values()):
            raise parent.error(
                "fclib_local", "is missing, and so is fclib_global[_rolling]: expected a problem of FCLIB"
            )


formats.add("native", Native())
formats.add("fclib", FCLIB())


def write_problem(group: h5py.Group, problem: Problem, *, compress: bool) -> None:
    """Write a problem into a group, each node in its schema; raises FormatError."""
    try:
        native.write(group, problem, compress=compress)
    except OverflowError as cause:
        raise FormatError(problem.name or problem.node, "", str(cause)) from None


def _is_member(root: Tree, name: str) -> bool:
    return root.is_group(name) and _is_problem(root.child(name))


def _is_problem(tree: Tree) -> bool:
    return "cpbench" in tree or any(group in tree for group in _PARTS.values())


def _nothing(root: Tree) -> str:
    if "solution" in root:
        return "holds an answer, not a problem"
    return "holds no problem: expected a group cpbench, fclib_local or fclib_global[_rolling]"
