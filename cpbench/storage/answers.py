"""Answers: candidates that stand in a problem file, and files of their own. None is believed, all are measured.

An answer file is HDF5 with `/solution`: the parts of the point, the slacks as they follow from it (FCLIB's u),
and the attributes solver, claim, verdict, residual, tolerance, cpbench_version, node and fingerprint of the
problem it answers. Bare vectors (.npy, .npz, .csv, .txt) are the parts one after the other; of a problem that was made
of a game, of least squares or of a boxed LCP they may be the unknowns of that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from cpbench.errors import FormatError, PointError
from cpbench.formulations.base import Point, Problem, formulations
from cpbench.formulations.primal import primal_alone, primal_of, primal_part
from cpbench.foundation import extensions
from cpbench.storage.arrays import read_npz, read_vector
from cpbench.storage.base import read_head, split_address, write_atomic
from cpbench.storage.hdf5_files import SUFFIXES, locate, members_of, read_problem, write_problem
from cpbench.storage.hdf5_points import put_guesses, put_point, put_solution, read_point
from cpbench.storage.hdf5_tree import SIGNATURE, Tree, new_file, open_tree


def solution(address: str | Path) -> tuple[Any, dict[str, Any]] | None:
    """Return the candidate in `/solution` of a problem file, or an answer file's point, with its attributes.

    None when the file has none (text and NumPy formats never do). Raises FormatError when it does not have the
    shape of its problem's answers.
    """
    path, member = split_address(address)
    if path.is_dir() or not _is_hdf5(path):
        return None
    with open_tree(path) as root:
        if not members_of(root):
            if "solution" not in root:
                return None
            return _answer(root.child("solution"))
        parent, _ = locate(root, member)
        if "solution" not in parent:
            return None
        problem, tree = read_problem(root, member), parent.child("solution")
        return _read_point(tree, problem), tree.attributes()


def guesses(address: str | Path) -> list[Any]:
    """Return the starting points in `/guesses`, in order; [] when the file has none. Raises FormatError."""
    path, member = split_address(address)
    if path.is_dir() or not _is_hdf5(path):
        return []
    with open_tree(path) as root:
        parent, _ = locate(root, member)
        if "guesses" not in parent:
            return []
        problem, tree = read_problem(root, member), parent.child("guesses")
        count = tree.integer("number_of_guesses")
        present = len(tree.names()) - 1
        if not 0 <= count <= present:
            raise tree.error("number_of_guesses", f"is {count}, the file holds {present}")
        return [_read_point(tree.child(str(k)), problem) for k in range(1, count + 1)]


def save_answer(
    path: str | Path,
    problem: Problem,
    point: Point,
    attrs: Mapping[str, Any],
    *,
    force: bool = False,
    with_problem: bool = False,
    guesses: Sequence[Point] = (),
) -> None:
    """Write an answer file for `problem`; raises PointError on an answer of the wrong shape, FormatError.

    `with_problem` puts the problem beside its answer: a converted problem can then be lifted from this one file.
    `guesses` are starting points for solvers.
    """
    for candidate in (point, *guesses):
        problem.check_point(candidate)
    with new_file() as (root, image):
        if with_problem:
            write_problem(root, problem, compress=True)
        put_solution(root, problem, point, {"name": problem.name, **attrs})
        put_guesses(root, problem, guesses)
    write_atomic(Path(path), image[0], force=force)


def save_point(
    path: str | Path, point: Point, *, node: str, fingerprint: str, attrs: Mapping[str, Any], force: bool = False
) -> None:
    """Write an answer file for a problem that is not at hand, known by its node and fingerprint."""
    with new_file() as (root, image):
        put_point(root, point, {**attrs, "node": node, "fingerprint": fingerprint})
    write_atomic(Path(path), image[0], force=force)


def load_answer(path: str | Path, problem: Problem, *, primal: bool = False) -> Any:
    """Load the answer to `problem` in a file; raises FormatError when it is of another problem or not of its shape.

    With `primal`, an answer without its multipliers is one too, and comes as a `Primal`.
    """
    file, member = split_address(path)
    if _is_hdf5(file):
        return _load_hdf5(file, member, problem, primal)
    try:
        if file.suffix.lower() == ".npz":
            arrays = read_npz(file)
            named = extensions.hook("own_answer")(problem, {name: np.ravel(array) for name, array in arrays.items()})
            if named is not None:
                problem.check_point(named)
                return named
            sizes = problem.point_sizes
            if len(arrays) > 1 and (extra := sorted(arrays.keys() - sizes.keys())):
                cause = f"is no part of an answer to {problem.node}: {', '.join(sizes)}"
                raise FormatError(file, ", ".join(extra), cause)
            if all(name in arrays for name, size in sizes.items() if size):
                point = problem.point_type(**{name: arrays.get(name, np.zeros(0)) for name in sizes})
                problem.check_point(point)
                return point
            if primal and primal_alone(problem, arrays):
                return primal_part(problem, arrays[problem.primal])
            if len(arrays) != 1:
                raise FormatError(file, "", f"holds {', '.join(arrays)}: expected one array, or {', '.join(sizes)}")
        vector = read_vector(file)
        return (primal_of(problem, vector) if primal else None) or problem.point_from_vector(vector)
    except PointError as cause:
        raise FormatError(file, "", str(cause)) from None


def save_vector(point: Point, path: Path, *, force: bool) -> bool:
    """Write the parts of `point` one after the other when `path` is .npy, .csv or .txt; return whether it is.

    Raises FormatError when the file exists, unless `force`, or cannot be written.
    """
    if path.suffix not in (".npy", ".csv", ".txt"):
        return False

    def put(file: BinaryIO) -> None:
        if path.suffix == ".npy":
            np.save(file, point.vector, allow_pickle=False)
        else:
            np.savetxt(file, point.vector, fmt="%.17g")

    write_atomic(path, put, force=force)
    return True


def _is_hdf5(path: Path) -> bool:
    return read_head(path).startswith(SIGNATURE) or path.suffix.lower() in SUFFIXES


def _load_hdf5(path: Path, member: str, problem: Problem, primal: bool) -> Any:
    with open_tree(path) as root:
        parent = root if not members_of(root) else locate(root, member)[0]
        if "solution" not in parent:
            raise root.error("solution", "is missing: the file holds no answer")
        tree = parent.child("solution")
        attributes = tree.attributes()
        node, fingerprint = attributes.get("node"), attributes.get("fingerprint")
        if fingerprint is None and members_of(root):
            other = read_problem(root, member)
            node, fingerprint = other.node, other.fingerprint
        if node is not None and node != problem.node:
            raise tree.error(
                "@node", f"is the answer to a problem of type {node}, asked was one of type {problem.node}"
            )
        if fingerprint is not None and fingerprint != problem.fingerprint:
            raise tree.error(
                "@fingerprint",
                f"is the answer to another problem ({fingerprint[:12]}), asked was {problem.name or problem.node} "
                f"({problem.fingerprint[:12]})",
            )
        if primal and primal_alone(problem, tree.names()):
            try:
                return primal_part(problem, tree.array(problem.primal))
            except PointError as cause:
                raise tree.error(problem.primal, str(cause)) from None
        return _read_point(tree, problem)


def _read_point(tree: Tree, problem: Problem) -> Any:
    point = read_point(tree, problem.point_type)
    try:
        problem.check_point(point)
    except PointError as cause:
        raise tree.error("", str(cause)) from None
    return point


def _answer(tree: Tree) -> tuple[Any, dict[str, Any]]:
    attributes = tree.attributes()
    node = str(attributes.get("node", ""))
    if node not in formulations:
        raise tree.error("@node", f"is '{node}', expected the formulation that is answered")
    kind = formulations.get(node).point_type
    return read_point(tree, kind), attributes
