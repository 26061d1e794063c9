"""Runs of robots that find themselves, shared by all tests of their pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.renders.ranging.run_data import RangingRun, load_run
from tests.renders.ranging.believers import believed


@pytest.fixture(scope="session")
def bank_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with hypotheses, for a while without ranges."""
    folder = tmp_path_factory.mktemp("bank")
    believed("bank", outage=((2.0, 3.0),)).write(folder)
    return folder


@pytest.fixture(scope="session")
def bank_run(bank_dir: Path) -> RangingRun:
    return load_run(bank_dir)


@pytest.fixture(scope="session")
def observer_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in MuJoCo's contacts, its estimator an observer without a covariance."""
    folder = tmp_path_factory.mktemp("observer")
    believed("observer", duration=2.0, drive="differential", sensors=(0.0, 120.0, -120.0)).write(folder)
    return folder


@pytest.fixture(scope="session")
def observer_run(observer_dir: Path) -> RangingRun:
    return load_run(observer_dir)


@pytest.fixture(scope="session")
def silent_run(tmp_path_factory: pytest.TempPathFactory) -> RangingRun:
    """An estimator that never says anything."""
    folder = tmp_path_factory.mktemp("silent")
    believed("silent", duration=1.0).write(folder)
    return load_run(folder)
