"""Running a bundle again: what it would run is shown before, the plan is read with suspicion, the rest is a run.

Nothing of a bundle is executed before its user agreed to each plugin. A plan that names more than problems of the
bundle and solvers by name (a program, a cluster, a file elsewhere) is refused: `cpbench bundle` writes none.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.execution import open_run
from cpbench.bench.planned_run import RoundObserver
from cpbench.bench.planning import plan_file, run_plan
from cpbench.bench.planning.assembly import Assembly, Reading
from cpbench.bench.planning.run_plan import BUILTIN, RunPlan
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, UnknownName
from cpbench.registry import PLUGIN_FILES
from cpbench.storage.base import split_address
from cpbench_lab.bundle import archive, plugins, problems, results
from cpbench_lab.bundle.agreement import Agreement, agree
from cpbench_lab.bundle.archive import BundleError
from cpbench_lab.bundle.making import PLAN
from cpbench_lab.bundle.plan_of_rows import PARTS, SETTINGS

AGAIN = "again.sqlite"


@dataclass(frozen=True)
class Bundle:
    """An unpacked bundle: its zip, its folder, what `BUNDLE.json` says."""

    path: Path
    folder: Path
    about: Mapping[str, Any]

    @property
    def results(self) -> Path:
        return self.folder / results.NAME

    @property
    def again(self) -> Path:
        return self.folder / AGAIN

    @property
    def loaded(self) -> list[str]:
        """Names of the plugin files, in the order in which they are loaded."""
        return list(self.about["plugins"])

    def code(self) -> list[tuple[str, str, int]]:
        """Return (name, SHA-256, bytes) of every file that may be executed: plugins, and the scripts beside them."""
        files: Mapping[str, Mapping[str, Any]] = self.about["files"]
        return [
            (name, str(sheet["sha256"]), int(sheet["bytes"]))
            for name, sheet in sorted(files.items())
            if name.startswith(f"{plugins.FOLDER}/")
        ]

    def programs(self) -> list[str]:
        """Return what the tables among the plugins start; raises BundleError where they are none."""
        result: list[str] = []
        for name in self.loaded:
            if name.endswith(".toml"):
                try:
                    result += plugins.programs((self.folder / name).read_text(encoding="utf-8"))
                except (ValueError, AttributeError, TypeError) as cause:
                    raise BundleError(self.path, f"{name} is not a file of tables [solver.NAME] ({cause})") from None
        return result


def open_bundle(path: Path, folder: Path) -> Bundle:
    """Unpack and check the bundle at `path`; raises CpbenchError, on one without results too."""
    about = archive.unpack(path, folder)
    files: Mapping[str, Any] = about["files"]
    for name in (results.NAME, PLAN):
        if name not in files:
            raise BundleError(path, f"has no {'results' if name == results.NAME else 'plan'}: {name} is not in it")
    loaded = about.get("plugins")
    if not isinstance(loaded, list) or not all(isinstance(name, str) and name in files for name in loaded):
        raise BundleError(path, "is a damaged bundle: it names plugins that are not in it")
    if not isinstance(about.get("problems"), list):
        raise BundleError(path, "is a damaged bundle: it does not say what its problems are")
    bundle = Bundle(path, folder, about)
    with Store(bundle.results) as store:
        results.rows_of(store)
    return bundle


def adopt(bundle: Bundle, candidates: Sequence[str]) -> int:
    """Take problems that the bundle was made without from files of its user; how many."""
    wanted: dict[str, list[str]] = {}
    for place in bundle.about["problems"]:
        if place.get("withheld") and archive.is_plain(str(place["address"])):
            wanted.setdefault(str(place["fingerprint"]), []).append(str(place["address"]))
    return problems.adopt(candidates, wanted, bundle.folder)


def load_plugins(bundle: Bundle) -> None:
    """Load the plugins, here and by all processes of the run: after everybody agreed, before any solver is
    looked up."""
    if bundle.loaded:
        before = [path for path in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if path]
        os.environ[PLUGIN_FILES] = os.pathsep.join([*before, *plugins.paths(bundle.loaded, bundle.folder)])


def plan(bundle: Bundle, jobs: int | None = None) -> tuple[RunPlan, list[str]]:
    """Return the plan of a bundle, for the solvers that are here, and the names of those that are not.

    Raises BundleError on a plan that cpbench bundle does not write, CpbenchError when nothing of it can be run here.
    """
    path = bundle.folder / PLAN
    try:
        manifest = tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as cause:
        raise BundleError(bundle.path, f"{PLAN} is not valid TOML: {cause}") from None
    parts = manifest.pop("set", [])
    manifest.pop("report", None)
    _require_known(bundle, "", manifest, SETTINGS)
    missing: list[str] = []
    sets: list[dict[str, Any]] = []
    for part in parts if isinstance(parts, list) else [parts]:
        _require_known(bundle, "[[set]] ", part, PARTS)
        known = _solvers(bundle, part.get("solvers"), missing)
        if known:
            read = {key: _read(bundle, key, value) for key, value in part.items() if key not in ("solvers", "problems")}
            sets.append({**read, "solvers": known, "problems": _addresses(bundle, part.get("problems"))})
    if not sets:
        raise CpbenchError(f"{bundle.path}: none of its solvers is here: {', '.join(sorted(set(missing)))}")
    top = {key: _read(bundle, key, value) for key, value in manifest.items()}
    given = {"output": str(bundle.again), "report": None, "keep": "all", **({"jobs": jobs} if jobs else {})}
    return run_plan.make(given, top, sets), sorted(set(missing))


def _require_known(bundle: Bundle, place: str, table: Any, keys: Collection[str]) -> None:
    if not isinstance(table, dict):
        raise BundleError(bundle.path, f"{PLAN}: {place}is not a table: nothing was run")
    for key in table:
        if key not in keys:
            raise BundleError(bundle.path, f"{PLAN}: {place}{key}: no bundle has that: nothing was run")


def _read(bundle: Bundle, key: str, value: Any) -> Any:
    try:
        return plan_file.check(key, value)
    except CpbenchError as cause:
        raise BundleError(bundle.path, f"{PLAN}: {key}: {cause}") from None


def _solvers(bundle: Bundle, texts: Any, missing: list[str]) -> tuple[str, ...]:
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise BundleError(bundle.path, f"{PLAN}: solvers: is not a list of names: nothing was run")
    known: list[str] = []
    for text in texts:
        try:
            known += plan_file.check("solvers", [text])
        except UnknownName:
            missing.append(text)
    return tuple(known)


def _addresses(bundle: Bundle, texts: Any) -> tuple[str, ...]:
    """Return addresses below the folder of the bundle, or built in."""
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise BundleError(bundle.path, f"{PLAN}: problems: is not a list of files: nothing was run")
    found: list[str] = []
    for text in texts:
        file, _ = split_address(text)
        if not archive.is_plain(file.as_posix()):
            raise BundleError(bundle.path, f"{PLAN}: problems: '{text}' is not in the bundle: nothing was run")
        found.append(text if file.parts[0] == BUILTIN else str(bundle.folder / text))
    return tuple(found)


def run(
    bundle: Bundle, plan: RunPlan, builtin: Callable[[], Path], observer: RoundObserver, reading: Reading
) -> Assembly:
    """Run the pairs of the plan that the bundle has results of, into its folder; the same call goes on with a run that
    was interrupted. Raises CpbenchError where no pair of them can be run here."""
    with Store(bundle.results) as store:
        wanted = {row.key for row in store.rows() if row.status != "not_run" and not row.origin}
    with open_run(plan, builtin, reading) as opened:
        opened.keep(wanted)
        if not opened.assembly.pairs:
            why = f" ({opened.assembly.refused[0][1]})" if opened.assembly.refused else ""
            raise CpbenchError(f"{bundle.path}: none of its pairs can be run here{why}")
        opened.execute(opened.open_results(expel=False), observer, f"cpbench reproduce {bundle.path.name}")
    return opened.assembly


def compare(bundle: Bundle, found: Assembly) -> Agreement:
    """Return what of the statuses of a bundle holds here."""
    with Store(bundle.results) as before, Store(bundle.again) as again:
        now = {row.key: row for row in again.rows()}
        here = {survey.fingerprint for survey in found.surveys}
        return agree(before.rows(), now, here)
