"""The table of the page, of files of audit --json: python table.py mujoco-4.0.0.json mujoco-4.0.1.json bullet.json."""

from __future__ import annotations

import sys
from pathlib import Path

from cpbench_lab.audit.auditing import cells, read_audits, scenes

audits = {Path(name).stem: {one.head["scene"]: one for one in read_audits(Path(name))} for name in sys.argv[1:]}
versions = {name: next(iter(one.values())).head for name, one in audits.items()}
print("| scene |", " | ".join(f"{head['engine']} {head['version']}" for head in versions.values()), "|")
print("|---|" + "---|" * len(audits))
for scene in scenes():
    row = [scene]
    for name in audits:
        if scene not in audits[name]:
            row.append("–")
            continue
        _, _, broken, claimed, worst, _, coulomb, creep, angle = cells(audits[name][scene])
        row.append(f"**{broken}** ({claimed}), {worst}; {coulomb}, {creep}, {angle}")
    print("|", " | ".join(row), "|")
