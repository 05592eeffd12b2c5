"""The long run: `python tests/invariance/long_run.py --cases 100000 --seed 1` prints every failure, the sums after
each seed, and a table, which has what was seen until then if the run is interrupted."""

from __future__ import annotations

import argparse
import itertools
import sys
import warnings
from collections import Counter

from judges import BROKEN, COMPONENTWISE, cpbench_judge
from rewritten import PAIRS, examine

JUDGES = {
    "cpbench": cpbench_judge,
    "componentwise": COMPONENTWISE,
    **{name: broken.judge for name, broken in BROKEN.items()},
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0, help="the first seed; each is one problem of every pair")
    parser.add_argument("--judge", choices=sorted(JUDGES), default="cpbench")
    parser.add_argument("--node", default="", help="variants that begin so")
    parser.add_argument("--invariance", default="", help="invariances that begin so")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    chosen = [(v, i) for v, i in PAIRS if v.startswith(given.node) and i.startswith(given.invariance)]
    counts, failed = Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    seed = given.seed
    try:
        for seed in itertools.count(given.seed):
            for pair in chosen:
                count, failures = examine(JUDGES[given.judge], *pair, seed)
                counts[pair] += count
                failed[pair] += len(failures)
                for failure in failures:
                    print(failure, flush=True)
            print(f"seed {seed}: {counts.total()} verdicts, {failed.total()} wrong until now", flush=True)
            if counts.total() >= given.cases or not counts.total():
                break
    except KeyboardInterrupt:
        print(f"interrupted in seed {seed}")
    for pair in chosen:
        if counts[pair]:
            print(f"{pair[0]:14} {pair[1]:24} {counts[pair]:7} verdicts {failed[pair]:6} wrong")
    print(f"{counts.total()} verdicts, {failed.total()} wrong, seeds {given.seed} to {seed}")
    return 1 if failed.total() or counts.total() < given.cases else 0


if __name__ == "__main__":
    sys.exit(main())
