"""CPU time [s] of the parts of a video, as JSON: a script with the arguments RUN WIDTH HEIGHT FRAMES.

``benchmarks.video_time`` starts it in a separate process, for OpenGL's backend must be chosen before mujoco is
imported. *Bare* is MuJoCo's renderer alone with the scene in the camera's view: the least time of a drawing of this
size.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.encoding import FORMATS
from mathnavi.renders.film import TOUR, Frame
from mathnavi.renders.painter import ScenePainter
from mathnavi.renders.video import VIDEO_SAMPLES


def measured(directory: Path, width: int, height: int, count: int) -> dict[str, float]:
    """Return CPU times [s]: of the scene, once; per frame of the drawing, of its bare part, and of the whole frame."""
    taken: dict[str, float] = defaultdict(float)

    def timed(name: str, work: Callable[[], Any]) -> Any:
        began = time.process_time()
        done = work()
        taken[name] += time.process_time() - began
        return done

    drawing = drawing_of(directory)
    run = drawing.load_run(directory)
    frames: list[Frame] = list(drawing.frames(run, TOUR, FORMATS[".mp4"].fps))
    began = time.process_time()
    with drawing.painter(run, width, height, VIDEO_SAMPLES) as painter:
        assert isinstance(painter, ScenePainter)
        for frame in {frame.camera: frame for frame in frames}.values():
            painter.paint(frame)
        taken["scene"] = time.process_time() - began
        renderer = painter.scene.stage._renderer
        for frame in frames[:: max(1, len(frames) // count)][:count]:
            timed("frame", partial(painter.paint, frame))
            timed("drawing", partial(painter.scene.draw, frame.t, frame.camera, frame.turn))
            timed("bare", renderer.render)
    share = min(count, len(frames))
    return {name: total if name == "scene" else total / share for name, total in taken.items()}


if __name__ == "__main__":
    print(json.dumps(measured(Path(sys.argv[1]), *map(int, sys.argv[2:5]))))
