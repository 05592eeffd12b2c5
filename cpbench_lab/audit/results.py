"""Results of audits: rows of a table, files, a comparison of two files, the figure over time and the worst step."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.errors import CpbenchError, FormatError
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing
from cpbench.storage import save_pack
from cpbench.verification import judge
from cpbench_lab.audit.auditing import Audit, median

HEAD = ["scene", "steps", "broken", "claimed", "worst", "at", "Coulomb", "creep [µm/s]", "angle [deg]"]
"""Columns: steps that break the law, those of them that the engine called converged, the largest error and its step,
medians of the error on Coulomb's law, of creep, and of the angle between friction and sliding."""


def cells(one: Audit) -> list[str]:
    """Return a row below HEAD."""
    c, error = one.columns, one.columns["error"]
    known = np.isfinite(c["converged"]).any()
    counts = [str(error.size), str(int(one.broken.sum())), str(one.claimed) if known else "-"]
    numbers = [f"{float(error.max()):.1e}", str(int(error.argmax()))]
    medians = [f"{median(c['coulomb']):.1e}", f"{1e6 * median(c['creep']):.3g}", f"{median(c['angle']):.2g}"]
    return [one.head["scene"], *counts, *numbers, *(text.replace("nan", "-") for text in medians)]


def read_audits(path: Path) -> list[Audit]:
    """Return the audits of a file of `cpbench audit --json`; raises FormatError."""
    try:
        records = json.loads(path.read_text("utf-8"))
        return [_read(dict(record)) for record in records]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as cause:
        raise FormatError(path, "", f"is no result of cpbench audit --json ({type(cause).__name__}: {cause})") from None


def _read(record: dict[str, Any]) -> Audit:
    columns: Mapping[str, Sequence[float | None]] = record.pop("steps")
    missing = {"error": np.inf}  # no number: the engine had no finite answer
    values = {
        name: np.array([missing.get(name, np.nan) if x is None else x for x in column], dtype=float)
        for name, column in columns.items()
    }
    return Audit(record, values, None, record.pop("where"), record.pop("seconds"))


def compared(old: Sequence[Audit], new: Sequence[Audit]) -> tuple[list[str], bool]:
    """Return the lines that compare two files scene by scene, and whether the second breaks the law at more steps.

    Raises CpbenchError where no scene is in both with the same tolerance and number of steps.
    """
    before, after = ({one.head["scene"]: one for one in audits} for audits in (old, new))
    both = [(before[scene], after[scene]) for scene in before if scene in after]
    like = [pair for pair in both if len({(one.head["tolerance"], one.broken.size) for one in pair}) == 1]
    if not like:
        raise CpbenchError("no scene is in both files with one tolerance and number of steps: nothing is compared")
    counts = [sum(int(pair[side].broken.sum()) for pair in like) for side in (0, 1)]
    names = [" and ".join(sorted({one.engine for one in audits})) for audits in (old, new)]
    worse = [pair[1].head["scene"] for pair in like if pair[1].broken.sum() > pair[0].broken.sum()]
    verdict = f"more in {', '.join(worse)}" if worse else "in no scene more"
    steps = sum(pair[0].broken.size for pair in like)
    lines = [f"{names[1]} breaks its law at {counts[1]} of {steps} steps, {names[0]} at {counts[0]}: {verdict}"]
    for pair in like:
        scene = pair[0].head["scene"]
        lines += [f"  {label:{len(scene)}}  {one.summary()}" for label, one in zip((scene, ""), pair, strict=True)]
    others = sorted((before.keys() | after.keys()) - {pair[0].head["scene"] for pair in like})
    return lines + ([f"  not in both alike, and not compared: {', '.join(others)}"] if others else []), bool(worse)


def write_folder(one: Audit, folder: Path) -> Iterator[Path]:
    """Write the figure over time (SCENE.svg) and the worst island of the worst step with the answer of the engine
    (SCENE-worst.h5), in place of what is there; yield their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = one.head["scene"]
    with canvas.drawing():
        canvas.write(figure(one), folder / f"{scene}.svg")
    yield folder / f"{scene}.svg"
    if one.worst is not None and one.worst.answer.finite:
        pack, name = folder / f"{scene}-worst.h5", f"step-{int(one.columns['error'].argmax()):03d}"
        problem, answer = island(one.worst.problem, one.worst.answer)
        save_pack({name: problem}, pack, solutions={name: answer}, force=True)
        yield pack


def island(P: Any, point: Any) -> tuple[Any, Any]:
    """Return the bodies and contacts of a coneqp with the largest error that touch one another, and the answer there;
    other problems whole."""
    if not isinstance(P, ConeQP):
        return P, point
    n, block, A = P.p.size, P.K.blocks, sp.coo_array(P.A)
    ends = np.concatenate([[A.col, n + block[A.row]], sp.coo_array(P.Q).coords], axis=1)
    size = n + int(block.max(initial=-1)) + 1
    label = connected_components(sp.coo_array((np.ones(ends.shape[1]), ends), shape=(size, size)), directed=False)[1]
    parts: list[tuple[Any, Any]] = []
    for k in np.unique(label):
        x, y = label[:n] == k, label[n:][block] == k
        factors = y[(np.cumsum(P.cone_size) - P.cone_size).astype(int)]
        cones = {name: getattr(P, name)[factors] for name in ("cone_kind", "cone_size", "cone_mu", "cone_mu_r")}
        Q, rows = sp.csr_array(P.Q)[x][:, x], sp.csr_array(P.A)[y][:, x]
        parts.append((ConeQP(Q=Q, p=P.p[x], A=rows, b=P.b[y], **cones), ConeQPPoint(x=point.x[x], y=point.y[y])))
    return max(parts, key=lambda part: judge(*part, 1.0).error)


def figure(one: Audit) -> Drawing:
    """Return the errors over time, on the law of the engine and on Coulomb's."""
    drawn = canvas.page(7.0, 3.2, constrained=True)
    axes, head = drawn.subplots(), one.head
    time = head["dt"] * np.arange(1, one.broken.size + 1)
    for name, label, colour in (("coulomb", "Coulomb's law", canvas.GREY), ("error", "its own law", canvas.BLUE)):
        axes.semilogy(time, np.maximum(one.columns[name], 1e-17), ".", markersize=3, color=colour, label=label)
    claimed = one.broken & (one.columns["converged"] == 1)
    axes.semilogy(time[claimed], one.columns["error"][claimed], "x", color=canvas.RED, label="broken, called converged")
    axes.axhline(head["tolerance"], color=canvas.INK, linewidth=0.8)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("backward error")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    title = canvas.literal(f"{head['engine']} {head['version']}, {head['scene']}")
    guide = f"Error of the answer of each step; {one.summary()}. The line is the tolerance."
    return Drawing(drawn, title, canvas.literal(guide, 400))
