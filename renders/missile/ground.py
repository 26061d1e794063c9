"""The ground under a missile: a plain with lines a hundred metres apart, to see how fast it passes by."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft2, rfft2

from mathnavi.renders.palette import Picture

Array = NDArray[np.float32]  # as exact as pixels need, and half the time

TILE = 800.0  # [m] side of the picture, which repeats
PIXELS = 1600
LINE = 100.0  # [m] from line to line
SAND, GRASS, BUSH, WHITE = np.array([[202, 186, 146], [136, 148, 100], [64, 84, 52], [240, 240, 240]], np.float32)
OCTAVES = ((90.0, 1.0), (28.0, 0.6), (8.0, 0.35), (2.0, 0.2), (0.7, 0.15))  # width [pixels] and strength of the noise
BUSH_WIDTH = 1.1  # [pixels]


@lru_cache(maxsize=1)
def ground_picture() -> Picture:
    """(PIXELS, PIXELS, 3); its edges fit together."""
    rng = np.random.default_rng(4)
    cover, grain, bushes = _noise(rng, OCTAVES), _noise(rng, OCTAVES), _noise(rng, ((BUSH_WIDTH, 1.0),))
    share = (1.0 / (1.0 + np.exp(-1.6 * cover)))[..., None]
    picture = SAND + share * (GRASS - SAND) + 8.0 * grain[..., None]
    covered = np.clip((bushes + 0.5 * cover - 2.1) / 0.5, 0.0, 1.0).astype(np.float32)
    picture = _blended(picture, BUSH, 0.75 * covered)
    lines = np.zeros(PIXELS, np.float32)
    step = round(LINE / TILE * PIXELS)
    lines[::step] = lines[1::step] = 0.45
    picture = _blended(picture, WHITE, np.maximum(lines[:, None], lines[None, :]))
    clipped: Picture = np.clip(picture, 0.0, 255.0).astype(np.uint8)
    return clipped


def _blended(picture: Array, colour: Array, share: Array) -> Array:
    """Blend a colour into each pixel by its share."""
    blended: Array = picture + share[..., None] * (colour - picture)
    return blended


def _noise(rng: np.random.Generator, octaves: tuple[tuple[float, float], ...]) -> Array:
    """(PIXELS, PIXELS) periodic noise: white noise blurred by Gaussians, each of its strength (rms), added up."""
    across = np.exp(-2.0 * np.pi**2 * np.fft.fftfreq(PIXELS) ** 2)  # of a Gaussian one pixel wide
    along = np.exp(-2.0 * np.pi**2 * np.fft.rfftfreq(PIXELS) ** 2)
    passed = np.zeros((PIXELS, len(along)))
    for width, strength in octaves:
        rows, columns = across**width**2, along**width**2
        rms = np.sqrt(np.mean(rows**2) * np.mean(np.r_[columns, columns[1:-1]] ** 2))
        passed += strength / rms * rows[:, None] * columns
    white = rng.standard_normal((PIXELS, PIXELS)).astype(np.float32)
    noise: Array = irfft2(rfft2(white) * passed.astype(np.float32))
    return noise
