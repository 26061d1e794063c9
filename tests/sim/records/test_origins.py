"""Records of one content from two environments stand beside each other."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from mathnavi.sim.records.computing_environment import environment, environment_digest
from mathnavi.sim.records.origins import Elsewhere, Origin
from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.job import job
from mathnavi.sim.sweep.trial import trial
from tests.sim.sweep.computations import returned

COIN = "tests.sim.sweep.scenarios:Coin"


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store.db") as opened:
        yield opened


def test_a_record_comes_back_with_its_origin(store: Store) -> None:
    flip, call = trial(COIN), job(returned, 1)
    store.add(flip.record(flip.content, "ok", success=True), call.record(call.content, "ok", result="1"))
    (record,), (called,) = store.records(), store.jobs([call.key])
    assert record.origin == Origin(flip.content, environment())
    assert called.origin == Origin(call.content, environment())
    assert store.environments() == {environment_digest(): dict(environment())}
    assert store.keys_of([flip.content, call.content]) == {flip.content: flip.key, call.content: call.key}


def test_another_environment_has_records_of_its_own_and_lends_them_on_request(
    store: Store, elsewhere: Callable[[str], None]
) -> None:
    one, other = trial(COIN, 1), trial(COIN, 2)
    here, digest = one.key, environment_digest()
    store.add(*(each.record(each.content, "ok", success=True) for each in (one, other)))
    elsewhere("9.9")
    assert one.key != here
    store.add(one.record(one.content, "ok", success=False))
    contents = [one.content, other.content]
    counts = Elsewhere()
    assert store.keys_of(contents, elsewhere=counts) == {one.content: one.key}
    assert (dict(counts.left), dict(counts.taken)) == ({digest: 1}, {})
    mixed = store.keys_of(contents, mix_environments=True, elsewhere=counts)
    assert mixed.keys() == set(contents)
    assert mixed[one.content] == one.key
    assert dict(counts.taken) == {digest: 1}
    taken, left = counts.words(store.environments())
    assert "(here 9.9): 1; they may differ" in taken
    assert "--mix-environments" in left


def test_a_store_of_an_earlier_version_is_read(store: Store) -> None:
    flip = trial(COIN)
    store.add(flip.record(flip.content, "ok", success=True))
    with closing(sqlite3.connect(store.path)) as database:
        database.execute("DROP TABLE origins")
        database.execute("DROP TABLE environments")
        database.commit()
    with Store.existing(store.path) as old:
        (record,) = old.records()
        assert record.success is True
        assert record.origin == Origin()
        assert old.keys_of([flip.content], mix_environments=True) == {}
        old.add(trial(COIN, 1).record(trial(COIN, 1).content, "ok", success=True))
        assert len(old.records()) == 2
