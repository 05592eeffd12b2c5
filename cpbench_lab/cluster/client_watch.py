"""A plugin of the Dask scheduler, which ends the processes of a run on all workers as soon as its client is gone: a
client that was killed removes no plugin itself."""

from __future__ import annotations

import contextlib
from typing import Any

from distributed import SchedulerPlugin


def client_watch(client: str, run: str) -> SchedulerPlugin:
    """Return the plugin for a client, by its identity, and the worker plugin of its run, by its name.

    The class is local, so that it is pickled by value: the scheduler need not have cpbench.
    """

    class ClientWatch(SchedulerPlugin):
        def __init__(self, client: str, run: str) -> None:
            self.client, self.run, self.name = client, run, run

        def remove_client(self, scheduler: Any, client: str) -> None:
            async def end() -> None:
                with contextlib.suppress(ValueError):  # the run ended, and removed it
                    await scheduler.unregister_worker_plugin(comm=None, name=self.run)
                await scheduler.unregister_scheduler_plugin(name=self.run)

            if client == self.client:
                scheduler.loop.add_callback(end)

    return ClientWatch(client, run)
