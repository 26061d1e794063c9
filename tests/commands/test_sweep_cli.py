"""``mathnavi sweep`` and ``mathnavi store``."""

from __future__ import annotations

import csv
import json
import re
import shlex
import shutil
import signal
import sqlite3
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.interfaces.bounds import LARGEST_SEED
from mathnavi.interfaces.input_files import content_digest
from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.sweep import cluster
from mathnavi.sim.sweep.trial import trial
from tests.commands.signalled import signalled
from tests.little_room import little_room

COIN = "tests.sim.sweep.scenarios:Coin"

Words = tuple[str, ...]


def sweep(*argv: str) -> int:
    return main(["sweep", *argv])


def records(path: Path) -> list[Record]:
    with Store.existing(path) as store:
        return sorted(store.records(), key=lambda record: record.seed)


def trials_of(path: Path) -> list[tuple[Any, ...]]:
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        return connection.execute("SELECT * FROM trials ORDER BY key").fetchall()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "store.db"


def test_a_trial_is_the_flight_of_a_run(
    mission: Words, path: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    fields = ("--noise.position", "0.5", "--faults.solver-failure-rate", "0.3", "--seed", "4")
    varied = ("--vary", "planner.nodes=7,11")
    assert sweep(*mission, *fields, *varied, "--trials", "1", "--store", str(path), "--workers", "1", "--report") == 0
    flown = {record.fields["planner.nodes"]: record for record in records(path)}
    assert flown.keys() == {7, 11}
    main(["run", *mission, *fields, "--planner.nodes", "11", "--out", str(tmp_path / "run")])
    summary = json.loads((tmp_path / "run/summary.json").read_text())
    expected: Any = flown[11].summary  # to the bit, unless programmes are perturbed here and not in the trial's process
    if request.config.getoption("perturb") is not None:
        near = {name: pytest.approx(value, rel=1e-6) for name, value in expected.items() if isinstance(value, float)}
        expected = {**expected, **near}
    assert {name: summary[name] for name in flown[11].summary} == expected
    assert {"solve_ms_mean", "real_time_factor", "trial_wall_s"} <= flown[11].timings.keys()
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "mathnavi sweep safe-flight" in page
    assert "lowest, seed 4" in page or "of median length, seed 4" in page  # where one trial is both


@pytest.mark.usefixtures("trials_here")
def test_every_combination_flies_the_same_seeds_and_the_same_draws(path: Path) -> None:
    varied = ("--vary", "planner.gain=1,2", "--vary", "part.count=4,5,6", "--vary", "part.share=0.25..0.75")
    assert sweep(COIN, *varied, "--vary", "bias=0..1", "--trials", "3", "--seed", "10", "--store", str(path)) == 0
    found = [record.fields for record in records(path)]
    assert len(found) == 18
    seeds: dict[int, list[Record]] = {}
    for record in records(path):
        seeds.setdefault(record.seed, []).append(record)
    assert seeds.keys() == {10, 11, 12}
    for members in seeds.values():
        assert {(r.fields["planner.gain"], r.fields["part.count"]) for r in members} == {
            (gain, count) for gain in (1.0, 2.0) for count in (4, 5, 6)
        }
        assert len({(r.fields["part.share"], r.fields["bias"]) for r in members}) == 1
        assert len({r.summary["x_m"] for r in members}) == 1
    shares = [members[0].fields["part.share"] for members in seeds.values()]
    assert len(set(shares)) == 3
    assert all(0.25 <= share <= 0.75 for share in shares)


@pytest.mark.usefixtures("trials_here")
def test_a_draw_depends_on_the_seed_and_the_field_and_on_nothing_else(tmp_path: Path) -> None:
    words = (COIN, "--trials", "4", "--vary", "part.share=0..1")
    assert sweep(*words, "--store", str(tmp_path / "one.db"), "--workers", "1") == 0
    others = ("--vary", "bias=0..1", "--vary", "planner.gain=3,4", "--workers", "2")
    assert sweep(*words, *others, "--seed", "2", "--trials", "2", "--store", str(tmp_path / "two.db")) == 2
    assert sweep(COIN, *others, *words[3:], "--seed", "2", "--trials", "2", "--store", str(tmp_path / "two.db")) == 0
    one = {record.seed: record.fields["part.share"] for record in records(tmp_path / "one.db")}
    two = {record.seed: record.fields["part.share"] for record in records(tmp_path / "two.db")}
    assert two == {seed: one[seed] for seed in (2, 3)}


@pytest.mark.usefixtures("trials_here")
def test_whole_numbers_are_drawn_with_both_ends(path: Path) -> None:
    assert sweep(COIN, "--vary", "part.count=2..4", "--trials", "40", "--store", str(path)) == 0
    counts = [record.fields["part.count"] for record in records(path)]
    assert set(counts) == {2, 3, 4}
    assert all(type(count) is int for count in counts)


@pytest.mark.usefixtures("trials_here")
def test_plugins_lists_truths_and_words_may_be_listed(path: Path) -> None:
    varied = ("--vary", "controller=tests.sim.sweep.scenarios:Nobody,tests.sim.sweep.scenarios:Somebody")
    more = ("--vary", "chatter=true,false", "--vary", "raise-at=7,8", "--vary", "marks=,..")
    assert sweep(COIN, *varied, *more[:4], "--planner.gain", "2", "--trials", "1", "--store", str(path)) == 0
    found = {
        (r.fields["controller"].rpartition(":")[2], r.fields["chatter"], tuple(r.fields["raise_at"]))
        for r in records(path)
    }
    assert found == {(c, t, (k,)) for c in ("Nobody", "Somebody") for t in (True, False) for k in (7, 8)}
    assert {r.fields["planner.gain"] for r in records(path)} == {2.0}
    assert sweep(COIN, *more[4:], "--trials", "1", "--store", str(path)) == 2


@pytest.mark.usefixtures("trials_here")
def test_the_tables_tell_rates_medians_and_what_went_wrong(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--trials", "12", "--vary", "bias=0,1", "--raise-at", "3", "--store", str(path))
    assert sweep(COIN, *words) == 0
    out, err = capsys.readouterr()
    assert err == f"0 of 24 trials already in {path}\n"
    for expected in (
        "24 trials: 11 succeeded, 2 raised",
        "Clopper-Pearson",
        "(<= 22.1)",
        "91.7",
        "[61.5, 99.8]",
        "8.33",
        "[0.211, 38.5]",
        "x [m]",
        str(path),
    ):
        assert expected in out.replace("\n", " ") or expected in out
    assert "a run failed: RuntimeError: seed 3 is out of order (".replace(" ", "") in "".join(out.split())
    assert main(["store", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "24 trials: 11 succeeded, 2 raised" in shown
    assert "[61.5, 99.8]" in shown
    assert records(path)[0].code in shown


@pytest.mark.parametrize("width", [60, 80, 200])
@pytest.mark.usefixtures("trials_here")
def test_no_word_of_a_table_is_broken_and_what_has_no_room_is_named(
    width: int, path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    words = ("--trials", "12", "--vary", "part.count=4,5", "--vary", "bias=0,1", "--vary", "part.share=0..1")
    assert sweep(COIN, *words, "--store", str(path)) == 0
    out = capsys.readouterr().out
    names = set(re.findall(r"[A-Za-z]{3,}", out))
    assert {"count", "bias", "trials", "success", "limits", "bootstrap", "share"} <= names
    table = [line for line in out.splitlines() if not line.startswith("no room for")]
    assert all(line.count(left) == line.count(right) for line in table for left, right in ("[]", "()"))
    assert max(map(len, out.splitlines()[1:-1])) <= max(width, len(f"store   {path}"))
    assert ("no room for: " in out) == (width < 200)


@pytest.mark.usefixtures("trials_here")
def test_a_store_shows_a_drawn_field_in_bins(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sweep(COIN, "--trials", "30", "--vary", "part.share=0..1", "--store", str(path)) == 0
    assert sweep(COIN, "--trials", "5", "--store", str(path)) == 0  # of the same seeds, without a draw
    capsys.readouterr()
    assert main(["store", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    rates = shown[shown.rindex("rates") :].splitlines()
    rows = [line for line in rates if " to " in line and "0." in line]
    assert 2 <= len(rows) <= 8
    assert "part.share" in rates[1]


@pytest.mark.usefixtures("trials_here")
def test_a_sweep_says_what_it_finds_in_the_store(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = (COIN, "--store", str(path), "--trials")
    expected = []
    for count, more in (("4", ()), ("6", ()), ("6", ("--bias", "0.25")), ("6", ())):
        assert sweep(*words, count, *more) == 0
        expected.append(capsys.readouterr().err.partition(" already")[0])
    assert expected == ["0 of 4 trials", "4 of 6 trials", "0 of 6 trials", "6 of 6 trials"]
    assert len(records(path)) == 12


@pytest.mark.usefixtures("trials_here")
def test_a_store_is_exported(path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sweep(COIN, "--trials", "3", "--store", str(path)) == 0
    capsys.readouterr()
    for name in ("table.csv", "table.jsonl"):
        assert main(["store", "export", str(path), "--out", str(tmp_path / name)]) == 0
        assert capsys.readouterr().out == f"{tmp_path / name}\n"
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        assert sorted(int(row["seed"]) for row in csv.DictReader(file)) == [0, 1, 2]
    assert len((tmp_path / "table.jsonl").read_text().splitlines()) == 3


@pytest.mark.usefixtures("trials_here")
def test_what_timed_out_is_named_and_run_again(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    hung = trial(COIN, 1)
    with Store.open(path) as store:
        store.add(hung.record(hung.content, "timed-out", error="no end within 1 s"))
    words = (COIN, "--trials", "2", "--store", str(path))
    assert sweep(*words) == 0
    assert "found in the store as timed out or crashed: 1; --retry runs such trials again" in capsys.readouterr().out
    assert sweep(*words, "--retry") == 0
    assert "--retry" not in capsys.readouterr().out
    assert [record.status for record in records(path)] == ["ok", "ok"]


@pytest.mark.usefixtures("trials_here")
def test_the_worst_runs_are_flown_again_and_linked_with_the_page(
    mission: Words, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "disable")  # pictures in the reports
    gusts, out = ("--vary", "faults.gust-rms=0.5"), tmp_path / "out"
    words = ("--trials", "1", "--store", str(path), "--out", str(out), "--worst", "1", "--report")
    assert sweep(*mission, *gusts, *words) == 0
    assert [folder.name for folder in out.iterdir()] == ["worst-1"]
    (least,) = records(path)
    flown = json.loads((out / "worst-1/summary.json").read_text())
    assert {name: flown[name] for name in least.summary} == least.summary
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert '<a href="out/worst-1/report.html">seed 0</a>' in page
    report = (out / "worst-1/report.html").read_text(encoding="utf-8")
    assert '<a href="../../store.html">the sweep store (seed 0, faults.gust_rms 0.5)</a>' in report


@pytest.mark.usefixtures("trials_here")
def test_a_map_under_another_name_is_the_same_map(
    mission: Words, hills: Path, path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy.npz"
    shutil.copy(hills, copy)
    words = [str(copy) if word == str(hills) else word for word in mission]
    assert sweep(*words, "--trials", "1", "--store", str(path)) == 0
    write_npz(HeightField(np.full((20, 20), 99.0), 500.0, "another"), copy)
    assert sweep(*mission, "--trials", "1", "--store", str(path), "--report") == 0
    assert len(records(path)) == 1
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "The terrain hills" in page
    assert str(copy) not in page
    copy.unlink()
    assert sweep(*mission, "--trials", "1", "--store", str(path), "--report") == 0


@pytest.mark.usefixtures("trials_here")
def test_trials_of_another_environment_are_kept_apart_and_mixed_on_request(
    path: Path, capsys: pytest.CaptureFixture[str], elsewhere: Callable[[str], None]
) -> None:
    words = (COIN, "--store", str(path), "--trials", "2")
    assert sweep(*words) == 0
    elsewhere("9.9")
    capsys.readouterr()
    assert sweep(*words, "--mix-environments", "--report") == 0
    said = capsys.readouterr().err
    assert "2 of 2 trials already" in said
    assert "(here 9.9): 2; they may differ" in said
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "2 of 2 were run in another environment" in page
    assert len(records(path)) == 2
    assert sweep(*words) == 0
    said = capsys.readouterr().err
    assert "0 of 2 trials already" in said
    assert "--mix-environments accepts them" in said
    assert len(records(path)) == 4
    assert main(["store", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "2 of 4 trials from another environment" in shown
    assert shown.count("2 trials: ") == 2
    assert "environment as here" in shown


@pytest.mark.usefixtures("trials_here")
def test_a_file_that_has_changed_is_another_trial_and_is_named(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "table"
    words = (COIN, "--store", str(path), "--trials", "2", "--table", str(table))
    digests = []
    for content in ("one", "other"):
        table.write_text(content)
        digests.append(content_digest(table))
        assert sweep(*words) == 0
    said = capsys.readouterr().err
    assert f"table = {table} has changed since 2 of the stored trials" in said
    for digest in digests:
        assert digest[:12] in said
    assert len(records(path)) == 4
    assert main(["store", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    assert all(f"table with digest {digest}" in shown for digest in digests)
    assert shown.count("2 trials: ") == 2


@pytest.mark.usefixtures("trials_here")
def test_a_sweep_that_is_killed_again_and_again_leaves_the_same_trials(path: Path, tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    hanging = ("--hang-at", "29", "--well-once", str(ready))  # so that no sweep ends before it is killed
    words = (COIN, "--trials", "30", "--vary", "part.share=0..1", "--raise-at", "7", *hanging)
    for place, rows in (("after", 3), ("within", 12)):
        done = signalled(signal.SIGKILL, place, rows, "sweep", *words, "--store", str(path), "--workers", "2")
        assert done.returncode == -signal.SIGKILL
    assert 3 <= len(trials_of(path)) < 30
    ready.mkdir()
    for store in (path, tmp_path / "undisturbed.db"):
        assert sweep(*words, "--store", str(store)) == 0
    assert trials_of(path) == trials_of(tmp_path / "undisturbed.db")


@pytest.mark.usefixtures("trials_here")
def test_an_interrupt_keeps_what_has_ended_and_says_how_to_go_on(path: Path, tmp_path: Path) -> None:
    ready = tmp_path / "ready"
    words = ("--hang-at", "19", "--well-once", str(ready), "--store", str(path), "--workers", "2")
    done = signalled(signal.SIGINT, "after", 3, "sweep", COIN, "--trials", "20", *words)
    assert done.returncode == 130
    assert not done.stdout
    kept = len(trials_of(path))
    assert 3 <= kept < 20
    command = shlex.join(["mathnavi", "sweep", COIN, "--trials", "20", *words])
    assert done.stderr.splitlines() == [
        f"0 of 20 trials already in {path}",
        f"mathnavi: interrupted, {kept} of 20 trials stored; to go on: {command}",
    ]
    ready.mkdir()
    assert sweep(COIN, "--trials", "20", *words) == 0
    assert len(trials_of(path)) == 20


@pytest.mark.usefixtures("trials_here")
def test_a_full_disk_ends_in_one_line_and_keeps_what_was_committed(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = (COIN, "--trials", "100", "--store", str(path), "--workers", "1")
    with little_room(60_000):
        assert sweep(*words) == 1
    out, err = capsys.readouterr()
    assert not out
    assert len(err.splitlines()) == 2, err
    kept = len(trials_of(path))
    assert 0 < kept < 100
    for expected in (str(path), "full", f"{kept} of 100 trials stored", "to go on: mathnavi sweep"):
        assert expected in err
    assert sweep(*words) == 0
    assert len(trials_of(path)) == 100


Refusal = Callable[..., str]


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Refusal:
    """The one line with which a command is refused, when nothing has been touched."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)

    def refuse(*argv: str) -> str:
        before = {path: path.read_bytes() if path.is_file() else b"" for path in tmp_path.rglob("*")}
        capsys.readouterr()
        assert main(argv) == 2
        out, err = capsys.readouterr()
        assert {path: path.read_bytes() if path.is_file() else b"" for path in tmp_path.rglob("*")} == before
        assert not out
        assert len(err.splitlines()) == 1, err
        assert err.startswith("mathnavi: ")
        return err

    return refuse


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ("--vary colour=1,2", ["--vary colour=1,2", "--part.*", "allowed"]),
        ("--vary part.shar=1,2", ["part.shar", "did you mean --part.share"]),
        ("--vary seed=1,2", ["seed=1,2", "not one of the fields", "allowed"]),
        ("--vary bias=0...2", ["--vary bias=0...2", "0..2 or 0..0.2", "allowed"]),
        ("--vary bias", ["--vary = 'bias'", "FIELD=V1,V2,...", "FIELD=LOW..HIGH"]),
        ("--vary bias=0.5,", ["bias=0.5,", "'' is not a value"]),
        ("--vary bias=0.5,nan", ["--bias = nan", "finite"]),
        ("--vary bias=0.5,0.5", ["0.5 is given twice", "once"]),
        ("--vary part.count=1.5,2", ["part.count", "1.5", "INT"]),
        ("--vary part.share=0.5,1.5", ["part.share", "1.5", "0 to 1"]),
        ("--vary part.share=0.9..0.1", ["part.share=0.9..0.1", "0.9 > 0.1", "LOW <= HIGH"]),
        ("--vary chatter=true,maybe", ["chatter=true,maybe", "'maybe'", "true, false"]),
        ("--vary bias=0.1,0.2 --vary bias=0..1", ["bias=0..1", "varied twice"]),
        ("--vary bias=0.1,0.2 --bias 0.3", ["bias=0.1,0.2", "--bias is given as well"]),
        (
            "--vary controller=tests.nowhere:A,tests.nowhere:B",
            ["--controller", "tests.nowhere:A", "cannot be imported"],
        ),
        ("--vary controller=flight,flight", ["controller=flight,flight", "twice"]),
        ("--vary bias=--trials", ["bias=--trials", "not a value"]),
        ("--vary", ["--vary: its value is missing"]),
        ("--trials 0", ["--trials = 0", "from 1 to 100000"]),
        ("--timeout 0", ["--timeout = 0.0", "> 0"]),
        ("--seed -1", ["--seed = -1", "from 0 to"]),
        (f"--seed {LARGEST_SEED}", ["--seed", str(LARGEST_SEED)]),
        ("--workers 2 --cluster tcp://127.0.0.1:9", ["--cluster", "tcp://127.0.0.1:9", "--workers 2", "one of both"]),
        ("--cluster tcp://127.0.0.1:9", ["--cluster", "tcp://127.0.0.1:9", "Timed out", "tcp://HOST:8786"]),
        ("--cluster nowhere", ["--cluster", "nowhere", "tcp://HOST:8786"]),
        ("--bias high", ["--bias", "high", "FLOAT"]),
    ],
)
def test_a_sweep_refuses_what_it_cannot_be(refused: Refusal, path: Path, flags: str, expected: list[str]) -> None:
    trials = () if "--trials " in flags and "bias" not in flags else ("--trials", "2")
    words = (COIN, *trials, "--store", str(path), *flags.split())
    line = refused("sweep", *words)
    for word in expected:
        assert word in line


def test_what_is_no_store_is_refused_and_left_alone(refused: Refusal, path: Path) -> None:
    path.write_text("no database")
    for argv in (
        ("sweep", COIN, "--trials", "1", "--store", str(path)),
        ("store", "show", str(path)),
        ("store", "export", str(path), "--out", "table.csv"),
    ):
        line = refused(*argv)
        assert str(path) in line
        assert "not a database" in line


@pytest.mark.parametrize(
    ("argv", "expected"),
    [
        ("sweep", ["SCENARIO", "safe-flight"]),
        ("sweep hover --trials 3 --store s.db", ["SCENARIO", "hover", "safe-flight"]),
        ("sweep safe-flight --store s.db", ["--trials", "missing"]),
        ("sweep safe-flight --trials 3", ["--store", "missing"]),
        ("sweep safe-flight --trials 3 --store /proc/s.db", ["/proc/s.db", "allowed"]),
        ("sweep safe-flight --trials 3 --store page.html", ["--store", "page.html", "report"]),
        ("sweep safe-flight --trials 3 --store s.db --terrain atlantis", ["terrain", "atlantis", "jacksboro"]),
        (
            "sweep safe-flight --trials 3 --store s.db --terrain atlantis.npz",
            ["terrain", "atlantis.npz", "no such file"],
        ),
        (
            "sweep safe-flight --trials 3 --store s.db --vary planner.incorporation=a..b",
            ["planner.incorporation", "a..b", "schedule"],
        ),
        ("sweep safe-flight --trials 3 --store s.db --vary noise.position-rate=7..9", ["7.0", "300 Hz over a whole"]),
        ("store", ["show, export"]),
        ("store show", ["FILE.db", "missing"]),
        ("store show s.db", ["s.db", "no such file"]),
        ("store export s.db", ["--out", "missing"]),
    ],
)
def test_commands_refuse_what_is_not_there(refused: Refusal, argv: str, expected: list[str]) -> None:
    line = refused(*argv.split())
    for word in expected:
        assert word in line


def test_what_only_building_finds_is_refused_before_anything_is_run(
    refused: Refusal, path: Path, mission: Words
) -> None:
    words = ("sweep", *mission[:3], "--trials", "3", "--store", str(path))
    for flags, expected in (
        ("--planner.bandwidth 100", "leaves nothing to plan with; allowed"),
        ("--vary planner.bandwidth=2,100", "leaves nothing to plan with; allowed"),
        ("--start 0 0 0", "--start = "),
    ):
        assert expected in refused(*words, *flags.split())
    line = refused(
        "sweep", COIN, "--trials", "3", "--store", str(path), "--refuse-gain", "2", "--vary", "planner.gain=1,2"
    )
    assert "--planner.gain = 2.0; allowed: less than 2.0" in line


def test_two_names_of_one_content_are_not_two_combinations(refused: Refusal, hills: Path, tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        shutil.copy(hills, tmp_path / name)
    words = ("sweep", "safe-flight", "--trials", "2", "--store", "s.db", "--vary", "terrain=a.npz,b.npz")
    for more in ((), ("--vary", "planner.nodes=7,11"), ("--vary", "noise.position=0..1")):
        line = refused(*words, *more)
        for expected in ("--vary terrain", "a.npz", "b.npz", "the same content", "allowed"):
            assert expected in line


def test_a_table_is_written_whole_or_not_at_all(refused: Refusal, path: Path, tmp_path: Path) -> None:
    Store.open(path).close()
    assert "table.txt" in refused("store", "export", str(path), "--out", "table.txt")
    assert "nowhere" in refused("store", "export", str(path), "--out", "nowhere/table.csv")
    (tmp_path / "folder.csv").mkdir()
    assert "--out = folder.csv: Is a directory; allowed" in refused("store", "export", str(path), "--out", "folder.csv")
    line = refused("store", "export", str(path), "--out", "/proc/y.csv")
    assert line.startswith("mathnavi: --out = /proc/y.csv: No such file or directory; allowed: a file in a folder")


def test_help_tells_how_fields_are_varied(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sweep", "safe-flight", "--help"]) == 0
    out = capsys.readouterr().out
    assert "FIELD=LOW..HIGH" in out
    assert "--planner.nodes" in out
