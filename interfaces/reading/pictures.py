"""Reader of pictures, whose size is checked before they are decoded."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from mathnavi.interfaces.reading.arrays import MOST_BYTES
from mathnavi.interfaces.reading.files import Refusal, opened
from mathnavi.interfaces.signals import Array

MOST_PIXELS = 50_000_000


def check_pixels(width: int, height: int, path: Path, error: Refusal) -> None:
    """Raise ``error`` for a picture or a raster that is too large."""
    if width * height > MOST_PIXELS:
        raise error(f"{path}: {width} x {height} pixels; allowed: at most {MOST_PIXELS} in all")


def read_picture(path: Path, error: Refusal, formats: tuple[str, ...] = ("PNG",)) -> tuple[Image.Image, Array]:
    """Read a picture in one of Pillow's ``formats``, and its values (rows, cols) as stored, row 0 on top."""
    try:
        # A warning of pillow is either an error, or on a large map, which is allowed.
        with (
            warnings.catch_warnings(action="ignore"),
            opened(path, error, MOST_BYTES) as file,
            Image.open(file, formats=formats) as image,
        ):
            check_pixels(*image.size, path, error)
            image.load()
    except (error, FileNotFoundError):
        raise
    except (UnidentifiedImageError, Image.DecompressionBombError) as fault:
        raise error(f"{path}: pillow cannot read it ({fault})") from None
    except Exception as fault:  # a damaged picture raises nearly anything: OSError, SyntaxError, struct.error, ...
        raise error(f"{path}: pillow cannot read it ({fault or type(fault).__name__})") from None
    return image, np.asarray(image).astype(np.float64)
