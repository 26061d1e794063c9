"""``mathnavi sweep --web``: the report of a sweep that goes on, of the trials that are stored so far."""

from __future__ import annotations

import html
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

from mathnavi.renders.page import Markup, document, heading, paragraph
from mathnavi.renders.sweep_report import report
from mathnavi.sim.commands.web_server import PageServer
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import Store
from mathnavi.sim.records.sweep_data import Sweep

EVERY = 5  # [s] after which a page asks again
HEAD = '<meta charset="utf-8">'


@dataclass
class FollowedSweep:
    """A sweep as its page knows it; the threads of the server read the store on their own."""

    name: str
    store: Path
    asked: Sequence[str]  # contents of the trials
    varied: Sequence[str]  # fields
    mix_environments: bool
    command: str
    progress: Callable[[], str]  # in words
    url: str = ""
    ended: bool = False
    _page: str = ""
    _made: float = -float(EVERY)  # [s] by the monotonic clock
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def page(self) -> str:
        """The report of what is stored; made anew after ``EVERY`` seconds at most."""
        with self._lock:
            if time.monotonic() - self._made >= EVERY or self.ended:
                self._page, self._made = self._report(), time.monotonic()
            return self._page

    def show_ended(self) -> None:
        """Show the whole sweep until Ctrl-C."""
        self.ended = True
        print(f"the sweep is shown at {self.url} until Ctrl-C", flush=True)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()

    def _report(self) -> str:
        with Store.existing(self.store) as store:
            keys = store.keys_of(self.asked, self.mix_environments, Elsewhere())
            records = store.records([keys[each] for each in self.asked if each in keys])
        if records:
            page: Markup = report(Sweep(records, self.varied), None, (), self.command)
        else:
            page = document(self.name, heading(self.name, "no trial has ended yet", None), paragraph(""))
        refresh = "" if self.ended else f'\n<meta http-equiv="refresh" content="{EVERY}">'
        state = f"<p><b>{html.escape(self.progress())}</b></p>"
        return page.replace(HEAD, HEAD + refresh + '\n<link rel="icon" href="data:,">', 1).replace(
            "<main>", f"<main>\n{state}", 1
        )


@contextmanager
def followed(sweep: FollowedSweep, host: str, port: int) -> Iterator[FollowedSweep]:
    """A sweep that is served at an address for as long as the block lasts."""
    server = PageServer(host, port, sweep.page)
    sweep.url = server.url
    with server.serving():
        print(f"{sweep.name} is shown at {server.url} while it goes on", flush=True)
        yield sweep
