"""The audit of an engine: its steps one after the other, each with the verdict on its answer."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.errors import CpbenchError, FormatError, ProblemError
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation.matrices import Vector
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing
from cpbench.storage import save_pack
from cpbench.verification import error_text, judge
from cpbench.verification.contacts import contact_error
from cpbench.verification.linear import distances, sizes_of
from cpbench.verification.rows import ROWS, System
from cpbench.verification.stacked import judge_beside
from cpbench_lab.audit.engine import Engine, EngineStep, engines

CHUNK = 50
"""Steps that are taken before they are judged."""
STICKS = 0.99
"""Share of μ r_N up to which a contact counts as sticking; a slipping one has more."""
LOADED = 1e-6
"""Share of the largest reaction of the step from which a contact counts as loaded."""
NAMED = 4
"""Contacts and bodies that are named."""
COLUMNS = ("error", "coulomb", "converged", "iterations", "contacts", "creep", "angle")
SCENES = Path(__file__).parent / "scenes"


@dataclass(frozen=True, eq=False)
class Audit:
    """Outcome of the steps of an engine on a scene.

    Attributes
    ----------
    head : engine, version, scene, options, law, dt, tolerance. columns : a number for each step: `error` on the law of
    the engine, `coulomb` on Coulomb's, `converged` (1, 0, NaN where the engine says nothing), `iterations`, `contacts`,
    `creep` (largest sliding speed of a contact that sticks [m/s]), `angle` (largest angle between sliding and friction
    [deg]); NaN where there is none. worst : the step with the largest error; None without steps. where : what its error
    is at. seconds : of the engine, of judging its law, of all else.
    """

    head: Mapping[str, Any]
    columns: Mapping[str, Vector]
    worst: EngineStep | None
    where: str
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def broken(self) -> Any:
        """Whether each step breaks the law, (steps,)."""
        return ~(self.columns["error"] <= self.head["tolerance"])

    @property
    def claimed(self) -> int:
        """How many of the broken steps the engine called converged."""
        return int((self.broken & (self.columns["converged"] == 1)).sum())

    @property
    def engine(self) -> str:
        """The engine with its version and options."""
        options = "".join(f" {name}={value}" for name, value in self.head["options"].items())
        return f"{self.head['engine']} {self.head['version']}{options}"

    def record(self) -> dict[str, Any]:
        """Return all but the worst step, as JSON takes it."""
        columns = {name: [x if math.isfinite(x) else None for x in v.tolist()] for name, v in self.columns.items()}
        return {**self.head, "where": self.where, "seconds": dict(self.seconds), "steps": columns}

    def summary(self) -> str:
        """Return how many steps break the law, how many of these were called converged, and the worst."""
        error, broken = self.columns["error"], self.broken
        says = "" if np.isfinite(self.columns["converged"]).any() else "; the engine does not say what converged"
        text = f"{int(broken.sum())} of {error.size} steps break the engine's own law at {self.head['tolerance']:g}"
        if broken.any():
            text += f", {self.claimed} of these were called converged" if not says else ""
        if error.size:
            text += f"; worst {error_text(float(error.max()))} at step {int(error.argmax())}, {self.where}"
        return text + says

    def lines(self) -> Iterator[str]:
        """Yield the summary, and what was measured beside it."""
        yield self.summary()
        head, c = self.head, self.columns
        yield f"  {self.engine}, {head['scene']}, dt {head['dt']:g} s; law: {head['law']}"
        yield f"  error on that law: median {median(c['error']):.1e}; a step breaks it above {head['tolerance']:g}"
        yield f"  error on Coulomb's law of the same contacts: median {median(c['coulomb']):.1e}"
        if np.isfinite(c["creep"]).any():
            yield f"  creep of contacts that stick: median {1e6 * median(c['creep']):.3g} µm/s"
        if np.isfinite(c["angle"]).any():
            yield f"  friction against sliding: median {median(c['angle']):.2g} degrees off"
        iterations = f"median {median(c['iterations']):.0f}, most {c['iterations'].max(initial=0):.0f}"
        yield f"  contacts: median {median(c['contacts']):.0f}; iterations: {iterations}"
        times = (f"{name} {1e3 * s / max(c['error'].size, 1):.2g} ms" for name, s in self.seconds.items())
        yield f"  time of a step: {', '.join(times)}"


def median(values: Vector) -> float:
    """Return the median of what are numbers, NaN where there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else math.nan


def audit(
    engine: str,
    scene: str | Path,
    *,
    steps: int = 1000,
    options: Mapping[str, str] | None = None,
    tolerance: float = 1e-6,
) -> Audit:
    """Return the audit of so many steps of an engine on a scene.

    Parameters
    ----------
    engine : mujoco, or of a plugin. scene : a file of the engine, or the name of a scene that ships.
    options : of the engine. tolerance : the error from which on a step breaks the law.

    Raises UnknownName, Unavailable where the engine is not installed, CpbenchError on a scene or option.
    """
    path = shipped(str(scene))
    running = engines.get(engine)(path, options or {})
    rows: list[dict[str, float]] = []
    worst: tuple[float, EngineStep | None] = (-1.0, None)
    seconds = dict.fromkeys(("engine", "judging", "Coulomb's law"), 0.0)
    while len(rows) < steps:
        start = time.perf_counter()
        count = min(CHUNK, steps - len(rows))
        taken = list(_taken(running, count))
        seconds["engine"] += time.perf_counter() - start
        if taken:
            start = time.perf_counter()
            errors = measured(taken, tolerance)
            seconds["judging"] += time.perf_counter() - start
            start = time.perf_counter()
            rows += [{"error": e, **row} for e, row in zip(errors, beside(taken, tolerance), strict=True)]
            seconds["Coulomb's law"] += time.perf_counter() - start
            first = int(np.argmax(errors))
            worst = max(worst, (float(errors[first]), taken[first]), key=lambda pair: pair[0])
        if len(taken) < count:
            rows.append({**dict.fromkeys(COLUMNS, math.nan), "error": math.inf})
            worst = math.inf, None
            break
    head = {
        "engine": engine, "version": running.version, "scene": path.stem, "options": dict(options or {}),
        "law": running.law, "dt": running.dt, "tolerance": tolerance,
    }  # fmt: skip
    columns = {name: np.array([row[name] for row in rows]) for name in COLUMNS}
    return Audit(head, columns, worst[1], _where(worst[1], running), seconds)


