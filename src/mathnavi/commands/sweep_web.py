"""``mathnavi sweep --web``: the report of a running sweep, with the trials that are stored so far.

Each of the worst runs has a link: the trial is flown again, bit for bit the same run, and shown as ``mathnavi view
--web`` shows it.
"""

from __future__ import annotations

import html
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import urlencode, urlsplit

from mathnavi.commands.view_web import page_of
from mathnavi.commands.web_server import PageServer
from mathnavi.commands.worst_runs import worst_section
from mathnavi.interfaces.errors import FieldError
from mathnavi.renders.page import Markup, document, heading, paragraph
from mathnavi.renders.sweep_report import report
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import Store
from mathnavi.sim.records.sweep_data import Sweep
from mathnavi.sim.sweep.trial import Trial

EVERY = 5  # [s] after which a page reloads
HEAD = '<meta charset="utf-8">'
VIEW = "/view"  # where a trial is shown
MOST_WORST = 10  # runs with a link


@dataclass
class FollowedSweep:
    """State of a sweep for its page; the threads of the server read the store themselves."""

    name: str
    store: Path
    trials: Mapping[str, Trial]  # by content
    varied: Sequence[str]  # fields
    mix_environments: bool
    command: str
    progress: Callable[[], str]  # in words
    url: str = ""
    ended: bool = False
    _page: str = ""
    _made: float = -float(EVERY)  # [s] by the monotonic clock
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _views: dict[str, str] = field(default_factory=dict)  # pages of trials, by content
    _flying: threading.Lock = field(default_factory=threading.Lock)

    def page(self) -> str:
        """Return the report of what is stored, made again if it is older than ``EVERY`` seconds."""
        with self._lock:
            if time.monotonic() - self._made >= EVERY or self.ended:
                self._page, self._made = self._report(), time.monotonic()
            return self._page

    def view(self, query: Mapping[str, str]) -> str:
        """Return the page of the trial that a query names, flown again; FieldError for one that is not of the sweep."""
        content = query.get("trial", "")
        if content not in self.trials:
            raise FieldError(f"trial = {content!r}; allowed: one of this sweep, by a link of its page")
        with self._flying:  # one after the other
            if content not in self._views:
                with TemporaryDirectory() as folder:
                    self.trials[content].flown().write(Path(folder))
                    page = page_of([Path(folder)], None)
                    title = '<h1 id="title"></h1>'
                    self._views[content] = page.replace(title, f"{title}\n    {self._back()}", 1)
            return self._views[content]

    def show_ended(self) -> None:
        """Show the whole sweep until Ctrl-C."""
        self.ended = True
        print(f"the sweep is shown at {self.url} until Ctrl-C", flush=True)
        with suppress(KeyboardInterrupt):
            threading.Event().wait()

    def _report(self) -> str:
        with Store.existing(self.store) as store:
            keys = store.keys_of(list(self.trials), self.mix_environments, Elsewhere())
            stored = [each for each in self.trials if each in keys]
            records = store.records([keys[each] for each in stored])
        worst = worst_section(
            dict(zip(stored, records, strict=True)), self.varied, self._linked, MOST_WORST,
            "A link flies the trial again and shows the run.",
        )  # fmt: skip
        if records:
            page: Markup = report(Sweep(records, self.varied), None, (), self.command, worst)
        else:
            page = document(self.name, heading(self.name, "no trial has ended yet", None), paragraph(""))
        refresh = "" if self.ended else f'\n<meta http-equiv="refresh" content="{EVERY}">'
        state = f"<p><b>{html.escape(self.progress())}</b></p>"
        return page.replace(HEAD, HEAD + refresh + '\n<link rel="icon" href="data:,">', 1).replace(
            "<main>", f"<main>\n{state}", 1
        )

    def _back(self) -> str:
        """Return the link from a trial's page to that of the sweep."""
        token = urlsplit(self.url).query
        address = html.escape(f"./{f'?{token}' if token else ''}")
        return f'<p id="of">a trial of <a href="{address}">{html.escape(self.name)}</a></p>'

    def _linked(self, content: str, words: str) -> Markup:
        """Return the link to the page of a trial, with the token of the server if it has one."""
        token = urlsplit(self.url).query
        address = f"{VIEW.lstrip('/')}?{urlencode({'trial': content})}{f'&{token}' if token else ''}"
        return Markup(f'<a href="{html.escape(address)}">{html.escape(words)}</a>')


@contextmanager
def followed(sweep: FollowedSweep, host: str, port: int) -> Iterator[FollowedSweep]:
    """Serve a sweep at an address for as long as the block lasts."""
    server = PageServer(host, port, sweep.page, pages={VIEW: sweep.view})
    sweep.url = server.url
    with server.serving():
        print(f"{sweep.name} is shown at {server.url} while it goes on", flush=True)
        yield sweep
