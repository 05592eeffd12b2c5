"""The process that makes the pictures of problems of a page: it reads one file after the other, and may die of one.

It begins when the report does, so it imports little: nothing of tables, nor what draws.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from cpbench import storage
from cpbench.analysis.thumbnails import Thumbnail, thumbnail
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.launch import limit_memory
from cpbench.bench.results.answers import unpack
from cpbench.formulations.base import Problem
from cpbench.foundation import frames
from cpbench.generators import generators
from cpbench.report.text import cut

MEMORY = 2 * 2**30
"""Bytes that the process may take."""
ABOUT = 400
"""Characters of a licence or a source."""

ABSENT = "No file is at the problem's address here, and no generator of this installation makes it."
OTHER = "What is at its address now is another problem than the one that was run."
UNREADABLE = "Its file cannot be read here."


@dataclass(frozen=True)
class Sitter:
    """A problem that is to be portrayed.

    Attributes
    ----------
    place : its address here, '' where there is no file. format : that it was read by, None for whichever fits.
    answer : as kept, b"" of none; with its label and its error.
    """

    fingerprint: str
    place: str
    format: str | None
    family: str
    size: int
    tolerance: float
    answer: bytes = b""
    label: str = ""
    error: float = 0.0


def main(channel: Channel, sitters: Sequence[tuple[Any, ...]]) -> None:
    """Send a message that the process is there, then one a problem."""
    limit_memory(MEMORY)
    warnings.simplefilter("ignore")
    channel.send_bytes(frames.pack({"ready": True}))
    families: dict[str, dict[str, Problem]] = {}
    for fields in sitters:
        one = Sitter(*fields)
        try:
            picture = _picture(one, families)
            json.dumps(picture, allow_nan=False)
        except Exception:  # whatever a file holds: the next one is read
            picture = {"why": UNREADABLE}
        channel.send_bytes(frames.pack({"thumbnail": picture}))


def _picture(one: Sitter, families: dict[str, dict[str, Problem]]) -> Thumbnail:
    if one.place:
        problem = storage.load(one.place, format=one.format)
        if problem.fingerprint != one.fingerprint:
            return {"why": OTHER}
    elif (generated := _generated(one.family, families).get(one.fingerprint)) is not None:
        problem = generated
    else:
        return {"why": ABSENT}
    about = _about(problem)
    if not one.answer:
        return {**thumbnail(problem), **about}
    picture = thumbnail(problem, problem.point_from_vector(unpack(one.answer)), one.tolerance)
    return {**picture, **about, "answer": {"label": one.label, "error": one.error}}


def _about(problem: Problem) -> Thumbnail:
    """Return what the problem says of its licence and its source, cut to what a page has room for."""
    info = problem.info
    picture = {"licence": info.licence, "source": info.source, "citation": info.citation}
    return {name: cut(text, ABOUT) for name, text in picture.items() if text}


def _generated(family: str, families: dict[str, dict[str, Problem]]) -> dict[str, Problem]:
    """Return the problems of the generator of that name, by fingerprint; none where there is no such generator."""
    if family not in families:
        instances = generators.get(family).instances() if family in generators else []
        families[family] = {instance.problem.fingerprint: instance.problem for instance in instances}
    return families[family]