def _taken(engine: Engine, count: int) -> Iterator[EngineStep]:
    """Yield so many steps, fewer where a state has a number that is none."""
    for _ in range(count):
        try:
            yield engine.step()
        except ProblemError:  # its data are not finite
            return


def shipped(scene: str) -> Path:
    """Return the file of a scene; raises FormatError where there is none."""
    for path in (Path(scene), SCENES / f"{scene}.xml"):
        if path.is_file():
            return path
    raise FormatError(scene, "", f"is no file, nor a scene that ships: {', '.join(scenes())}")


def scenes() -> list[str]:
    """Return the names of the scenes that ship."""
    return sorted(path.stem for path in SCENES.glob("*.xml"))


def measured(steps: Sequence[EngineStep], tolerance: float) -> Vector:
    """Return the errors of answers on the laws of their engine: side by side where that decides, else one by one."""
    errors = np.full(len(steps), tolerance)
    if not {"r"} < steps[0].problem.point_sizes.keys():  # errors of bodies and joints have no owner side by side
        errors = judge_beside([s.problem for s in steps], [s.answer for s in steps], tolerance).error
    for k in np.flatnonzero((errors > 0.5 * tolerance) & np.isfinite(errors)):
        verdict = judge(steps[k].problem, steps[k].answer, tolerance)
        errors[k] = 0.0 if "unresolvable" in verdict.flags else verdict.error
    return errors


def beside(steps: Sequence[EngineStep], tolerance: float) -> Iterator[dict[str, float]]:
    """Yield what is measured beside the error, for each step."""
    with_law = [k for k, s in enumerate(steps) if s.contacts is not None and s.contacts.nc and s.reactions.finite]
    coulomb = np.full(len(steps), math.nan)
    if with_law:
        given = [steps[k] for k in with_law]
        coulomb[with_law] = judge_beside([s.contacts for s in given], [s.reactions for s in given], tolerance).error
    for k, step in enumerate(steps):
        converged = math.nan if step.converged is None else float(step.converged)
        row = {"coulomb": float(coulomb[k]), "converged": converged, "iterations": float(step.iterations)}
        yield {**row, "contacts": step.reactions.r.size / 3, **_motion(step)}


def _motion(step: EngineStep) -> dict[str, float]:
    """Return the largest sliding speed of sticking contacts, and the largest angle of friction at sliding ones."""
    P, nothing = step.contacts, {"creep": math.nan, "angle": math.nan}
    if P is None or not P.nc or not step.reactions.finite:
        return nothing
    r, u = step.reactions.r.reshape(-1, 3), (P.W @ step.reactions.r + P.q).reshape(-1, 3)
    friction, sliding = np.linalg.norm(r[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    rubs = (r[:, 0] > LOADED * r[:, 0].max()) & (P.mu > 0)
    sticks, slips = (rubs & (friction <= STICKS * P.mu * r[:, 0])), (rubs & (friction > STICKS * P.mu * r[:, 0]))
    against = -np.einsum("ij,ij->i", r[slips, 1:], u[slips, 1:])
    cosine = np.clip(against / np.maximum(friction[slips] * sliding[slips], 1e-300), -1.0, 1.0)
    return {
        "creep": float(sliding[sticks].max()) if sticks.any() else math.nan,
        "angle": float(np.degrees(np.arccos(cosine)).max()) if slips.any() else math.nan,
    }


def _where(step: EngineStep | None, engine: Engine) -> str:
    """Return the contacts and bodies at which the verdict has at least half of the largest of its distances."""
    if step is None or not step.answer.finite:
        return "not finite"
    system: Any = ROWS[step.problem.node](step.problem, step.answer)
    with np.errstate(all="ignore"):
        if isinstance(system, System):
            layout, block = system.frame.layout, system.frame.block
            missed = distances(system, layout, sizes_of(system, layout, system.frame.terms @ system.sizes))
            missed, owners = missed if block is None else missed[block], step.owners
        else:  # contacts come last in the answer, and first among the errors
            missed = np.repeat(contact_error(system).errors[: step.reactions.r.size // 3], 3)
            owners = step.owners[step.owners.size - missed.size :]
    owners = [int(k) for k in owners[: missed.size][missed >= 0.5 * missed.max(initial=0.0)]]
    of_contacts = sorted({k for k in owners if k >= 0})
    names = sorted({engine.names[-1 - k] for k in owners if k < 0})
    texts = [f"contacts {', '.join(map(str, of_contacts[:NAMED]))}"] if of_contacts else []
    texts += [f"bodies {', '.join(names[:NAMED])}"] if names else []
    return "; ".join(texts)


# -------------------------------------------------------------------------------------------------------------- results

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
