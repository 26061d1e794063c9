"""The triangles are MuJoCo's: rays cast in a compiled model meet the ground where the height field has it.

MuJoCo stores heights in float32, as shares of the range from the lowest to the highest node. Over 3000 m that rounds by
2e-4 m, and on a slope of 45 degrees a slanted ray carries a multiple of it; 1e-2 m bounds both with room to spare. An
interpolation other than on these triangles would be off by metres.
"""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from mathnavi.models.terrain.height_field import HeightField

TOLERANCE = 1e-2  # [m]


@pytest.fixture(scope="module")
def terrain() -> HeightField:
    z = np.random.default_rng(3).uniform(500.0, 3500.0, (12, 17))  # not square: rows and columns cannot be mixed up
    return HeightField(z, 400.0)


@pytest.fixture(scope="module")
def model_and_data(terrain: HeightField) -> tuple[mujoco.MjModel, mujoco.MjData]:
    low, high = terrain.z.min(), terrain.z.max()
    spec = mujoco.MjSpec()
    rows, columns = terrain.z.shape
    spec.add_hfield(
        name="ground",
        nrow=rows,
        ncol=columns,
        size=[terrain.width / 2, terrain.depth / 2, high - low, 100.0],
        userdata=((terrain.z - low) / (high - low)).ravel(),
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="ground", pos=[terrain.width / 2, terrain.depth / 2, low]
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def distance(model_and_data: tuple[mujoco.MjModel, mujoco.MjData], p: np.ndarray, direction: np.ndarray) -> float:
    """[m] along the unit vector ``direction`` to the ground; -1 if it is not met."""
    hit = np.zeros(1, dtype=np.int32)
    return float(mujoco.mj_ray(*model_and_data, p, direction, None, 1, -1, hit, None))


def test_slanted_rays_stop_where_line_of_sight_ends(
    terrain: HeightField, model_and_data: tuple[mujoco.MjModel, mujoco.MjData]
) -> None:
    rng = np.random.default_rng(5)
    blocked = 0
    for _ in range(300):
        xy = rng.uniform(1.0, [terrain.width - 1.0, terrain.depth - 1.0], (2, 2))
        p, q = np.column_stack([xy, terrain.height(*xy.T) + rng.uniform(10.0, 2000.0, 2)])
        length = float(np.linalg.norm(q - p))
        direction = (q - p) / length
        met = distance(model_and_data, p, direction)
        free = met < 0.0 or met > length
        if abs(terrain.arc_clearance(p, q - p, np.zeros(3), 1.0)) > TOLERANCE:  # else rounding decides
            assert terrain.line_of_sight(p, q) == free
        if not free:
            blocked += 1
            assert terrain.height(*(p + met * direction)[:2]) == pytest.approx((p + met * direction)[2], abs=TOLERANCE)
    assert 50 < blocked < 250
