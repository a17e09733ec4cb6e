"""Pictures of the moving arm, rendered without a screen, and files made of them."""

import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from PIL import Image

from musashi_muscle_bridge.simulation.camera import Picture, VideoError
from musashi_muscle_bridge.simulation.motion_jpeg import motion_jpeg_mp4

FRAME_RATE = 50
"""[1/s]"""
_ANIMATED = (".gif", ".webp", ".png")


def frames_of(times: Sequence[float], slowdown: float = 1.0) -> Iterator[int]:
    """Return which of the samples at `times` [s] are shown, one for each frame.

    slowdown  how many times slower than real time the video runs
    """
    step = 1.0 / (FRAME_RATE * slowdown)
    due = times[0]
    for index, time in enumerate(times):
        # One sample can be shown in several frames of a slow video.
        while time >= due - 1e-9:
            yield index
            due += step


def write_video(path: Path, pictures: Iterable[Picture]) -> None:
    """Write an .mp4, or an animated .gif, .webp or .png, or a folder of numbered frames.

    Raises VideoError for another ending or if the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in (".mp4", *_ANIMATED, ""):
        raise VideoError(
            f"{path}: cannot write '{suffix}', choose .mp4, {', '.join(_ANIMATED)} or, for "
            "single frames, a folder's name without an ending"
        )
    images = [Image.fromarray(picture) for picture in pictures]
    try:
        _write(path, suffix, images)
    except OSError as error:
        raise VideoError(f"{path}: cannot be written: {error.strerror or error}") from error


def _write(path: Path, suffix: str, images: Sequence[Image.Image]) -> None:
    if suffix == ".mp4":
        files = [_jpeg(image) for image in images]
        path.write_bytes(motion_jpeg_mp4(files, *images[0].size, FRAME_RATE))
    elif suffix:
        duration = round(1000 / FRAME_RATE)
        images[0].save(path, save_all=True, append_images=images[1:], duration=duration, loop=0)
    else:
        path.mkdir(parents=True, exist_ok=True)
        for number, image in enumerate(images):
            image.save(path / f"frame_{number:05d}.png")


def _jpeg(image: Image.Image) -> bytes:
    file = io.BytesIO()
    image.save(file, "JPEG", quality=90)
    return file.getvalue()
