#!/usr/bin/env bash
# Compares two builds of a solver: the build of this checkout and that of the commit from which it branched. Both run on
# the same problems in one interleaved run of cpbench. The base runs twice, which shows the noise of this machine. Then
# `cpbench compare` gives the verdict. A finding is run once more by itself, and counts only if it appears again.
#
#     compare.sh --solver FILE --base REF [--build COMMAND] [...]        in a git checkout
#
#   --solver FILE       the plugin of the solver: .toml or .py
#   --base REF          a branch, tag or commit; the base is the commit where HEAD left it
#   --build COMMAND     makes the solver, in bash at the top of each checkout; default: nothing to make
#   --python PATH       for a solver in Python: the interpreter that its build made, as .venv/bin/python
#   --problems WORDS    files, folders, globs or names that `cpbench run` takes, or a plan (.toml); default: builtin
#   --timeout TIME      of one solve; default: 10s
#   --budget TIME       of the whole run; pairs not reached by then are left out and reported; default: 10m
#   --repeats N         solves of a pair that takes less than 1 s; default: 5
#   --fail-on WORDS     findings for which the exit code is 1; default: regression,wrong,crash
#   -o, --output FOLDER for summary.md, results.sqlite, variants.toml (the solver of this checkout, for commands that run
#                       a pair again) and NAME.json of each solver; default: cpbench-compare
#
# Paths are relative to the top of the checkout. The exit code is 0; 1 for a finding that --fail-on names; 2, with the
# reason, when there is no verdict. On GitHub it also writes the summary of the job and the outputs `verdict`, `results`.
set -euo pipefail

solver='' base='' build='' python='' problems=builtin timeout=10s budget=10m repeats=5
fail_on=regression,wrong,crash output=cpbench-compare
shown="${GITHUB_STEP_SUMMARY:-/dev/null}" told="${GITHUB_OUTPUT:-/dev/null}"

die() { # the reason
  echo "cpbench: $1" >&2
  printf '### cpbench: no verdict\n\n%s\n' "$1" >> "$shown"
  exit 2
}

export PYTHONSAFEPATH=1 # no import finds a file of the checkout by its name alone

logged() { # a command; its output goes to the log of the job; if it fails, the last line becomes the reason
  "$@" 2>&1 | tee "$work/log" >&2
}

last_words() { tail -n 1 "$work/log" | sed 's/^cpbench: //' | cut -c 1-400; }

# ------------------------------------------------------------------------------------------------ the arguments
while [ $# -gt 0 ]; do
  case $1 in
    --solver | --base | --build | --python | --problems | --timeout | --budget | --repeats | --fail-on | --output)
      name=${1#--} ;;
    -o) name=output ;;
    *) die "compare.sh: no option '$1'; its first lines list them" ;;
  esac
  [ $# -ge 2 ] || die "compare.sh: $1 needs a value"
  printf -v "${name//-/_}" %s "$2"
  shift 2
done

# ------------------------------------------------------------------------------------------------ the checks
[ -n "$solver" ] || die 'compare.sh: say --solver FILE, the plugin of your solver (.toml or .py)'
[ -n "$base" ] || die 'compare.sh: say --base REF, the branch or commit to compare with'
python3 -c 'import cpbench' 2> /dev/null || die 'python3 finds no cpbench: pip install cpbench'
known='import sys; from cpbench.cli.compare_command import FAILURES; print(*({*sys.argv[1].split(",")} - {*FAILURES, ""}))'
unknown=$(python3 -c "$known" "$fail_on")
[ -z "$unknown" ] || die "no outcome '$unknown' for --fail-on: regression, inconclusive, or statuses as wrong,crash"
top=$(git rev-parse --show-toplevel 2>&1) || die "no git checkout here ($top)"
cd "$top"
[ -f "$solver" ] || die "no file '$solver' in this checkout: say --solver with its path from the top"
deep='check out with its whole history (GitHub: fetch-depth: 0 for actions/checkout; GitLab: GIT_DEPTH: "0")'
shallow=$(git rev-parse --is-shallow-repository)
if ! commit=$(git rev-parse --quiet --verify "$base^{commit}"); then
  [ "$shallow" = false ] || die "no commit '$base' here, the clone is shallow: $deep"
  die "no commit '$base' here: fetch it first, or say another --base"
fi
if ! before=$(git merge-base HEAD "$commit"); then
  [ "$shallow" = false ] || die "where HEAD left '$base' is not known here, the clone is shallow: $deep"
  die "HEAD and '$base' have no commit in common: say another --base"
fi
after=$(git rev-parse HEAD)
work=$(mktemp -d)
cleared() { # a verdict leaves variants.toml too, which the commands of the summary name
  git worktree remove --force "$work/base" 2> /dev/null || true
  rm -rf "$work"
  [ -f "$output/summary.md" ] || { rm -f "$output/variants.toml"; rmdir "$output" 2> /dev/null || true; }
}
trap cleared EXIT
rm -f "$output"/{summary.md,variants.toml,results.sqlite*,*.json} # of an earlier comparison

# ------------------------------------------------------------------------------------------------ both builds
made() { # label, folder, commit
  [ -n "$build" ] || return 0
  echo "cpbench: building $1" >&2
  (cd "$2" && logged env CPBENCH_BUILD="$1" bash -euo pipefail -c "$build") ||
    die "the build of $1 (${3:0:12}) failed with exit code $?: \`$(paste -sd ';' <<< "$build")\`: $(last_words)"
}

variants() { # label, folder
  python3 -m cpbench.solvers.external.builds "$1" "$2" "$solver" ${python:+--python "$python"} \
    > "$work/$1.toml" 2> "$work/log" || { cat "$work/log" >&2; die "$1: $(last_words)"; }
  sed -n "s/^\[solver\.\"\(.*\)@$1\"\]\$/\1/p" "$work/$1.toml" | sort > "$work/$1.names"
}

git worktree add --quiet --detach "$work/base" "$before" 2> "$work/log" || die "git worktree: $(last_words)"
[ ! -f .gitmodules ] || git -C "$work/base" submodule --quiet update --init --recursive
made head "$top" "$after"
variants head "$top"
if [ -f "$work/base/$solver" ]; then
  made base "$work/base" "$before"
  variants base "$work/base"
  variants again "$work/base"
else
  touch "$work"/{base,again}.{toml,names}
fi
mapfile -t both < <(comm -12 "$work/base.names" "$work/head.names")
mapfile -t fresh < <(comm -13 "$work/base.names" "$work/head.names")
cat "$work"/{base,again}.toml > "$work/others.toml"
mkdir -p "$output"
cp "$work/head.toml" "$output/variants.toml"

# ------------------------------------------------------------------------------------------------ one run
asked=(--plugin "$solver" --plugin "$output/variants.toml" --timeout "$timeout" --repeats "$repeats")
[ ! -s "$work/others.toml" ] || asked+=(--plugin "$work/others.toml")
case $problems in
  *.toml) asked+=(--plan "$problems") ;;
  *) read -ra words <<< "$problems"; asked+=(--plan none "${words[@]}") ;;
