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
from mathnavi.interfaces.errors import FieldError
from mathnavi.renders.page import UNKNOWN, Markup, card, document, heading, paragraph, quantity, section, table
from mathnavi.renders.sweep_report import report
from mathnavi.sim.records.figure_names import SHORTFALL, label
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.sweep_data import Sweep, format_value, is_number
from mathnavi.sim.sweep.trial import Trial

EVERY = 5  # [s] after which a page reloads
HEAD = '<meta charset="utf-8">'
VIEW = "/view"  # where a trial is shown
MOST_WORST = 10  # runs with a link
# What runs are ordered by, the first figure that they have; True where the largest value is the worst.
JUDGED = {
    "clearance_margin_m": False, "miss_m": True, "position_rms_m": True, "attitude_rms_rad": True,
    "velocity_rms": True, "error_rms": True,
}  # fmt: skip


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
        worst = self._worst(stored, records)
        if records:
            page: Markup = report(Sweep(records, self.varied), None, (), self.command)
        else:
            page = document(self.name, heading(self.name, "no trial has ended yet", None), paragraph(""))
        refresh = "" if self.ended else f'\n<meta http-equiv="refresh" content="{EVERY}">'
        state = f"<p><b>{html.escape(self.progress())}</b></p>"
        return (
            page.replace(HEAD, HEAD + refresh + '\n<link rel="icon" href="data:,">', 1)
            .replace("<main>", f"<main>\n{state}", 1)
            .replace("<h2>", f"{worst}<h2>", 1)
        )

    def _worst(self, stored: Sequence[str], records: Sequence[Record]) -> Markup:
        """Return a table of the worst runs, each with a link; an empty text if none ran to its end."""
        flown = [pair for pair in zip(stored, records, strict=True) if pair[1].status == "ok"]
        if not flown:
            return Markup("")
        key = next((name for name in JUDGED if is_number(flown[0][1].summary.get(name))), None)

        def badness(pair: tuple[str, Record]) -> tuple[bool, float]:
            value = None if key is None else pair[1].summary.get(key)
            if key is None or value is None:
                return bool(pair[1].success), 0.0
            return bool(pair[1].success), -float(value) if JUDGED[key] else float(value)

        rows = [
            (
                Markup(f'<a href="{self._link(content)}">seed {record.seed}</a>'),
                *(format_value(record.fields.get(name, UNKNOWN)) for name in self.varied),
                "yes" if record.success else str(record.summary.get(SHORTFALL, "no")),
                *([] if key is None else [quantity(key, record.summary.get(key))]),
            )
            for content, record in sorted(flown, key=badness)[:MOST_WORST]
        ]
        heads = ("run", *self.varied, "success", *([] if key is None else [label(key)[0]]))
        return section("Worst runs", card(table(heads, rows, "A link flies the trial again and shows the run.")))

    def _back(self) -> str:
        """Return the link from a trial's page to that of the sweep."""
        token = urlsplit(self.url).query
        address = html.escape(f"./{f'?{token}' if token else ''}")
        return f'<p id="of">a trial of <a href="{address}">{html.escape(self.name)}</a></p>'

    def _link(self, content: str) -> str:
        """Return the address at which a trial is shown, with the token of the server if it has one."""
        token = urlsplit(self.url).query
        return html.escape(f"{VIEW.lstrip('/')}?{urlencode({'trial': content})}{f'&{token}' if token else ''}")


@contextmanager
def followed(sweep: FollowedSweep, host: str, port: int) -> Iterator[FollowedSweep]:
    """Serve a sweep at an address for as long as the block lasts."""
    server = PageServer(host, port, sweep.page, pages={VIEW: sweep.view})
    sweep.url = server.url
    with server.serving():
        print(f"{sweep.name} is shown at {server.url} while it goes on", flush=True)
        yield sweep
