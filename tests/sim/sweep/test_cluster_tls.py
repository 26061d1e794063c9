"""A cluster over TLS: with the certificates that Dask is configured with, and refused in one line without."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from mathnavi.sim.records.store import Store
from mathnavi.sim.sweep.cluster import check
from mathnavi.sim.sweep.execution import run_trials
from tests.sim.sweep.test_execution import coins

distributed = pytest.importorskip("distributed")
dask_config = pytest.importorskip("dask.config")
pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="makes its certificates with openssl")


def certificate(folder: Path, name: str) -> tuple[str, str]:
    """A certificate that has signed itself, and its key."""
    made = folder / f"{name}.pem", folder / f"{name}.key"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    files = ["-days", "1", "-subj", f"/CN={name}", "-out", str(made[0]), "-keyout", str(made[1])]
    subprocess.run([*command, *files], check=True, capture_output=True)
    return str(made[0]), str(made[1])


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str]:
    return certificate(tmp_path_factory.mktemp("ours"), "ours")


def client(file: str, key: str) -> Any:
    """Dask's configuration of who connects with a certificate, as ``~/.config/dask`` would have it."""
    tls = "distributed.comm.tls"
    return dask_config.set({f"{tls}.ca-file": file, f"{tls}.client.cert": file, f"{tls}.client.key": key})


@pytest.fixture(scope="module")
def address(ours: tuple[str, str]) -> Iterator[str]:
    """The scheduler of a cluster that accepts nobody without the certificate."""
    file, key = ours
    parts = {
        f"tls_{part}_{what}": value
        for part in ("scheduler", "worker", "client")
        for what, value in (("cert", file), ("key", key))
    }
    security = distributed.Security(tls_ca_file=file, require_encryption=True, **parts)
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tls://", host="127.0.0.1", security=security,
        dashboard_address=None, silence_logs=50,
    ) as made:  # fmt: skip
        yield made.scheduler_address


def test_trials_run_on_a_cluster_over_tls(address: str, ours: tuple[str, str], tmp_path: Path) -> None:
    assert address.startswith("tls://")
    with client(*ours), Store.open(tmp_path / "there.db") as there, Store.open(tmp_path / "here.db") as here:
        found = run_trials(coins(2), there, cluster=address)
        assert [record.summary for record in found] == [record.summary for record in run_trials(coins(2), here)]


def test_nobody_connects_without_the_certificate(address: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"cluster = 'tls://.*allowed"):
        check(address)
    with pytest.raises(ValueError, match=r"cluster = 'tcp://.*allowed"):
        check(address.replace("tls", "tcp"))
    with client(*certificate(tmp_path, "theirs")), pytest.raises(ValueError, match=r"cluster = 'tls://.*allowed"):
        check(address)
