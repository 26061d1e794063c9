"""Bodies in the browser's scene."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.palette import SceneElement
from mathnavi.renders.scene.bodies import ghosts
from mathnavi.renders.scene.elements import Layer, Surface

CORNERS = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 3.0], [1.0, 6.0, 3.0], [1.0, 2.0, 9.0]])
FACES = np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]])


def test_an_estimate_that_is_right_lies_within_the_vehicle() -> None:
    hull = Surface(CORNERS, FACES, (1.0, 1.0, 1.0), motion="hull")
    still = Surface(CORNERS, FACES, (1.0, 1.0, 1.0))
    part = SceneElement.ESTIMATE
    (ghost,) = ghosts([hull, still], {"hull": "estimated"}, part, Layer.for_element(part))
    assert (ghost.vertices.min(axis=0) > CORNERS.min(axis=0)).all()
    assert (ghost.vertices.max(axis=0) < CORNERS.max(axis=0)).all()
    assert ghost.motion == "estimated"
    assert not ghost.shadow
