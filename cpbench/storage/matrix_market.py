"""A problem as a folder of Matrix Market files, addressed by its problem.json: what the exchange `mtx` writes."""

from __future__ import annotations

from pathlib import Path

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.storage.base import Format, formats, no_member


class MatrixMarketFolder(Format):
    """M.mtx, q.mtx, ... beside problem.json, which says which formulation they are of."""

    name = "mtx"
    summary = "a folder of Matrix Market files, addressed by the problem.json in it"
    suffixes = (".json",)

    def recognises(self, path: Path, head: bytes) -> bool:
        from cpbench.storage.exchanges.header import HEADER

        return path.name == HEADER and any(path.parent.glob("*.mtx"))

    def load(self, path: Path, member: str) -> Problem:
        from cpbench.storage.exchanges.mtx import MatrixMarket

        no_member(path, member)
        problem = MatrixMarket().read_problem(path.parent)
        for file in self.beside(path):
            if file.stem not in problem.data():
                known = ", ".join(problem.data())
                raise FormatError(path, file.name, f"is no array of {problem.node} ({known}): rename or remove it")
        return problem

    def beside(self, path: Path) -> list[Path]:
        return sorted(path.parent.glob("*.mtx"))


formats.add("mtx", MatrixMarketFolder())
