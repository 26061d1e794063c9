"""The ending of a file says what a video is; it has the pictures as they are, for the time that they take."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image, ImageSequence

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.renders import video
from mathnavi.renders.encoding import ENCODERS, FORMATS, checked_codec, checked_rate, encode
from mathnavi.renders.video import STILLS, write_still, write_video
from mathnavi.sim.scenarios.textbook import TextbookConfig, TextbookObserver

WIDTH, HEIGHT, COUNT = 128, 96, 8
COLOURS = {"gif": 2.0}  # root mean square error, of 255, of a codec without a loss but of colours
HELD = [(ending, codec) for ending, form in FORMATS.items() for codec in form.codecs or (None,)]
BLACK = np.zeros((64, 64, 3), np.uint8)


def pictures() -> list[Any]:
    """A bright square that moves over a slope of grey."""
    ground = np.repeat(np.linspace(20, 120, WIDTH, dtype=np.uint8)[None, :, None], HEIGHT, axis=0).repeat(3, axis=2)
    made = []
    for k in range(COUNT):
        picture = ground.copy()
        picture[30:60, 10 * k : 10 * k + 30] = (230, 180, 60)
        made.append(picture)
    return made


def read(path: Path) -> tuple[list[Any], float, str]:
    """Pictures of a video, its length [s], and its codec, as others read them."""
    if path.suffix in (".gif", ".webp"):
        with Image.open(path) as moving:
            assert moving.info["loop"] == 0
            frames = [
                (np.asarray(each.convert("RGB")), each.info["duration"]) for each in ImageSequence.Iterator(moving)
            ]
            shown, lengths = zip(*frames, strict=True)
            return list(shown), sum(lengths) / 1000.0, str(moving.format).lower()
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        decoded = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert container.duration is not None
        return decoded, container.duration / av.time_base, str(stream.codec_context.codec.canonical_name)


@pytest.mark.honoured("video", "MP4, WebM, GIF, WebP by the ending")
@pytest.mark.honoured("video", "frame rate as a fraction")
@pytest.mark.parametrize("fps", [24, 29.97, np.float32(12.5)])
@pytest.mark.parametrize(("ending", "codec"), HELD)
def test_each_format_keeps_the_pictures_for_their_time(
    ending: str, codec: str | None, fps: Any, tmp_path: Path
) -> None:
    path, form, rate = tmp_path / f"video{ending}", FORMATS[ending], checked_rate(fps, 240)
    chosen = checked_codec(codec, ending)
    encode(path, pictures(), (WIDTH, HEIGHT), rate, form, chosen)
    decoded, length, name = read(path)
    assert name == chosen
    tick = {".gif": 0.01, ".webp": 0.002}.get(ending, 0.001)  # WebP's last picture is as long as the one before
    assert length == pytest.approx(float(COUNT / rate), abs=tick)
    assert len(decoded) == COUNT
    for picture, original in zip(decoded, pictures(), strict=True):
        error = float(np.sqrt(np.mean((picture.astype(float) - original) ** 2)))
        assert error < COLOURS.get(chosen, 8.0), "of 255, root mean square"


def test_a_rate_is_the_fraction_that_is_meant() -> None:
    assert checked_rate(29.97, 240) == Fraction(2997, 100)
    assert checked_rate(30000 / 1001, 240) == Fraction(30000, 1001)
    assert checked_rate(Fraction(24000, 1001), 240) == Fraction(24000, 1001)
    assert checked_rate(np.int64(24), 240) == 24


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> mn.RunResult:
    folder = tmp_path_factory.mktemp("run")
    TextbookObserver.build(TextbookConfig("camera-and-flags", duration=0.2), 0).run().write(folder)
    return mn.load(folder)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int, int]]:
    """Sizes and numbers of the pictures that are asked for, which are black."""
    asked: list[tuple[int, int, int]] = []

    def draw(_: Path, frames: Any, width: int, height: int, samples: int) -> Iterator[Any]:
        assert type(width) is type(height) is int
        asked.append((width, height, len(frames)))
        return (np.zeros((height, width, 3), np.uint8) for _ in range(2))

    monkeypatch.setattr(video, "draw", draw)
    return asked


@pytest.mark.honoured("video", "NumPy's numbers as size and rate")
@pytest.mark.parametrize(
    ("name", "options", "size"),
    [
        ("a.MP4", {"width": np.int64(64), "height": np.uint8(48), "fps": np.float64(1.5)}, (64, 48)),
        ("a.gif", {}, (640, 360)),
        ("a.webm", {"width": None, "height": 64, "fps": None, "codec": None}, (1280, 64)),
    ],
)
def test_a_run_writes_what_the_ending_says(
    name: str, options: dict[str, Any], size: tuple[int, int], run: mn.RunResult, drawn: list[Any], tmp_path: Path
) -> None:
    path = run.video(tmp_path / name, **options)
    begun = {".mp4": b"ftyp", ".gif": b"9a", ".webm": b"\xa3"}[path.suffix.lower()]
    assert path.read_bytes()[:8].strip().find(begun) > 0
    assert drawn[0][:2] == size
    if options.get("fps"):
        with av.open(str(path)) as container:
            assert container.streams.video[0].average_rate == Fraction(3, 2)


@pytest.mark.refused("video", "AVI, MOV and other endings")
@pytest.mark.refused("video", "sizes and rates that are no numbers, odd, or out of range")
@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.avi", {}, r"^path = .*a\.avi; allowed: a name that ends in \.mp4, \.webm, \.gif or \.webp$"),
        ("a.mov", {}, r"a\.mov; allowed"),
        ("a", {}, r"/a; allowed"),
        ("gif", {}, r"/gif; allowed"),
        ("a.mp4.gz", {}, r"a\.mp4\.gz; allowed"),
        ("a.webm", {"codec": "h264"}, r"^codec = 'h264'; allowed in \.webm: av1, vp9$"),
        ("a.gif", {"codec": "av1"}, r"^codec = 'av1'; allowed in \.gif: none$"),
        ("a.mp4", {"codec": "gif"}, r"^codec = 'gif'; allowed in \.mp4: h264, av1, vp9$"),
        ("a.mp4", {"width": "640"}, r"^size = '640' x 720; allowed: even numbers from 16 to 8192$"),
        ("a.mp4", {"width": 641, "height": 480}, r"^size = 641 x 480; allowed"),
        ("a.mp4", {"height": 640.0}, r"^size = 1280 x 640\.0; allowed"),
        ("a.mp4", {"width": 0}, r"^size = 0 x 720; allowed"),
        ("a.mp4", {"width": 10**9}, r"^size = 1000000000 x 720; allowed"),
        ("a.mp4", {"width": True}, r"^size = True x 720; allowed"),
        ("a.mp4", {"fps": "24"}, r"^fps = '24'; allowed: a number from 1 to 240$"),
        ("a.mp4", {"fps": float("nan")}, r"^fps = nan; allowed"),
        ("a.mp4", {"fps": 0}, r"^fps = 0; allowed"),
        ("a.gif", {"fps": 60}, r"^fps = 60; allowed: a number from 1 to 50$"),
    ],
)
def test_what_is_no_video_is_refused_in_one_line(
    name: str, options: dict[str, Any], words: str, run: mn.RunResult, drawn: list[Any], tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=words) as refusal:
        run.video(tmp_path / name, **options)
    assert "\n" not in str(refusal.value)
    assert not drawn
    assert not list(tmp_path.iterdir())


@pytest.mark.honoured("image", "PNG, JPEG, WebP by the ending")
@pytest.mark.parametrize(("ending", "form"), [(".png", "PNG"), (".jpg", "JPEG"), (".webp", "WEBP")])
def test_a_still_is_what_its_ending_says(
    ending: str, form: str, run: mn.RunResult, drawn: list[Any], tmp_path: Path
) -> None:
    assert run.folder is not None
    with Image.open(write_still(run.folder, path=tmp_path / f"still{ending}", width=64, height=48)) as picture:
        assert (picture.format, picture.size) == (form, (64, 48))
    assert set(STILLS) >= {ending}


@pytest.mark.refused("image", "SVG, PDF and other endings of a picture, and pages that are no HTML")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("--out y.avi", "--out = y.avi; allowed: a name that ends in .mp4, .webm, .gif or .webp"),
        ("--out y.png", "--out = y.png; allowed: a name that ends in .mp4, .webm, .gif or .webp"),
        ("--still --out y.svg", "--out = y.svg; allowed: a name that ends in .png, .jpg, .jpeg or .webp"),
        ("--clip --out y.gif", "--out = y.gif; allowed: a name that ends in .webp"),
        ("--out y.gif --codec av1", "--codec = 'av1'; allowed in .gif: none"),
    ],
)
def test_the_command_refuses_other_endings(
    words: str, expected: str, run: mn.RunResult, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["render", str(run.folder), *words.split()]) == 2
    assert capsys.readouterr().err == f"mathnavi: {expected}\n"


def test_the_command_writes_the_file_that_is_named(run: mn.RunResult, drawn: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "new" / "y.gif"
    assert main(["render", str(run.folder), "--out", str(path)]) == 0
    assert path.read_bytes().startswith(b"GIF89a")
    assert not list(run.folder.glob("*.mp4"))  # type: ignore[union-attr]


def test_a_page_is_html(run: mn.RunResult, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match=r"page\.pdf; allowed: a name that ends in \.html or \.htm"):
        run.report(tmp_path / "page.pdf")
    assert main(["view", str(run.folder), "--save", "page.txt"]) == 2
    assert capsys.readouterr().err == "mathnavi: --save = page.txt; allowed: a name that ends in .html or .htm\n"


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
