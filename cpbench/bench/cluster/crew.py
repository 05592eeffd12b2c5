"""A crew on many machines: Dask lends them, a station on each runs the same lane as here, and this process gives out
the blocks, takes the outcomes in and keeps account of the workers that are lost.

Dask carries messages and tells who is there. Who does what is decided here: a task is meant for one worker and is
never done by another, so that it is known which pairs were at work when a worker died.
"""

from __future__ import annotations

import contextlib
import logging
import math
import os
import queue
import threading
import time
import uuid
from asyncio import CancelledError as AsyncCancelled
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError as FutureCancelled
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import cpbench
from cpbench import storage
from cpbench.bench.block import Block, Ending, Notice
from cpbench.bench.cluster import keeper
from cpbench.bench.cluster.parcel import pack_blocks, read_outcome
from cpbench.bench.outcome import Outcome
from cpbench.bench.planning.plan import Pair
from cpbench.bench.processes import wire
from cpbench.bench.staff import Setting
from cpbench.errors import CpbenchError
from cpbench.registry import DECLARED, PLUGIN_FILES, TABLES
from cpbench.storage.base import split_address

logger = logging.getLogger("cpbench.bench")

TASK = 2.0
"""Seconds after which a task ends and what is left of it comes back: one that is lost costs little, and those who
come late find work."""
GUESS, MEMORY = 0.1, 0.3
"""Seconds a pair may take, before any did; and how much the last task counts in what is expected of the next."""
MOST = 1000
"""Pairs of one task, however short they are."""
LOOK = 0.5
"""Seconds between two looks at which workers are there."""
PATIENCE = 30.0
"""Seconds a worker that is there may take to hand over a result."""
PARTING = 5.0
"""Seconds in which workers are to end what they are at, when a run ends."""
LONELY = 10.0
"""Seconds without any worker after which that is said."""
LARGE = 2**20
"""Bytes of a message from which on it goes to the worker directly, past the scheduler's tables."""
FREIGHT = 2**26
"""Bytes of copied files beyond which a task takes no further block."""


@dataclass
class _Post:
    """A Dask worker, as it is known here.

    Attributes
    ----------
    identity : of its process, once it has answered. blocks : given to it and not sent. sent : the parts at work,
    each with the block that it is the beginning of. since : when they were sent. suspect : whether they were at work
    when a worker died. copies : whether it does not see our files. files : those it has copies of.
    """

    address: str
    identity: str = ""
    host: str = ""
    future: Any = None
    blocks: list[Block] = field(default_factory=list)
    sent: list[tuple[Block, Block]] = field(default_factory=list)
    since: float = 0.0
    suspect: bool = False
    copies: bool = False
    files: set[str] = field(default_factory=set)

    @property
    def pairs(self) -> list[Pair]:
        """The pairs at work, in their order."""
        return [pair for part, _ in self.sent for pair in part.pairs]


