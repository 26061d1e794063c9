"""``mathnavi render``: a video, a still or a clip of a run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from mathnavi.commands import opengl
from mathnavi.commands.arguments import FlagGroup, parse, with_flag
from mathnavi.commands.deadline import WallDeadline, watched
from mathnavi.commands.errors import BadInputError, bad_input, print_error
from mathnavi.commands.recorded_run import reading_run
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import checked_ending
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Positional


@configuration
class RenderOptions:
    """Flags of the command: the run to draw, and how."""

    folder: Annotated[Path, Positional("DIR")]
    """folder of a run; the picture is written into it if --out is not given"""
    out: Path | None = None
    """file of the picture, whose ending says the format: .mp4, .webm, .gif or .webp of a video, .png, .jpg or .webp of
    a still, .webp of a clip; video.mp4, CAMERA.mp4, CAMERA.png or CAMERA.webp in DIR if not given"""
    camera: str | None = None
    """camera; of flights chase, overview, top; of fleets overview, top, arrival; of missiles chase, side, target; of
    the robots of range-localisation top, chase; of bodies and arms panel, scene; of your own vehicles fixed, track,
    top, board, and the cameras of their model"""
    still: bool = False
    """whether to draw a still picture instead of a video"""
    time: float | None = None
    """moment of the still [s]; the one with most to see if not given"""
    codec: Literal["h264", "av1", "vp9"] | None = None
    """codec of the video; h264 of an MP4, vp9 of a WebM if not given; av1 and vp9 are encoded without a library under
    the GPL"""
    clip: bool = False
    """whether to draw a small clip that plays for five seconds, an animated WebP, instead of a video"""
    begin: float | None = None
    """beginning of the clip [s]; that of the run's highlight if not given"""
    end: float | None = None
    """end of the clip [s]; that of the run's highlight if not given"""
    wall_deadline: WallDeadline | None = None
    """limit of wall-clock time [s], after which the command is ended; none if not given"""
    trust: bool = False
    """whether to import code that DIR names and that is not installed; it runs with your rights"""

    def __post_init__(self) -> None:
        if self.still and self.clip:
            raise FieldError("--clip = True; allowed: not together with --still")
        if self.codec is not None and (self.still or self.clip):
            raise FieldError(f"--codec = {self.codec}; allowed: only for a video, not with --still or --clip")
        for name, value, needed in (
            ("time", self.time, "still"),
            ("begin", self.begin, "clip"),
            ("end", self.end, "clip"),
        ):
            if value is not None and not getattr(self, needed):
                raise FieldError(f"--{name} = {value!r}; allowed: only together with --{needed}")


def main(argv: Sequence[str]) -> int:
    if (code := watched("render", argv)) is not None:
        return code
    purpose = "Draw a run: video.mp4, CAMERA.mp4, CAMERA.png or CAMERA.webp, or the file of --out."
    (options,) = parse(argv, "mathnavi render", purpose, FlagGroup(RenderOptions))
    opengl.check_choice()
    from mathnavi.models.opengl import NoOpenGLError
    from mathnavi.renders.clip import write_clip  # the drawing modules take a while to import
    from mathnavi.renders.encoding import FORMATS
    from mathnavi.renders.film import TOUR
    from mathnavi.renders.video import STILLS, write_still, write_video

    if options.out is not None:
        with bad_input():
            checked_ending(options.out, STILLS if options.still else (".webp",) if options.clip else FORMATS, "--out")
    film = options.out or options.folder / f"{options.camera or 'video'}.mp4"
    try:
        with reading_run(options.folder, options.trust, {"--out": options.out}):
            if options.still:
                path = write_still(options.folder, options.camera, options.out, t=options.time)
            elif options.clip:
                path = write_clip(
                    options.folder,
                    options.camera,
                    begin=options.begin,
                    end=options.end,
                    path=options.out,
                    progress=True,
                )
            else:
                path = write_video(
                    options.folder,
                    options.camera or TOUR,
                    path=film,
                    progress=True,
                    codec=options.codec,
                )
    except BadInputError as error:
        raise BadInputError(with_flag(str(error), ("--camera", "--codec", "--time", "--begin", "--end"))) from error
    except (NoOpenGLError, RuntimeError) as error:
        print_error(f"nothing drawn: {error}")
        return 1
    print(path)
    return 0
