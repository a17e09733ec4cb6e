"""Pictures are taken without a screen and written as what the file's ending says."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fastswing_planner.robot.description import Robot
from musashi_muscle_bridge.commands.view_swing import require_screen
from musashi_muscle_bridge.simulation import camera as camera_module
from musashi_muscle_bridge.simulation.camera import Camera, VideoError
from musashi_muscle_bridge.simulation.video import frames_of, write_video

RED, BLUE = (np.full((16, 24, 3), colour, dtype=np.uint8) for colour in ((255, 0, 0), (0, 0, 255)))


def test_two_postures_look_different(musashi: Robot) -> None:
    try:
        camera = Camera(musashi, 80, 60)
    except VideoError as error:
        pytest.skip(str(error))
    home, start = (camera.picture(musashi.postures[name]) for name in ("home", "start"))
    camera.close()
    assert home.shape == (60, 80, 3)
    assert (home != start).any()


def test_a_machine_without_opengl_is_told_what_to_install(
    musashi: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> None:
        raise ImportError(f"no {name}")

    monkeypatch.setattr(camera_module.importlib, "import_module", missing)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with pytest.raises(VideoError) as caught:
        Camera(musashi)
    assert str(caught.value) == (
        "no OpenGL without a screen here (egl: no mujoco.egl; osmesa: no mujoco.osmesa): install "
        "libegl1 and libgl1-mesa-dri, or libosmesa6"
    )


def test_frames_come_at_the_videos_rate() -> None:
    times = [0.001 * step for step in range(1000)]
    assert len(list(frames_of(times))) == 50


def test_a_slow_video_shows_more_frames() -> None:
    times = [0.001 * step for step in range(1000)]
    assert len(list(frames_of(times, slowdown=4.0))) == 200


@pytest.mark.parametrize("suffix", [".gif", ".webp", ".png"])
def test_an_animation_has_all_frames(tmp_path: Path, suffix: str) -> None:
    write_video(tmp_path / f"swing{suffix}", [RED, BLUE, RED])
    with Image.open(tmp_path / f"swing{suffix}") as animation:
        assert getattr(animation, "n_frames", 1) == 3


def test_an_mp4_holds_the_pictures_as_jpeg(tmp_path: Path) -> None:
    write_video(tmp_path / "swing.mp4", [RED, BLUE])
    assert (tmp_path / "swing.mp4").read_bytes().count(b"\xff\xd8\xff") == 2


def test_a_folder_gets_numbered_frames(tmp_path: Path) -> None:
    write_video(tmp_path / "frames", [RED, BLUE])
    names = sorted(path.name for path in (tmp_path / "frames").iterdir())
    assert names == ["frame_00000.png", "frame_00001.png"]


def test_an_unknown_ending_lists_the_choices(tmp_path: Path) -> None:
    path = tmp_path / "swing.avi"
    with pytest.raises(VideoError) as caught:
        write_video(path, [RED])
    assert str(caught.value) == (
        f"{path}: cannot write '.avi', choose .mp4, .gif, .webp, .png or, for single frames, a "
        "folder's name without an ending"
    )


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "none" / "swing.mp4"
    with pytest.raises(VideoError) as caught:
        write_video(path, [RED])
    assert str(caught.value) == f"{path}: cannot be written: No such file or directory"


def test_the_viewer_says_what_to_do_without_a_screen() -> None:
    with pytest.raises(VideoError) as caught:
        require_screen({"DISPLAY": ""})
    assert str(caught.value) == (
        "no screen: neither DISPLAY nor WAYLAND_DISPLAY is set; simulate_swing --video renders "
        "without one"
    )


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY"])
def test_the_viewer_takes_either_kind_of_screen(variable: str) -> None:
    require_screen({variable: ":0"})
