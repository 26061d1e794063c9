"""The header of every array is checked before anything is allocated for it."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.reading import arrays
from mathnavi.interfaces.reading.arrays import decoded_npz, read_npz, read_raw


def header(shape: str, dtype: str = "'<f8'") -> bytes:
    text = f"{{'descr': {dtype}, 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text


def npz(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (header("(1000000000000, 8)"), "array 'z' states the shape"),
        (header("(3,)") + bytes(16), "24 bytes, and holds 16"),
        (header("(2,)") + bytes(24), "16 bytes, and holds 24"),
        (header("(-1, -2)") + bytes(16), "states the shape"),
        (header("(2, 'a')"), "not a readable .npz file"),
        (header("(1,)", "'|O'") + bytes(8), "the type object; allowed: numbers"),
        (header("(1,)", "[('a', '<f8')]") + bytes(8), "allowed: numbers"),
        (header("(1,)", "'<U2'") + bytes(8), "allowed: numbers"),
        (header("(" * 500 + ")" * 500), "not a readable .npz file"),
        (b"not an array", "not a readable .npz file"),
        (b"", "not a readable .npz file"),
    ],
)
def test_an_array_that_is_not_as_it_says_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = npz(tmp_path / "log.npz", z=content)
    with pytest.raises(RunFolderError, match=message) as refused:
        read_npz(path, RunFolderError)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_zip_bomb_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arrays, "MOST_BYTES", 10_000)
    path = npz(tmp_path / "log.npz", **{f"a{k}": header("(1000,)") + bytes(8000) for k in range(2)})
    assert path.stat().st_size < 10_000
    with pytest.raises(RunFolderError, match=r"its arrays have \d+ bytes; allowed: at most 10000"):
        read_npz(path, RunFolderError)
    monkeypatch.setattr(arrays, "MOST_ARRAYS", 1)
    with pytest.raises(RunFolderError, match="2 arrays; allowed: at most 1"):
        read_npz(path, RunFolderError)


@pytest.mark.parametrize("cut", [1, 40, 200])
def test_a_damaged_archive_is_refused(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "log.npz"
    np.savez_compressed(path, a=np.arange(100.0))
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(RunFolderError, match=r"not a readable \.npz file"):
        read_npz(path, RunFolderError)


@pytest.mark.parametrize("value", [np.arange(6.0).reshape(2, 3), np.float32(3.0), np.zeros((0, 4)), np.array([True])])
def test_what_was_saved_is_read(tmp_path: Path, value: Any) -> None:
    block = io.BytesIO()
    np.savez_compressed(block, a=value, b=np.asfortranarray(value))
    back = decoded_npz(block.getvalue(), "a result", ValueError)
    assert back.keys() == {"a", "b"}
    for array in back.values():
        assert array.dtype == np.asarray(value).dtype
        np.testing.assert_array_equal(array, value)


def test_only_the_arrays_that_are_wanted_are_read(tmp_path: Path) -> None:
    path = npz(tmp_path / "map.npz", z=header("(1,)") + bytes(8), other=b"no array")
    assert read_npz(path, ValueError, names=("z", "meta")).keys() == {"z"}


def test_raw_bytes_have_the_size_of_their_shape(tmp_path: Path) -> None:
    path = tmp_path / "tile.hgt"
    path.write_bytes(bytes(range(8)))
    np.testing.assert_array_equal(read_raw(path, ">i2", (2, 2), ValueError), [[1, 515], [1029, 1543]])
    for shape in ((3, 2), (1, 2)):
        with pytest.raises(ValueError, match="bytes; allowed: "):
            read_raw(path, ">i2", shape, ValueError)
