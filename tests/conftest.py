"""Set up before mujoco is imported: an offscreen rendering backend, and repeatable examples."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial

import pytest
from hypothesis import settings

from mathnavi.models import opengl

pytest_plugins = ["tests.small_missions"]

if sys.platform == "linux" and not os.environ.get("MUJOCO_GL"):
    os.environ["MUJOCO_GL"] = opengl.available() or "disable"
importlib.import_module("mujoco")  # a command that flies would import it without OpenGL, and tests draw in this process

# What was started in the background of a script ignores Ctrl-C, and so would every command that a test interrupts.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# Small matrices only: on a busy machine the threads of a linear-algebra library wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# No deadline: the first example of a compiled kernel pays for its compilation.
settings.register_profile("mathnavi", derandomize=True, deadline=None, max_examples=50)
settings.load_profile("mathnavi")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add ``--perturb SEED``."""
    parser.addoption(
        "--perturb", type=int, metavar="SEED", help="every start of a programme times 1 + 1e-15 N(0, 1), from this seed"
    )


@pytest.fixture(scope="session", autouse=True)
def starts_as_rounded_elsewhere(request: pytest.FixtureRequest) -> Iterator[None]:
    """Under ``--perturb SEED`` every programme starts some last digits beside where it would."""
    from tests.perturbed_starts import perturbed_starts

    seed = request.config.getoption("perturb")
    with nullcontext() if seed is None else perturbed_starts(seed):
        yield


@pytest.fixture(scope="session", autouse=True)
def every_module_has_one_name() -> Iterator[None]:
    """After all tests of this process, no module was loaded by a second name.

    The repository's root on sys.path makes ``import models`` possible beside ``import mathnavi.models``.
    """
    yield
    from tests.one_name import bare

    assert [name for name in bare(sys.modules) if "." in name] == []  # a folder itself, tried in vain, holds nothing


@pytest.fixture(scope="session", autouse=True)
def drawing_here() -> Iterator[None]:
    """Stills, videos and clips are drawn in this process, which spares the start of others, except where a test uses
    ``drawing_apart``. Those of a report are small, and its figures are not laid out, except where it uses ``laid_out``
    or ``checked_report``.
    """

    from mathnavi.renders import clip, figures, report, video
    from tests.renders.drawn import draw_here

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(video, "draw", draw_here)
        patch.setattr(clip, "draw", draw_here)
        patch.setattr(report, "write_still", partial(video.write_still, width=320, height=180))
        patch.setattr(figures, "lay_out", lambda figure: figure.set_layout_engine(None))
        yield


@pytest.fixture(scope="session", autouse=True)
def stores_wait_for_no_disk() -> Iterator[None]:
    """What this process commits to a store is with the system, and outlives the process, before it is on the disk.

    A commit waits for the disk several times, 15 ms or more altogether. Commands in processes of their own do.
    """
    from mathnavi.sim.records.store import Store

    committed = Store._transaction

    @contextmanager
    def transaction(store: Store) -> Iterator[None]:
        if store.path.is_file():  # of a device, to wait for it is what fails
            store._connection.execute("PRAGMA synchronous = OFF")
        with committed(store):
            yield

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Store, "_transaction", transaction)
        yield


@pytest.fixture(autouse=True)
def modules_of_a_test_go_with_it(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What a test writes as a module and imports, here or through a command, is unknown to the tests after it.

    A command that loads FILE:Class leaves the module, and its folder on sys.path, to the end of the process.
    """
    loaded, base = set(sys.modules), str(tmp_path_factory.getbasetemp())
    yield
    for name in set(sys.modules) - loaded:
        if str(getattr(sys.modules[name], "__file__", None)).startswith(base):
            del sys.modules[name]
    sys.path[:] = [folder for folder in sys.path if not folder.startswith(base)]


@pytest.fixture
def drawing_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stills and videos are drawn by processes of their own, as for a user."""
    from mathnavi.renders import video
    from tests.renders.drawn import draw_apart

    monkeypatch.setattr(video, "draw", draw_apart)


@pytest.fixture
def trials_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trials and jobs run in this process, for tests of what becomes of their records."""
    from mathnavi.sim.sweep import execution
    from tests.sim.here import Here

    monkeypatch.setattr(execution, "Worker", lambda path: Here())


@pytest.fixture
def laid_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything in the figures of a report has its place, as for a user."""
    from mathnavi.renders import figures
    from tests.renders.reading import lay_out

    monkeypatch.setattr(figures, "lay_out", lay_out)


# Where a test or what its module shares takes seconds.
LONG = (
    *("test_studies.py", "test_wheel.py", "test_examples.py", "test_gallery_scripts.py", "test_readme.py"),
    "test_kernels_ahead.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest tests first, so that none of them is what one worker ends with while the others are idle."""
    items.sort(key=lambda item: item.path.name not in LONG)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Keep all tests and libraries out of the garbage collector, which would go through them again and again.

    Of what the tests make, hardly anything is a cycle: it looks for one after some more objects than is usual.
    """
    gc.disable()
    collected = yield
    gc.freeze()
    gc.set_threshold(20_000, 10, 20)
    gc.enable()
    return collected


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the kernels before the first test and before any worker: each then loads them from the cache.

    A process that compiles says so, which the tests of what is printed do not expect.
    """
    if hasattr(session.config, "workerinput") or session.config.option.collectonly:
        return
    from tests.kernels import compile_kernels

    compile_kernels()
