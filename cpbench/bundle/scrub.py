"""Texts without what tells who wrote them, and with solvers under other names: the same words everywhere.

paths      absolute ones become <path>, whoever's they are
hosts      machine-1, machine-2, ...
people     anonymous
remotes    <remote>
renames    whole words: `mine` is renamed in `mine@head` and `mine[omega=1]`, not in `mine-fast` or `determined`
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

from cpbench.bundle.identity import SHORTEST, Identity

PATH, PERSON, REMOTE = "<path>", "anonymous", "<remote>"
_ROOTS = (
    "home|Users|root|tmp|var|opt|usr|mnt|media|srv|data|scratch|work|private|Volumes|nfs|export|lustre|gpfs|run|etc"
)
_REST = r"[^\s'\"`:;,(){}<>|\]\[]*"
_ANY_PATH = re.compile(rf"(?<![\w.>/)\]|-])(?:~|[A-Za-z]:)?[\\/](?=[\w.~-])[^\s'\"`:;,(){{}}<>|\]\[/\\]+[\\/]{_REST}")
_PLAIN_PATH = re.compile(rf"(?<![\w.>/)\]])(?:/(?:{_ROOTS})/|[A-Za-z]:\\|~/){_REST}")
_MAIL = re.compile(r"[\w.+-]+@[\w-]+(?:\.[\w-]+)+")


class Scrub:
    """Replacements that an anonymous bundle makes in texts.

    Parameters
    ----------
    who : what must not be told. renames : old name -> new name.
    """

    def __init__(self, identity: Identity, renames: Mapping[str, str]) -> None:
        self.identity, self.renames = identity, dict(renames)
        self.machines = {host: f"machine-{k}" for k, host in enumerate(sorted(set(identity.hosts)), 1)}
        literal = dict.fromkeys(identity.remotes, REMOTE) | dict.fromkeys(identity.paths, PATH)
        self._literal = _replacing(literal, "", rf"(?:[\\/]{_REST})?")
        words = dict.fromkeys(identity.people, PERSON) | self.machines
        self._words = _replacing(words, r"(?<![A-Za-z0-9])", r"(?![A-Za-z0-9])", re.IGNORECASE)
        self._renamed = _replacing(renames, r"(?<![\w.-])", r"(?![\w-])")
        self._values = _replacing(dict.fromkeys(identity.values, "…"), "", "")

    def name(self, text: str) -> str:
        """Return a name: of a problem, a set, a label, a file."""
        return self._renamed(self._words(text))

    def text(self, text: str) -> str:
        """Return a text for readers: a message, a description."""
        bare = _ANY_PATH.sub(PATH, self._literal(text))
        return self.name(_MAIL.sub(PERSON, self._values(bare)))

    def code(self, text: str) -> str:
        """Return a text that a program reads: paths are replaced where they begin as those of machines do, values
        stay."""
        return self.name(_MAIL.sub(PERSON, _PLAIN_PATH.sub(PATH, self._literal(text))))

    def deep(self, value: Any, how: Callable[[str], str] | None = None) -> Any:
        """Return all texts in lists and tables, their keys too."""
        how = how or self.text
        if isinstance(value, str):
            return how(value)
        if isinstance(value, Mapping):
            return {self.name(str(key)): self.deep(item, how) for key, item in value.items()}
        return [self.deep(item, how) for item in value] if isinstance(value, list | tuple) else value

    def host(self, name: str) -> str:
        """Return a machine by number, also one whose name tells nobody."""
        return self.machines.setdefault(name, f"machine-{len(self.machines) + 1}") if name else ""


def _replacing(words: Mapping[str, str], before: str, after: str, flags: int = 0) -> Callable[[str], str]:
    """Return a function that replaces the words, the longest first."""
    known = {(word.casefold() if flags else word): new for word, new in words.items() if len(word) >= 1}
    if not known:
        return lambda text: text
    longest = sorted(known, key=lambda word: (-len(word), word))
    pattern = re.compile(f"{before}({'|'.join(map(re.escape, longest))}){after}", flags)
    return lambda text: pattern.sub(lambda found: known[found[1].casefold() if flags else found[1]], text)


def searched(identity: Identity, renamed: Mapping[str, str]) -> dict[str, str]:
    """Return what is looked for in a finished bundle, with what it is."""
    kinds = {
        "a host": identity.hosts,
        "a user": identity.people,
        "a path": identity.paths,
        "a remote": identity.remotes,
    }
    found = {text: kind for kind, texts in kinds.items() for text in texts if len(text) >= SHORTEST}
    return found | {name: "a solver that was renamed" for name in renamed if len(name) >= SHORTEST}