esac
for name in "${both[@]}"; do asked+=(-s "$name@base" -s "$name@again" -s "$name@head"); done
statuses=unavailable
if [ ${#both[@]} = 0 ]; then # nothing to compare with; wrong answers and crashes are found all the same
  for name in "${fresh[@]}"; do asked+=(-s "$name@head"); done
  statuses+=$(tr , '\n' <<< "$fail_on" | sed -e '/^regression$/d' -e '/^inconclusive$/d' -e '/^$/d' -e 's/^/,/' | tr -d '\n')
fi
needed='' # to run a command of the summary again
case $solver in
  *.py)
    needed="$top/$(dirname "$solver"):$top/src:$top"
    PYTHONPATH="$needed${PYTHONPATH:+:$PYTHONPATH}" && export PYTHONPATH ;;
esac
code=0
logged timeout --foreground --signal INT --kill-after 60 "$budget" \
  python3 -m cpbench run "${asked[@]}" --fail-on "$statuses" --no-report --quiet -o "$work/results.sqlite" || code=$?
case $code in
  0 | 1) ;;
  124 | 130 | 137) [ -f "$work/results.sqlite" ] || die "the budget of $budget was used up before the first solve" ;;
  *) die "the run ended with $code: $(last_words)" ;;
esac
if absent=$(grep '^not available: ' "$work/log"); then
  die "a build cannot run: $(sed 's/^not available: //' <<< "$absent" | paste -sd ';')"
fi
count='
import sys
from pathlib import Path
from cpbench.bench.results.store import Store
with Store(Path(sys.argv[1])) as store:
    counts = store.counts()
idle = {name: counts.pop(name) for name in ("not_run", "unsupported") if name in counts}
print(sum(counts.values()), idle.get("not_run", 0))
'
read -r solves left <<< "$(python3 -c "$count" "$work/results.sqlite")"
[ "$solves" != 0 ] || [ "$left" = 0 ] || die "the budget of $budget was used up before the first solve"
[ "$solves" != 0 ] || die "none of the problems is for this solver: say others with --problems"

# ------------------------------------------------------------------------------------------------ the verdict
mkdir -p "$work/out"
changed=''
git diff --quiet HEAD || changed=' with changes that are not committed'
{
  echo "\`$solver\`: base ${before:0:12}, head ${after:0:12}$changed."
  [ "$left" = 0 ] || echo "The budget of $budget was used up: $left of $((solves + left)) solves had no turn."
  [ -z "$needed" ] || echo "Commands that run a pair again import from this checkout: \`export PYTHONPATH=$needed\` first."
  [ ${#fresh[@]} = 0 ] || echo "Only head has ${fresh[*]}: nothing to compare with."
} > "$work/out/summary.md"
verdict=new
if [ ${#both[@]} = 0 ]; then
  if [ "$code" = 1 ]; then verdict=failed; else code=0; fi
  { echo; grep -E '^[0-9]+ pairs: ' "$work/log" || true; } >> "$work/out/summary.md"
else
  code=0 verdict=''
  for name in "${both[@]}"; do
    one=0
    logged python3 -m cpbench compare "$work/results.sqlite" --a "$name@base" --b "$name@head" \
      --noise "$name@base,$name@again" ${fail_on:+--fail-on "$fail_on"} \
      -o "$work/$name.md" -o "$work/out/$name.json" || one=$?
    [ "$one" -le 1 ] || die "$name: the comparison ended with $one: $(last_words)"
    [ "$one" = 0 ] || code=1
    { echo; cat "$work/$name.md"; } >> "$work/out/summary.md"
    verdict+=$(python3 -c 'import json, sys; print(json.load(sys.stdin)["verdict"])' < "$work/out/$name.json")' '
  done
  for worst in same improved inconclusive regressed; do case $verdict in *$worst*) said=$worst ;; esac; done
  verdict=$said
fi
mv "$work/out"/* "$work"/results.sqlite* "$output"/
cat "$output/summary.md" >> "$shown"
printf '%s\n' "verdict=$verdict" "results=$output" >> "$told"
cat "$output/summary.md"
echo "cpbench: $verdict; $output has the results" >&2
exit $code
