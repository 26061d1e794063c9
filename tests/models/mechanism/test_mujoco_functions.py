"""MuJoCo's functions as compiled code calls them."""

from __future__ import annotations

import pytest

from mathnavi.models.mechanism.kernels import ADDRESS, function


def test_a_function_that_mujoco_lacks_is_refused_where_it_is_asked_for() -> None:
    function("mj_kinematics", ADDRESS, ADDRESS)
    with pytest.raises(ImportError, match="has no function mj_nothing"):
        function("mj_nothing", ADDRESS)
