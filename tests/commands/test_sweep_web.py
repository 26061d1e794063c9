"""``mathnavi sweep --web``: the page holds the report of what is stored, and asks again until the sweep has ended."""

from __future__ import annotations

import re
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from mathnavi.commands.cli import main
from mathnavi.commands.sweep import read_sweep
from mathnavi.commands.sweep_web import FollowedSweep, followed
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.trial import contents

WORDS = ("range-localisation", "--duration", "0.3", "--sensors", "0", "90", "--trials", "2", "--workers", "1")


@pytest.mark.usefixtures("trials_here")
def test_the_page_shows_the_trials_that_are_stored(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = tmp_path / "store.db"
    words = (*WORDS, "--store", str(store))
    trials = read_sweep(words).trials
    asked = dict(zip(contents(trials), trials, strict=True))
    Store.open(store).close()
    sweep = FollowedSweep("range-localisation", store, asked, (), False, "mathnavi sweep", lambda: "0 of 2 trials")
    assert "no trial has ended yet" in sweep.page()
    assert main(["sweep", *words]) == 0
    sweep = FollowedSweep("range-localisation", store, asked, (), False, "mathnavi sweep", lambda: "<2> of 2 trials")
    with followed(sweep, "127.0.0.1", 0):
        page = urllib.request.urlopen(sweep.url, timeout=600.0).read().decode()
        links = re.findall(r'<a href="(view[^"]+)">seed (\d)</a>', page)
        assert sorted(seed for _, seed in links) == ["0", "1"]
        link, seed = links[0]
        run = urllib.request.urlopen(sweep.url + link, timeout=600.0).read().decode()
        assert f"range-localisation, seed {seed}" in run
        with pytest.raises(urllib.error.HTTPError, match="400"):
            urllib.request.urlopen(f"{sweep.url}view?trial=0", timeout=600.0)
    assert 'http-equiv="refresh"' in page
    assert re.search("<h1>range-localisation: [0-2] of 2 trials succeeded</h1>", page)
    assert 'a trial of <a href="./">range-localisation</a>' in run
    assert "&lt;2&gt; of 2 trials" in page
    sweep.ended = True
    assert 'http-equiv="refresh"' not in sweep.page()


def test_an_address_needs_web(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", *WORDS, "--store", str(tmp_path / "store.db"), "--host", "127.0.0.1"]) == 2
    assert "only together with --web" in capsys.readouterr().err
