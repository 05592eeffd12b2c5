"""Siconos text files (.dat): which problem stands in one, and writing them.

A file of Siconos carries no word of its kind. One is accepted when exactly one layout (`siconos_linear`,
`siconos_contact`) reads it to its last number (`Cursor.finish` says what may follow); its name and its folder are no
evidence. Two kinds cannot be detected: an AVI, whose polyhedron has no place in the file, is written like an LCP,
and rolling friction in the plane like plasticity of old. What we write ends with a line that names its format, which
Siconos does not read and we do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from cpbench.errors import FormatError
from cpbench.formulations import (
    FrictionContact,
    GlobalFrictionContact,
    GlobalRollingFrictionContact,
    RollingFrictionContact,
)
from cpbench.formulations.base import Problem
from cpbench.storage.base import Format, formats, no_member
from cpbench_problems.formats.siconos_contact import contact_reader, is_plasticity
from cpbench_problems.formats.siconos_linear import (
    Builder,
    read_avi,
    read_lcp,
    read_mlcp,
    read_mlcp_old,
    read_relay,
    read_soclcp,
)
from cpbench_problems.formats.siconos_matrix import SIGNED, Cursor
from cpbench_problems.formats.siconos_write import (
    write_avi,
    write_fc,
    write_gfc,
    write_lcp,
    write_mlcp,
    write_relay,
    write_soclcp,
)


class SiconosText(Format):
    """One kind of problem in a .dat file.

    `dimension` is that of the problems, where they have one. `guessed`: whether a file may be of this kind without
    saying so. `also`: what else has this layout; a file that fits is then refused unless it or the caller says so.
    """

    suffixes = (".dat",)

    def __init__(
        self,
        kind: str,
        node: str,
        readers: tuple[Callable[[Cursor], Builder], ...],
        write: Callable[[Any], str],
        dimension: int | None = None,
        *,
        guessed: bool = True,
        also: str = "",
    ) -> None:
        # one class, many formats: what a Format declares on its class is set on the instance
        self.name = f"siconos-{kind.partition(',')[0].lower()}"  # type: ignore[misc]
        self.summary, self.writes = f"Siconos text: {kind}", frozenset({node})  # type: ignore[misc]
        self.readers, self._write, self.dimension = readers, write, dimension
        self.guessed, self.also = guessed, also

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == ".dat"

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        fitting, refusals = _attempt(Cursor(path), [self])
        if not fitting:
            raise max(refusals, key=lambda refusal: refusal[0])[2]
        return fitting[0][1]()

    def load_any(self, others: Sequence[Format], path: Path, member: str) -> Problem:
        no_member(path, member)
        kinds = [f for f in (self, *others) if isinstance(f, SiconosText)]
        c = Cursor(path, guess=True)
        signed = next((f for f in kinds if c.signature == f.name), None)
        if signed is not None:
            return signed.load(path, member)
        fitting, refusals = _attempt(c, [f for f in kinds if f.guessed])
        names = sorted({kind.name for kind, _ in fitting} | {kind.also for kind, _ in fitting if kind.also})
        if len(fitting) == 1 and len(names) == 1:
            return fitting[0][1]()
        if fitting:
            raise FormatError(path, "", f"fits the layouts of {' and '.join(names)}: say which with --format")
        if is_plasticity(c.again()):
            raise FormatError(path, "", "is a plasticity problem: no formulation of this version has it")
        _, name, cause = max(refusals, key=lambda refusal: refusal[0])
        raise FormatError(
            path, cause.field, f"{cause.cause} (no Siconos layout fits to its last number, nearest {name})"
        )

    def holds(self, problem: Problem) -> bool:
        return super().holds(problem) and getattr(problem, "dimension", None) == self.dimension

    def encode(self, problem: Problem, *, compress: bool) -> bytes:
        if getattr(problem, "dimension", None) != self.dimension:
            raise FormatError(problem.name or problem.node, "dimension", f"does not fit {self.name}")
        return f"{self._write(problem)}{SIGNED} {self.name}\n".encode("ascii")


def _attempt(
    c: Cursor, kinds: Sequence[SiconosText]
) -> tuple[list[tuple[SiconosText, Builder]], list[tuple[int, str, FormatError]]]:
    """Return the readers that come to the file's last number, and the refusals of the others with how far they came."""
    fitting: list[tuple[SiconosText, Builder]] = []
    refusals: list[tuple[int, str, FormatError]] = []
    for kind in kinds:
        for reader in kind.readers:
            attempt = c.again()
            try:
                fitting.append((kind, reader(attempt)))
            except FormatError as cause:
                refusals.append((attempt.at, kind.name, cause))
    return fitting, refusals


for _format in (
    SiconosText("LCP", "lcp", (read_lcp,), write_lcp),
    SiconosText("AVI, without its set", "avi", (read_avi,), write_avi, guessed=False),
    SiconosText("MLCP", "mlcp", (read_mlcp, read_mlcp_old), write_mlcp),
    SiconosText("relay", "relay", (read_relay,), write_relay),
    SiconosText("SOCLCP", "soclcp", (read_soclcp,), write_soclcp),
    *(SiconosText(f"FC{d}D, local", "fc", (contact_reader(FrictionContact, d),), write_fc, d) for d in (2, 3)),
    *(
        SiconosText(f"GFC{d}D, global", "gfc", (contact_reader(GlobalFrictionContact, d),), write_gfc, d)
        for d in (2, 3)
    ),
    SiconosText("RFC3D, local rolling", "rfc", (contact_reader(RollingFrictionContact, 5),), write_fc, 5),
    SiconosText(
        "RFC2D, local rolling",
        "rfc",
        (contact_reader(RollingFrictionContact, 3),),
        write_fc,
        3,
        also="plasticity as older files have it",
    ),
    *(
        SiconosText(
            f"GRFC{(d + 1) // 2}D, global rolling",
            "grfc",
            (contact_reader(GlobalRollingFrictionContact, d),),
            write_gfc,
            d,
        )
        for d in (3, 5)
    ),
):
    formats.add(_format.name, _format)
