"""Making a bundle: what goes into it, in which order, and the last look at it."""

from __future__ import annotations

import json
import re
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.bundle import archive, guide, identity, leaks, plan_of_rows, plugins, problems, results
from cpbench.bundle.plugins import Plugins
from cpbench.bundle.problems import Place, Unit
from cpbench.bundle.scrub import Scrub, searched
from cpbench.errors import CpbenchError, UnknownName
from cpbench.solvers.base import solvers

PLAN, GUIDE, REPORT = "plan.toml", "REPRODUCE.md", "report"
TEXTS = (".md", ".csv", ".json", ".tex", ".bib")
MACHINE, VERSIONS = "machine.json", "versions.txt"
"""Modules of the solvers that everybody has who has cpbench."""
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]*")

Reporter = Callable[[Path, Path, str], object]
"""Writes the report of a results file into a folder, under a title."""


@dataclass(frozen=True)
class BundleOptions:
    """Choices for a bundle. `renames` : other names, of solvers and of any word. `withhold` : globs of problems that
    stay out. `builtin` : the folder of the built-in problems. `report` : None for a bundle without one."""

    anonymous: bool = False
    renames: tuple[tuple[str, str], ...] = ()
    withhold: tuple[str, ...] = ()
    builtin: Path | None = None
    report: Reporter | None = None
    force: bool = False


@dataclass(frozen=True)
class BundleSummary:
    """Contents of a bundle. `remarks` : what its maker should know."""

    pairs: int
    problems: int
    withheld: int
    plugins: int
    bytes: int
    remarks: tuple[str, ...]


def make(source: Path, target: Path, options: BundleOptions = BundleOptions()) -> BundleSummary:
    """Bundle the results file `source` as the zip `target`; raises CpbenchError, with nothing written."""
    _require_target(target, options)
    with Store(source) as store, tempfile.TemporaryDirectory(prefix="cpbench-bundle-") as temporary:
        store.audit().require()
        folder = Path(temporary)
        rows = results.rows_of(store)
        found = plugins.gather(store, rows, anonymous=options.anonymous)
        scrub = _scrub(store, rows, found, options)
        builtin = problems.shipped(options.builtin) if options.builtin is not None else {}
        places = problems.gather(store, rows, folder, builtin, options.withhold, scrub)
        if scrub is not None:
            found = _anonymous(found, scrub)
        plugins.write(found, folder)
        about = _write(store, rows, places, found, folder, options, scrub)
        if options.report is not None:
            title = "Results" if scrub is not None else source.stem
            options.report(folder / results.NAME, folder / REPORT, title)
        if scrub is not None:
            _scrub_texts(folder / REPORT, scrub)
            leaks.require_none(folder, searched(scrub.identity, scrub.renames))
        archive.pack(folder, target, about)
    withheld = [place for place in _unique(places) if place.withheld]
    return BundleSummary(
        pairs=len(rows),
        problems=len(_unique(places)) - len(withheld),
        withheld=len(withheld),
        plugins=len(found.loaded),
        bytes=target.stat().st_size,
        remarks=(*_remarks(withheld, found, options), *_restricted(about)),
    )


def _require_target(target: Path, options: BundleOptions) -> None:
    if target.exists() and not options.force:
        raise CpbenchError(f"{target}: exists already: --force replaces it")
    if not target.parent.is_dir():
        raise CpbenchError(f"{target}: there is no folder {target.parent}; make it first")
    if options.renames and not options.anonymous:
        raise CpbenchError("--rename is for --anonymous: a bundle that tells whose it is keeps its names")


# --------------------------------------------------------------------------------------- names and words


def _scrub(store: Store, rows: Sequence[Row], found: Plugins, options: BundleOptions) -> Scrub | None:
    if not options.anonymous:
        return None
    foreign = _foreign(store, rows)
    names = {row.solver.partition("@")[0] for row in rows}
    renames: dict[str, str] = {}
    for old, new in options.renames:
        if old in names - foreign:
            raise CpbenchError(f"--rename {old}={new}: {old} is cpbench's own, and is found by no other name")
        if old not in names and old not in found.sources:
            raise UnknownName("name for --rename: no solver of the results and no plugin has", old, names & foreign)
        if old in names and (not _NAME.fullmatch(new) or new in names):
            raise CpbenchError(
                f"--rename {old}={new}: {new or 'nothing'} is not a free name of a solver: letters, digits, . + -"
            )
        renames[old] = new
    owner = identity.of_run(store, found.folders)
    values = (*owner.values, *identity.of_tables(found.tables))
    return Scrub(identity.Identity(owner.hosts, owner.people, owner.paths, owner.remotes, values), renames)