class Cluster:
    """The crew behind a Dask scheduler. Use as a context manager; `close` ends what `ending` names too."""

    reference: Setting | None = None

    def __init__(self, client: Any, setting: Setting, ending: Iterable[Callable[[], None]] = ()) -> None:
        self.machines: dict[str, dict[str, Any]] = {}
        self._client = client
        self._ending = (client.close, *ending)
        self._opening = _opening(setting)
        self._run = uuid.uuid4().hex
        self._forget()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the scheduler, and end what was started with it."""
        for end in self._ending:
            with contextlib.suppress(Exception):  # what is lost need not be closed
                end()

    def outcomes(self, todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome, str]]:
        """What comes of every pair, and where; raises CpbenchError when nobody is or will be there to run them."""
        self._notice = notice
        self._todo.extend((block, False) for block in todo)
        left = sum(len(block.pairs) for block in todo)
        try:
            while left:
                self._turn(0.0 if self._ready else LOOK)
                if self._ready:
                    left -= 1
                    yield self._ready.popleft()
        finally:
            self._stop()

    def _forget(self) -> None:
        self._posts: dict[str, _Post] = {}
        self._refused: dict[str, str] = {}
        self._todo: deque[tuple[Block, bool]] = deque()
        self._ready: deque[tuple[Pair, Outcome, str]] = deque()
        self._events: queue.SimpleQueue[tuple[_Post, Any]] = queue.SimpleQueue()
        self._deaths: dict[str, str] = {}
        self._mean = GUESS
        self._looked = -math.inf
        self._alone_since: float | None = time.monotonic()

    def _stop(self) -> None:
        """Call everything off: solves are ended, so that tasks end by themselves, and no task is left."""
        working = [post for post in self._posts.values() if post.future is not None]
        # a worker that does not answer would hold up who waits for it
        thread = threading.Thread(target=self._part, args=([*self._posts],), daemon=True)
        thread.start()
        thread.join(PARTING)
        deadline = time.monotonic() + PARTING
        for post in working:
            while not post.future.done() and time.monotonic() < deadline:
                time.sleep(0.02)
            post.future.cancel()
        self._forget()

    def _part(self, addresses: list[str]) -> None:
        with contextlib.suppress(Exception):  # a scheduler that is gone has nobody to tell
            self._client.run(keeper.stop, self._run, workers=addresses, on_error="ignore")

    def _turn(self, seconds: float) -> None:
        """Look who is there, take in what has come within `seconds`, and give out work."""
        if time.monotonic() - self._looked > LOOK:
            self._look()
        with contextlib.suppress(queue.Empty):
            post, future = self._events.get(timeout=seconds) if seconds else self._events.get_nowait()
            if self._posts.get(post.address) is post and post.future is future:
                self._take_in(post)
        for idle in [p for p in self._posts.values() if p.identity and p.future is None]:
            self._employ(idle)

    # ------------------------------------------------------------------------------------- who is there

    def _look(self) -> None:
        """Greet who has joined, and find who was lost."""
        try:
            there = set(self._client.nthreads())
        except Exception as cause:
            raise CpbenchError(
                f"the Dask scheduler does not answer any more ({cause}); what was finished is kept, and the same "
                "command goes on"
            ) from None
        self._looked = time.monotonic()
        for address in self._posts.keys() - there:
            self._lose(self._posts[address])
        for address in there - self._posts.keys() - self._refused.keys():
            post = self._posts[address] = _Post(address)
            self._submit(post, keeper.greet, self._run, self._opening)
        self._refused = {address: why for address, why in self._refused.items() if address in there}
        if self._posts:
            self._alone_since = None
        elif self._refused:
            raise CpbenchError(f"no worker of the Dask cluster can be used: {next(iter(self._refused.values()))}")
        elif self._alone_since is None:
            self._alone_since = self._looked
        elif self._looked - self._alone_since > LONELY:
            logger.warning("no Dask worker is there; waiting for one to join")
            self._alone_since = math.inf

    def _refuse(self, post: _Post, why: str) -> None:
        """Never use a worker again; what it was to do is for others."""
        self._refused[post.address] = f"{post.host or post.address}: {why}"
        logger.warning("a Dask worker is not used: %s", self._refused[post.address])
        self._put_back(post)
        self._abandon(post)

    def _lose(self, post: _Post) -> None:
        """A worker is gone: what it was at is suspect, what it had before it is not."""
        logger.warning("a Dask worker was lost: %s", post.host or post.address)
        self._suspect(post)
        self._abandon(post)

    def _abandon(self, post: _Post) -> None:
        self._todo.extendleft((block, post.suspect) for block in reversed(post.blocks))
        if post.future is not None:
            post.future.cancel()
        del self._posts[post.address]

    def _suspect(self, post: _Post, why: str = "") -> None:
        """Pairs that were at work when a process died: each is run once more, alone, and after all others.

        What was alone already is to blame, and gets its row.
        """
        told = f"{post.host} ({why})" if why else post.host
        for part, whole in post.sent:
            rest: Block | None = whole
            pair = part.pairs[0]
            if post.suspect and pair.key in self._deaths:
                message = f"its machine's worker died twice while it ran, on {self._deaths[pair.key]} and on {told}"
                outcome = Outcome({"status": "crash", "message": message})
                self._end(pair, outcome.dated(time.strftime("%Y-%m-%dT%H:%M:%S")), post.host)
                rest = whole.rest({pair.key: ("crash", None)})
            for pair in part.pairs:
                self._deaths[pair.key] = told
            while rest is not None:
                alone, rest = (rest, None) if rest.chained else rest.cut(1)
                self._todo.append((alone, True))
        post.sent = []

    # ---------------------------------------------------------------------------------------- giving out

    def _employ(self, post: _Post) -> None:
        """Give an idle worker what it has before it, else the next blocks, else what another has before it."""
        if not post.blocks:
            post.suspect = bool(self._todo) and self._todo[0][1]
            post.blocks = [self._todo.popleft()[0]] if self._todo else self._relieve()
        if post.blocks:
            self._send(post)

    def _relieve(self) -> list[Block]:
        """Half of what the worker with the most before it has not begun."""
        busiest = max(self._posts.values(), key=lambda p: sum(len(b.pairs) for b in p.blocks))
        pairs = sum(len(block.pairs) for block in busiest.blocks)
        if busiest.suspect or pairs * self._mean < TASK:
            return []
        if len(busiest.blocks) > 1:
            half = len(busiest.blocks) // 2
            busiest.blocks, taken = busiest.blocks[:half], busiest.blocks[half:]
            return taken
        (block,) = busiest.blocks
        if block.chained:
            busiest.blocks = []
            return [block]
        first, others = block.cut(pairs // 2)
        busiest.blocks = [first]
        return [others] if others is not None else []

    def _send(self, post: _Post, wanted: Iterable[str] = ()) -> None:
        """Send the worker a task of about `TASK` seconds, with copies of the files that it does not have."""
        quota = 1 if post.suspect else self._quota(post)
        freight = _Freight(post, wanted)
        count = 0
        while count < quota and freight.weight < FREIGHT:
            if not post.blocks and not post.suspect and self._todo and not self._todo[0][1]:
                post.blocks = [self._todo.popleft()[0]]
            if not post.blocks:
                break
            block = post.blocks.pop(0)
            part, others = block.cut(quota - count)
            post.sent.append((part, block if block.chained else part))
            if others is not None and not block.chained:
                post.blocks.insert(0, others)
            count += len(part.pairs)
            freight.take(part)
        parts = [part for part, _ in post.sent]
        header = {"places": freight.places, "copies": freight.names, "seconds": TASK}
        message: Any = pack_blocks(parts, freight.contents, **header)
        if len(message) > LARGE:
            try:
                (message,) = self._client.scatter([message], workers=[post.address], hash=False)
            except Exception:  # the worker or the scheduler is gone: the next look tells
                self._looked = -math.inf
                self._put_back(post)
                return
        self._submit(post, keeper.work, self._run, post.identity, message)
        self._notice("solve", parts[0].pairs[0], {"host": post.host})

    def _submit(self, post: _Post, what: Callable[..., Any], *arguments: Any) -> None:
        """A task for this worker alone; its end comes as an event."""
        future = self._client.submit(
            what, *arguments, key=f"cpbench-{uuid.uuid4().hex}", workers=[post.address], allow_other_workers=False
        )
        post.future, post.since = future, time.monotonic()
        future.add_done_callback(lambda done: self._events.put((post, done)))

    def _quota(self, post: _Post) -> int:
        """Pairs of the next task: less towards the end, so that all workers end together."""
        waiting = sum(len(b.pairs) for b, _ in self._todo) + sum(len(b.pairs) for b in post.blocks)
        share = math.ceil(waiting / (2 * len(self._posts)))
        return max(1, min(MOST, int(TASK / self._mean), share))

    # ----------------------------------------------------------------------------------------- taking in

    def _take_in(self, post: _Post) -> None:
        from distributed import KilledWorker

        future = post.future
        try:
            result = future.result(timeout=PATIENCE)
        except TimeoutError:
            self._events.put((post, future))
        except (FutureCancelled, AsyncCancelled):
            self._look()  # which raises, or loses the worker, if that is why
            if post.address in self._posts:
                self._put_back(post)
        except KilledWorker:
            self._lose(post)
        except Exception as error:
            self._refuse(post, f"{type(error).__name__}: {error}")
        else:
            post.future = None
            if post.identity:
                self._answered(post, result)
            else:
                self._greeted(post, *result)

    def _put_back(self, post: _Post) -> None:
        post.blocks = [whole for _, whole in post.sent] + post.blocks
        post.sent = []
        post.future = None

    def _greeted(self, post: _Post, identity: str, greeting: bytes) -> None:
        header, _ = wire.unpack(greeting)
        if header["event"] != "ready":
            self._refuse(post, str(header["message"]))
            return
        post.identity, post.host = identity, str(header["host"])
        self.machines[post.host] = header["machine"]

    def _answered(self, post: _Post, messages: Iterable[bytes]) -> None:
        """Outcomes, and how the task ended that they are of."""
        pairs = post.pairs
        endings: dict[str, Ending] = {}
        last: Mapping[str, Any] = {"event": "outcome"}
        for message in messages:
            last, vectors = wire.unpack(message)
            if last["event"] == "outcome":
                pair, outcome = pairs[last["at"]], read_outcome(last, vectors)
                endings[pair.key] = (outcome.status, outcome.answer)
                self._end(pair, outcome, post.host)
        if endings:
            self._mean += MEMORY * ((time.monotonic() - post.since) / len(endings) - self._mean)
        left = [(part.rest(endings), whole.rest(endings)) for part, whole in post.sent]
        post.blocks = [whole for part, whole in left if part is None and whole is not None] + post.blocks
        post.sent = [(part, whole) for part, whole in left if part is not None and whole is not None]
        event = last["event"]
        if event == "stranger":
            self._lose(post)
        elif event == "failed":
            self._refuse(post, str(last["message"]))
        elif event == "died":
            self._suspect(post, str(last["message"]))
        else:
            self._put_back(post)
            if event == "wanted":
                post.copies = True
                self._send(post, last["files"])

    def _end(self, pair: Pair, outcome: Outcome, host: str) -> None:
        row = {**outcome.row, "jobs": sum(post.host == host for post in self._posts.values())}
        self._ready.append((pair, replace(outcome, row=row), host))


class _Freight:
    """The files of a task: where each stands here, and the contents of those that go along."""

    def __init__(self, post: _Post, wanted: Iterable[str]) -> None:
        self._post, self._wanted = post, {*wanted}
        self.places: dict[str, tuple[str, str]] = {}
        self.names: list[tuple[str, list[str]]] = []
        self.contents: dict[str, bytes] = {}
        self.weight = 0

    def take(self, part: Block) -> None:
        for pair in (*part.pairs, *part.before.values()):
            if pair.address in self.places:
                continue
            path, member = split_address(pair.address)
            file = os.path.abspath(path)
            self.places[pair.address] = (file, member)
            if file in self._wanted or (self._post.copies and file not in self._post.files):
                self._copy(file, pair)

    def _copy(self, file: str, pair: Pair) -> None:
        try:
            found = [(path.name, path.read_bytes()) for path in storage.files(pair.address, pair.format)]
        except (CpbenchError, OSError):
            found = []  # the row will tell
        self._wanted.discard(file)
        self._post.files.add(file)
        self.contents |= {f"copy {len(self.names)} {name}": content for name, content in found}
        self.names.append((file, [name for name, _ in found]))
        self.weight += sum(len(content) for _, content in found)


def _opening(setting: Setting) -> bytes:
    """What every station is told first: whose run it is, the limits of its lane, the plugins, the declared solvers.

    Files of tables stay here: what they declare is told, with the paths that it has here.
    """
    names = [name for name in os.environ.get(PLUGIN_FILES, "").split(os.pathsep) if name and not name.endswith(TABLES)]
    plugins = {name: Path(name).read_bytes() for name in names}
    anywhere = {k: v for k, v in asdict(setting).items() if k not in ("cpus", "lanes")}
    opening = {"cpbench": cpbench.__version__, "setting": anywhere, "plugins": names}
    return wire.pack({**opening, "solvers": os.environ.get(DECLARED, "")}, plugins)
