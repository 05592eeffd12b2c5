"""Making a bundle: what goes into it, and in which order."""

from __future__ import annotations

import json
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cpbench.bench.results.rows import Row
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench_lab.bundle import archive, guide, plan_of_rows, plugins, problems, results
from cpbench_lab.bundle.plugins import Plugins
from cpbench_lab.bundle.problems import Place, Unit

PLAN, GUIDE, REPORT = "plan.toml", "REPRODUCE.md", "report"
MACHINE, VERSIONS = "machine.json", "versions.txt"

Reporter = Callable[[Path, Path, str], object]
"""Writes the report of a results file into a folder, under a title."""


@dataclass(frozen=True)
class BundleOptions:
    """Choices for a bundle. `withhold` : globs of problems that stay out. `builtin` : the folder of the built-in
    problems. `report` : None for a bundle without one."""

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
        folder = Path(temporary)
        rows = results.rows_of(store)
        gathered = plugins.gather(store, rows)
        builtin = problems.shipped(options.builtin) if options.builtin is not None else {}
        places = problems.gather(store, rows, folder, builtin, options.withhold)
        plugins.write(gathered, folder)
        about = _write(store, rows, places, gathered, folder, options)
        if options.report is not None:
            options.report(folder / results.NAME, folder / REPORT, source.stem)
        archive.pack(folder, target, about)
    withheld = [place for place in _unique(places) if place.withheld]
    return BundleSummary(
        pairs=len(rows),
        problems=len(_unique(places)) - len(withheld),
        withheld=len(withheld),
        plugins=len(gathered.loaded),
        bytes=target.stat().st_size,
        remarks=(*_remarks(withheld, gathered), *_restricted(about)),
    )


def _require_target(target: Path, options: BundleOptions) -> None:
    if target.exists() and not options.force:
        raise CpbenchError(f"{target}: exists already: --force replaces it")
    if not target.parent.is_dir():
        raise CpbenchError(f"{target}: there is no folder {target.parent}; make it first")


# ---------------------------------------------------------------------------------------------- the files


def _write(
    store: Store,
    rows: Sequence[Row],
    places: Mapping[Unit, Place],
    found: Plugins,
    folder: Path,
    options: BundleOptions,
) -> dict[str, Any]:
    """Write results, plan, machine, versions and the guide; return what `BUNDLE.json` says beside the files."""
    settings = plan_of_rows.settings(store.meta(), rows)
    new = results.write(store, rows, places, folder / results.NAME, found.names)
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


def _remarks(withheld: Sequence[Place], found: Plugins) -> list[str]:
    """Return what the maker of a bundle should know, a line each."""
    remarks = [
        f"not in the bundle: {count} problems: {why}" for why, count in Counter(p.withheld for p in withheld).items()
    ]
    remarks += [f"not in the bundle: {text}" for text in found.absent]
    return remarks


def _restricted(about: Mapping[str, Any]) -> list[str]:
    return [f"publishing figures of {name} is restricted: {term}" for name, term in sorted(about["restricted"].items())]
