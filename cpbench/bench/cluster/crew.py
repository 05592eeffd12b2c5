"""A crew on many machines: Dask lends them, a station on each runs the same lane as here, and this process gives out
the blocks, takes the outcomes in and keeps account of the workers that are lost.

Dask carries messages and tells who is there. Who does what is decided here: a task is meant for one worker and is
never done by another, so that it is known which pairs were at work when a worker died.
"""

from __future__ import annotations

import contextlib
import logging
import math
import queue
import threading
import time
import uuid
from asyncio import CancelledError as AsyncCancelled
from collections import deque
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError as FutureCancelled
from typing import Any

from cpbench import frames
from cpbench.bench.block import Block, Ending
from cpbench.bench.cluster import backlog, keeper
from cpbench.bench.cluster.backlog import Backlog
from cpbench.bench.cluster.parcel import pack_blocks, read_outcome
from cpbench.bench.cluster.post import Freight, Post, opening
from cpbench.bench.events import Notice, Solving
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.worker_pool import Setting
from cpbench.errors import CpbenchError

logger = logging.getLogger("cpbench.bench")

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


class Cluster:
    """The crew behind a Dask scheduler. Use as a context manager; `close` ends what `ending` names too."""

    reference: Setting | None = None

    def __init__(self, client: Any, setting: Setting, ending: Iterable[Callable[[], None]] = ()) -> None:
        self.machines: dict[str, dict[str, Any]] = {}
        self._client = client
        self._ending = (client.close, *ending)
        self._opening = opening(setting)
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

    def outcomes(self, todo: Sequence[Block], notice: Notice) -> Generator[tuple[Pair, Outcome]]:
        """Yield what comes of every pair, with its host; raises CpbenchError when nobody is or will be there to run
        them."""
        self._notice = notice
        self._backlog.add(todo)
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
        self._posts: dict[str, Post] = {}
        self._refused: dict[str, str] = {}
        self._backlog = Backlog()
        self._ready: deque[tuple[Pair, Outcome]] = deque()
        self._events: queue.SimpleQueue[tuple[Post, Any]] = queue.SimpleQueue()
        self._deaths: dict[str, str] = {}
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
            if self._backlog.give(idle, self._posts.values()):
                self._send(idle)

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
            post = self._posts[address] = Post(address)
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

    def _refuse(self, post: Post, why: str) -> None:
        """Never use a worker again; what it was to do is for others."""
        self._refused[post.address] = f"{post.host or post.address}: {why}"
        logger.warning("a Dask worker is not used: %s", self._refused[post.address])
        post.put_back()
        self._abandon(post)

    def _lose(self, post: Post) -> None:
        """Give a worker up: what it was at is suspect, what it had before it is not."""
        logger.warning("a Dask worker was lost: %s", post.host or post.address)
        self._suspect(post)
        self._abandon(post)

    def _abandon(self, post: Post) -> None:
        self._backlog.take_back(post)
        if post.future is not None:
            post.future.cancel()
        del self._posts[post.address]

    def _suspect(self, post: Post, why: str = "") -> None:
        """Run each pair that was at work when a process died once more, alone, and after all others.

        What was alone already is to blame, and gets its row.
        """
        told = f"{post.host} ({why})" if why else post.host
        for part, whole in post.sent:
            rest: Block | None = whole
            pair = part.pairs[0]
            if post.suspect and pair.key in self._deaths:
                message = f"its machine's worker died twice while it ran, on {self._deaths[pair.key]} and on {told}"
                at = time.strftime("%Y-%m-%dT%H:%M:%S")
                self._end(pair, Outcome(status="crash", message=message, finished=at), post.host)
                rest = whole.rest({pair.key: ("crash", None)})
            for pair in part.pairs:
                self._deaths[pair.key] = told
            if rest is not None:
                self._backlog.set_apart(rest)
        post.sent = []

    # ---------------------------------------------------------------------------------------- giving out

    def _send(self, post: Post, wanted: Iterable[str] = ()) -> None:
        """Send the worker its next task, with copies of the files that it does not have."""
        freight = Freight(post, wanted)
        for part in self._backlog.task(post, self._posts.values()):
            freight.take(part)
            if freight.weight >= FREIGHT:
                break
        parts = [part for part, _ in post.sent]
        header = {"places": freight.places, "copies": freight.names, "seconds": backlog.TASK}
        message: Any = pack_blocks(parts, freight.contents, **header)
        if len(message) > LARGE:
            try:
                (message,) = self._client.scatter([message], workers=[post.address], hash=False)
            except Exception:  # the worker or the scheduler is gone: the next look tells
                self._looked = -math.inf
                post.put_back()
                return
        self._submit(post, keeper.work, self._run, post.identity, message)
        self._notice(Solving(parts[0].pairs[0]))

    def _submit(self, post: Post, what: Callable[..., Any], *arguments: Any) -> None:
        """Submit a task for this worker alone; its end comes as an event."""
        future = self._client.submit(
            what, *arguments, key=f"cpbench-{uuid.uuid4().hex}", workers=[post.address], allow_other_workers=False
        )
        post.future, post.since = future, time.monotonic()
        future.add_done_callback(lambda done: self._events.put((post, done)))

    # ----------------------------------------------------------------------------------------- taking in

    def _take_in(self, post: Post) -> None:
        from distributed import KilledWorker

        future = post.future
        try:
            result = future.result(timeout=PATIENCE)
        except TimeoutError:
            self._events.put((post, future))
        except (FutureCancelled, AsyncCancelled):
            self._look()  # which raises, or loses the worker, if that is why
            if post.address in self._posts:
                post.put_back()
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

    def _greeted(self, post: Post, identity: str, greeting: bytes) -> None:
        header, _ = frames.unpack(greeting)
        if header["event"] != "ready":
            self._refuse(post, str(header["message"]))
            return
        post.identity, post.host = identity, str(header["host"])
        self.machines[post.host] = header["machine"]

    def _answered(self, post: Post, messages: Iterable[bytes]) -> None:
        """Outcomes, and how the task ended that they are of."""
        pairs = post.pairs
        endings: dict[str, Ending] = {}
        last: Mapping[str, Any] = {"event": "outcome"}
        for message in messages:
            last, vectors = frames.unpack(message)
            if last["event"] == "outcome":
                pair, outcome = pairs[last["at"]], read_outcome(last, vectors)
                endings[pair.key] = (outcome.status, outcome.answer)
                self._end(pair, outcome, post.host)
        if endings:
            self._backlog.learn(time.monotonic() - post.since, len(endings))
        post.end(endings)
        event = last["event"]
        if event == "stranger":
            self._lose(post)
        elif event == "failed":
            self._refuse(post, str(last["message"]))
        elif event == "died":
            self._suspect(post, str(last["message"]))
        else:
            post.put_back()
            if event == "wanted":
                post.copies = True
                self._send(post, last["files"])

    def _end(self, pair: Pair, outcome: Outcome, host: str) -> None:
        jobs = sum(post.host == host for post in self._posts.values())
        self._ready.append((pair, outcome.changed(jobs=jobs, host=host)))
