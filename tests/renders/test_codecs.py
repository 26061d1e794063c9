"""Videos are encoded as requested; without an encoder the codec is refused, with those that there are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from mathnavi.commands.cli import main
from mathnavi.renders import video
from mathnavi.renders.video import ENCODERS, write_video

WIDTH, HEIGHT, COUNT = 128, 96, 8


def pictures() -> list[Any]:
    """A bright square that moves over a slope of grey."""
    ground = np.repeat(np.linspace(20, 120, WIDTH, dtype=np.uint8)[None, :, None], HEIGHT, axis=0).repeat(3, axis=2)
    made = []
    for k in range(COUNT):
        picture = ground.copy()
        picture[30:60, 10 * k : 10 * k + 30] = (230, 180, 60)
        made.append(picture)
    return made


@pytest.mark.parametrize("codec", ENCODERS)
def test_each_codec_keeps_the_pictures(codec: Any, tmp_path: Path) -> None:
    path = tmp_path / "video.mp4"
    video._encode(path, pictures(), WIDTH, HEIGHT, 24, codec)
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        decoded = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert codec in (stream.codec_context.codec.canonical_name, stream.codec_context.name)
    assert len(decoded) == COUNT
    for picture, original in zip(decoded, pictures(), strict=True):
        error = float(np.sqrt(np.mean((picture.astype(float) - original) ** 2)))
        assert error < 8.0, "of 255, root mean square"


def test_only_h264_needs_a_library_under_the_gpl() -> None:
    under_gpl = {"libx264", "libx265", "libxvid"}
    assert {codec for codec, (encoder, _) in ENCODERS.items() if encoder in under_gpl} == {"h264"}


def test_an_encoder_that_ffmpeg_lacks_is_refused_before_a_run_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = av.Codec

    def without_x264(name: str, mode: str) -> Any:
        return found("none" if name == "libx264" else name, mode)

    monkeypatch.setattr(av, "Codec", without_x264)
    with pytest.raises(ValueError, match=r"codec = 'h264'; allowed with the FFmpeg .*: av1, vp9"):
        write_video(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError):
        write_video(tmp_path / "nowhere", codec="av1")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("render run --codec av1 --still", "--codec = av1; allowed: only for a video"),
        ("render run --codec vp9 --clip", "--codec = vp9; allowed: only for a video"),
        ("render run --codec theora", "h264"),
        ("run textbook-observer --codec av1", "--codec = av1; allowed: only together with --video"),
    ],
)
def test_a_codec_is_for_a_video(words: str, expected: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words.split()) == 2
    assert expected in capsys.readouterr().err