def _foreign(store: Store, rows: Sequence[Row]) -> set[str]:
    """Return solvers of the rows that are not cpbench's own: from plugins, installed packages, tables of programs."""
    sheets: Mapping[str, Mapping[str, Any]] = store.meta().get("solvers") or {}
    plugged = {str(sheet.get("name")) for sheet in sheets.values() if sheet.get("plugin")}
    own = {solver.spec.name for solver in solvers if solver.origin != "plugin"}
    return {name for name in {row.solver for row in rows} if name in plugged or name not in own}


def _anonymous(found: Plugins, scrub: Scrub) -> Plugins:
    """Return names and texts of the plugins without what tells whose they are."""
    return Plugins(
        loaded=[scrub.name(name) for name in found.loaded],
        names={origin: scrub.name(name) for origin, name in found.names.items()},
        texts={scrub.name(name): scrub.code(source) for name, source in found.texts.items()},
        absent=[scrub.text(text) for text in found.absent],
        tables=found.tables,
        folders=found.folders,
    )


def _scrub_texts(folder: Path, scrub: Scrub) -> None:
    """Scrub what a report adds of its own to the rows: citations, definitions."""
    for path in sorted(path for path in folder.rglob("*") if path.suffix in TEXTS):
        text = path.read_text(encoding="utf-8")
        path.write_text(scrub.name(text), encoding="utf-8")


# ---------------------------------------------------------------------------------------------- the files


def _write(
    store: Store,
    rows: Sequence[Row],
    places: Mapping[Unit, Place],
    found: Plugins,
    folder: Path,
    options: BundleOptions,
    scrub: Scrub | None,
) -> dict[str, Any]:
    """Write results, plan, machine, versions and the guide; return what `BUNDLE.json` says beside the files."""
    meta = store.meta()
    settings = plan_of_rows.settings(meta, rows)
    kept = {"sets": [], **settings, "output": "", "report": None, "shard": [1, 1]}
    new = results.write(store, rows, places, folder / results.NAME, kept, _foreign(store, rows), found.names, scrub)
    ours = [row for row in new if not row.origin and row.status != "not_run"]
    recorded = any(True for _ in store.histories())
    text = plan_of_rows.text(settings, plan_of_rows.sets(ours, recorded, {}), guide.HEADING)
    (folder / PLAN).write_text(text, encoding="utf-8")
    with Store(folder / results.NAME) as bundled:
        bundled_meta = bundled.meta()
        machines = {"machine": bundled_meta.get("machine") or {}, "machines": bundled.machines()}
    (folder / MACHINE).write_text(_json(machines), encoding="utf-8")
    (folder / VERSIONS).write_text(guide.versions(bundled_meta, new), encoding="utf-8")
    unique = _unique(places)
    about = {
        "anonymous": scrub is not None,
        "plugins": found.loaded,
        "absent": found.absent,
        "problems": [asdict(place) for place in unique],
        "pairs": len(ours),
        "statuses": dict(sorted(Counter(row.status for row in ours).items())),
        "seconds": round(plan_of_rows.total_seconds(ours), 1),
        "restricted": {
            str(sheet.get("name")): str(sheet["publishing"])
            for sheet in (bundled_meta.get("solvers") or {}).values()
            if sheet.get("publishing")
        },
    }
    (folder / GUIDE).write_text(guide.text(about, options.report is not None), encoding="utf-8")
    return about


def _unique(places: Mapping[Unit, Place]) -> list[Place]:
    return sorted({place.address: place for place in places.values()}.values(), key=lambda place: place.address)


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def _remarks(withheld: Sequence[Place], found: Plugins, options: BundleOptions) -> list[str]:
    """Return what the maker of a bundle should know, a line each."""
    remarks = [
        f"not in the bundle: {count} problems: {why}" for why, count in Counter(p.withheld for p in withheld).items()
    ]
    remarks += [f"not in the bundle: {text}" for text in found.absent]
    if options.anonymous and found.texts:
        remarks.append(
            f"read what the bundle tells of you before you send it: comments and citations in {len(found.texts)} "
            "plugin files are kept but for known names"
        )
    for old, _ in options.renames:
        left = [name for name, source in found.texts.items() if old.casefold() in source.casefold()]
        if left:
            remarks.append(f"'{old}' is still a part of longer words in {', '.join(sorted(left))}: --rename WORD=NAME")
    return remarks


def _restricted(about: Mapping[str, Any]) -> list[str]:
    return [f"publishing figures of {name} is restricted: {term}" for name, term in sorted(about["restricted"].items())]
