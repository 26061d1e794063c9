"""Sources of the published logs of the study, and their download.

Logs are read from a folder with a subfolder for each part, or downloaded from their publishers. Downloads are checked
by their SHA-256 digests (``pooch``) and kept in the cache of this package. None of them is part of this repository:
most state no licence.

| folder | what | published by |
|---|---|---|
| ``carmen`` | scans of buildings with poses by SLAM, of Radish | github.com/acschaefer/ple |
| ``plaza`` | a lawn mower among four radio beacons (Djugash et al.) | github.com/borglab/gtsam |
| ``mrclam6`` | unicycles among landmarks (Leung et al., 2011) | MR.CLAM, data set 6; not fetched |
| ``broad`` | gyro and accelerometer with motion capture (Laidig et al., 2021) | github.com/dlaidig/broad |
| ``ur10e`` | an arm, its positions and torques | github.com/shamilmamedov/dynamic_calibration |
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mathnavi.interfaces.cache_folder import cache_folder

_GITHUB = "https://raw.githubusercontent.com"
_PLE = f"{_GITHUB}/acschaefer/ple/cfcb5a7f12a793b616357381a688cfcc26eed347/data/carmen"
_GTSAM = f"{_GITHUB}/borglab/gtsam/0ffe6c930302ebd297484e65e6e8d467c91d26b0/examples/Data"
_BROAD = f"{_GITHUB}/dlaidig/broad/7e2f8189bb4a3ac91eae32c69b6bc87f08a6e2ad/data_mat"
_UR10E = (
    f"{_GITHUB}/shamilmamedov/dynamic_calibration/11af40e7deb758ec080a175fed8fcdd6c99aca29"
    "/dataset_ur10e/identification_data"
)
_PATIENCE = 30.0  # [s] for an answer


class NotAtHandError(RuntimeError):
    """The logs of a part are not on this machine and could not be fetched; the message says why."""


@dataclass(frozen=True)
class PublishedFile:
    """File that was published."""

    address: str
    digest: str  # SHA-256

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.address.rpartition("/")[2]


@dataclass(frozen=True)
class LogSource:
    """Logs of one kind: where they lie in a folder, and where they were published."""

    folder: str
    patterns: tuple[str, ...]  # of the names of its files
    published: tuple[PublishedFile, ...] = ()  # those that can be fetched


FLOORS = LogSource(
    "carmen",
    ("*.log", "*.log.gz"),
    tuple(
        PublishedFile(f"{_PLE}/{name}-corrected.log.gz", digest)
        for name, digest in (
            ("intel", "71bef16e9926506cf7417995ef35ace09dbd5de067fd042a3aab85188b5480dc"),
            ("freiburg-101", "7792de88bcb050f8edba92914aea75e8ec2fb73b483c01903bd2753aa655e982"),
            ("fhw", "4233abbfbc15baaddc730aceb3482dc660b25c9d5757005fff97a3fe083595b8"),
            ("edmonton", "96599a91e0cc9cb2570dbb92f92bbdf1e3a405b16aa99f6d3ce1a703011befdb"),
        )
    ),
)
BEACONS = LogSource(
    "plaza",
    ("*.mat",),
    (
        PublishedFile(
            f"{_GTSAM}/Plaza1_.mat", "9ccbfec19942eabecfa3206bff983bf708b98d6c7db462d81c55376f92d75847"
        ),
    ),
)  # fmt: skip
ATTITUDES = LogSource(
    "broad",
    ("*.mat",),
    tuple(
        PublishedFile(f"{_BROAD}/{name}.mat", digest)
        for name, digest in (
            ("01_undisturbed_slow_rotation_A", "ad2cec0390a279953084e1de12dfd8d542af55e4ea187e68e8ebb7c316ecb96b"),
            (
                "04_undisturbed_slow_rotation_with_breaks_A",
                "e414276dc54fd01337a9d26b1c635900e46218f4859f1f011f44dd9994df24e0",
            ),
            ("06_undisturbed_fast_rotation_A", "61cb32774b40c33d16a172dbe06503b4a3cb0b2d3e9b8eae0df66c313506a8e2"),
            (
                "08_undisturbed_fast_rotation_with_breaks_A",
                "18f754d90fc4442dd9b01e116bf2b763d71517098702d77096080657a9460fd3",
            ),
            ("10_undisturbed_slow_translation_A", "eee6293f1d0aaf8d0ac025b873667f6f7697acad318057f4fd6a801fb31c93c1"),
            ("15_undisturbed_fast_translation_A", "4290740d09dc3e055dd3cc939d083fa55321a9c90c0cb0aa3a6ffc26c4350951"),
            ("16_undisturbed_fast_translation_B", "fc97a89ca41c03b7f86793c20d8ce208fe085f8a1cc6e956cce03ebf3fa57c54"),
            ("21_undisturbed_fast_combined", "cb7be66ffc50d7d2b23abaf72a85a76925ea2db36a3fd575998811fcf68c219a"),
            ("24_disturbed_tapping_A", "1246fed1680a882a5f4d0dc2ae16e2db9dc90281fbaf1d486c84db1f27db51fa"),
            ("26_disturbed_phone_vibration_A", "545dda7c8b00548cfa476d53fa7e520bfae98f40ad2dac1b5686f5fda5117735"),
        )
    ),
)
UNICYCLES = LogSource("mrclam6", ("*.dat", "*.dat.gz"))
ARMS = LogSource(
    "ur10e",
    ("*.csv", "*.csv.gz"),
    tuple(
        PublishedFile(f"{_UR10E}/{name}.csv", digest)
        for name, digest in (
            ("ur-19_12_23_free", "62555d25fdcb989b6c97a9194f2c13d8cccdce99457c55696b83e107030f2a1f"),
            ("ur-20_01_31-load", "5abab622cdbd53db78fe3ec72485535c55ec5db412a179ae26bb9da6bea5441c"),
            ("ur-20_01_31-unload", "513feea3e662364fad89214d5ff49e6ef96e02d56f85b4de57a408fc2563cb1c"),
        )
    ),
)


def logs_of(source: LogSource, data: Path | None) -> tuple[str, ...]:
    """Files of a source in the folder ``data``, or fetched where it is None.

    Raises NotAtHandError, with the reason, where none can be had.
    """
    if data is None:
        return _fetched(source)
    folder = data / source.folder
    found = sorted({file for pattern in source.patterns for file in folder.glob(pattern)})
    if not found:
        raise NotAtHandError(f"no {' or '.join(source.patterns)} in {folder}")
    return tuple(str(file) for file in found)


def _fetched(source: LogSource) -> tuple[str, ...]:
    if not source.published:
        raise NotAtHandError(f"{source.folder} is not published file by file; --data FOLDER names where it lies")
    pooch = peer("pooch")
    if pooch is None:
        raise NotAtHandError("pooch is not installed (pip install 'mathnavi[logs]'), and no --data FOLDER is given")
    cache = cache_folder()
    if cache is None:
        raise NotAtHandError("no folder for what is fetched can be written to; --data FOLDER names where it lies")
    return tuple(_retrieved(pooch, each, cache / "logs" / source.folder) for each in source.published)


def _retrieved(pooch: Any, file: PublishedFile, folder: Path) -> str:
    try:
        return str(
            pooch.retrieve(
                file.address,
                f"sha256:{file.digest}",
                file.name,
                folder,
                downloader=pooch.HTTPDownloader(timeout=_PATIENCE),
            )
        )
    except (OSError, ValueError) as fault:  # no network, another content
        first = str(fault).strip().partition("\n")[0]
        raise NotAtHandError(f"{file.address}: {type(fault).__name__}: {first[:200]}") from fault


def peer(name: str) -> Any:
    """Module of a package that this one does not require; None where it is not installed."""
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


def named(files: Sequence[str], part: str) -> str | None:
    """First of ``files`` whose name has ``part`` in it; None if none has."""
    return next((file for file in files if part in Path(file).name), None)
