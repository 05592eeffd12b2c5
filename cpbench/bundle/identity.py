"""Who made a run, as far as this machine and the results tell: hosts, users, paths, remotes, values of variables.

What is found here is what an anonymous bundle must not hold. Names that anybody may have (`root`) tell nothing.
"""

from __future__ import annotations

import builtins
import getpass
import keyword
import os
import platform
import re
import shlex
import socket
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cpbench.bench.results.store import Store

ANYBODY = frozenset((
    "admin", "administrator", "app", "build", "centos", "com", "cpbench", "data", "debian", "default", "docker",
    "fedora", "git", "github", "gitlab", "guest", "home", "http", "https", "jenkins", "local", "localdomain",
    "localhost", "main", "master", "me", "net", "nobody", "node", "opt", "org", "origin", "problem", "problems",
    "public", "python", "results", "root", "run", "runner", "shared", "solver", "solvers", "src", "ssh", "temp",
    "test", "tests", "tmp", "ubuntu", "user", "users", "usr", "vagrant", "var", "vm", "work", "workspace",
))  # fmt: skip
"""Names of users, hosts and folders that tell nobody; in a text they mean something else."""
SHORTEST = 3
"""Letters of the shortest name that is looked for."""
_HOME = re.compile(r"(?:/home/|/Users/|\\Users\\)([^/\\\s'\":]+)")
_REMOTE = re.compile(r"(?:\w+://)?(?:(?P<login>[^@/]+)@)?(?P<server>[\w.-]+)(?::\d+)?[:/](?P<path>.+)")
_COMMON = ("github.com", "gitlab.com", "bitbucket.org", "codeberg.org", "huggingface.co", "git.sr.ht")
_PATIENCE = 10.0


@dataclass(frozen=True)
class Identity:
    """Words that would tell who made a run.

    Attributes
    ----------
    hosts, people : names of machines; of users, their mail addresses and accounts. paths : folders of this machine.
    remotes : addresses of repositories. values : of environment variables.
    """

    hosts: tuple[str, ...] = ()
    people: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    remotes: tuple[str, ...] = ()
    values: tuple[str, ...] = field(default=(), repr=False)


def of_run(store: Store, folders: Iterable[Path]) -> Identity:
    """Return who made the run of a results file, and who bundles it; `folders` are those its files lie in."""
    rows = list(store.rows())
    meta = store.meta()
    hosts = {row.host for row in rows if row.host} | set(store.machines())
    hosts |= {platform.node(), socket.gethostname(), os.environ.get("HOSTNAME", "")}
    hosts |= {host.partition(".")[0] for host in hosts}
    addresses = {row.address for row in rows}
    places = {str(Path(address).parent) for address in addresses if os.path.isabs(address)}
    own = {str(folder.resolve()) for folder in folders} | {str(Path.cwd()), str(Path.home()), store_folder(store)}
    paths = own | places | {tempfile.gettempdir()} | _paths_in(str(meta.get("command", "")))
    texts = [*addresses, *own, str(meta.get("command", ""))]
    remotes, people = _repositories(own)
    people |= _users() | {name for text in texts for name in _HOME.findall(text)}
    return Identity(
        hosts=_identifying(hosts),
        people=_identifying(people),
        paths=tuple(sorted(path for path in paths if len(Path(path).parts) > 1)),
        remotes=tuple(sorted(filter(None, remotes))),
        values=_values(),
    )


def store_folder(store: Store) -> str:
    """Return the folder of a results file."""
    return str(store.path.resolve().parent)


def _identifying(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names that tell somebody; one that is a word of Python (`max`) is left where it stands."""
    words = ANYBODY | {*keyword.kwlist, *dir(builtins)}
    return tuple(sorted({n for n in names if len(n) >= SHORTEST and not {n, n.casefold()} & words}))


def _users() -> set[str]:
    names = {os.environ.get(name, "") for name in ("USER", "LOGNAME", "USERNAME", "SUDO_USER")} | {Path.home().name}
    try:
        names.add(getpass.getuser())
        import pwd

        names.add(pwd.getpwuid(os.getuid()).pw_gecos.split(",")[0])
    except (ImportError, KeyError, OSError):
        pass  # no such user here, or a system without accounts
    return names


def _paths_in(command: str) -> set[str]:
    try:
        words = shlex.split(command)
    except ValueError:
        words = command.split()
    return {os.path.dirname(word) for word in words if os.path.isabs(word)}


def _repositories(folders: Iterable[str]) -> tuple[set[str], set[str]]:
    """Return the remotes of the repositories that the folders are in, and whose they are: name, mail, accounts in the
    remotes."""
    remotes: set[str] = set()
    people: set[str] = set()
    for folder in folders:
        for line in _git(folder, "config", "--get-regexp", r"^(remote\..*\.(url|pushurl)|user\.(name|email))$"):
            key, _, value = line.partition(" ")
            if key.startswith("user."):
                people |= {value, value.partition("@")[0]}
            else:
                server, accounts = _remote(value)
                remotes |= {value, value.removesuffix(".git"), server}
                people |= accounts
    return remotes, people


def _remote(address: str) -> tuple[str, set[str]]:
    """Return the server of a remote, '' for one that everybody uses, and the accounts in its path.

    >>> [(server, sorted(names)) for server, names in map(_remote, ["git@github.com:ann/mine.git", "git.a.org:bob/x"])]
    [('', ['ann']), ('git.a.org', ['bob'])]
    >>> sorted(_remote("https://ann:key@git.a.org:80/group/ann/mine")[1])
    ['ann', 'group', 'key']
    """
    found = _REMOTE.fullmatch(address.removesuffix(".git"))
    if found is None:
        return "", set()  # a path
    server = found["server"]
    accounts = {*found["path"].strip("/").split("/")[:-1], *(found["login"] or "").split(":")}
    return ("" if server in _COMMON else server), accounts - {"", "git"}


def _git(folder: str, *arguments: str) -> list[str]:
    try:
        done = subprocess.run(
            ["git", "-C", folder, *arguments], capture_output=True, text=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return []
    return done.stdout.splitlines()


def _values() -> tuple[str, ...]:
    """Return the values of variables that are long enough to be nobody else's words."""
    return tuple(sorted({value for value in os.environ.values() if len(value) >= 8 and not value.isalpha()}))


def of_tables(tables: Mapping[str, Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the values of the variables that declared solvers are started with."""
    return tuple(sorted({v for table in tables.values() for v in (table.get("env") or {}).values() if len(v) >= 4}))
