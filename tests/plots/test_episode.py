import shutil

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from nichechain.core.errors import NichechainError
from nichechain.domains import Film, Motion
from nichechain.plots import episode, plot_motion, watch_elite


def _film(moments=6):
    shades = np.arange(moments, dtype=np.uint8)[:, None, None, None] * 30
    return Film(np.broadcast_to(shades, (moments, 10, 12, 3)).copy(), 10.0)


def test_film_as_gif_has_every_moment(tmp_path):
    out = tmp_path / "film.gif"
    episode.write_film(_film(), out)
    with Image.open(out) as film:
        assert (film.n_frames, film.size) == (6, (12, 10))
        film.seek(1)
        assert film.info["duration"] == 100
        film.seek(5)
        assert film.convert("RGB").getpixel((3, 3)) == (150, 150, 150)


def test_film_as_picture_has_six_moments(tmp_path):
    out = tmp_path / "film.png"
    episode.write_film(_film(11), out)
    with Image.open(out) as sheet:
        assert sheet.size == (36, 20)
        assert [sheet.getpixel((12 * k + 1, y))[0] for y in (1, 11) for k in range(3)] == [
            30 * (k % 11) % 256 for k in (0, 2, 4, 6, 8, 10)
        ]


def test_film_as_mp4(tmp_path):
    if shutil.which("ffmpeg") is None:
        pytest.skip("ffmpeg is not installed")
    out = tmp_path / "film.mp4"
    episode.write_film(_film(), out)
    assert out.read_bytes()[4:8] == b"ftyp"
    assert [path.name for path in tmp_path.iterdir()] == ["film.mp4"]


def test_mp4_without_ffmpeg_is_refused_before_the_episode(arm_archive, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda _: None)
    with pytest.raises(NichechainError, match="needs ffmpeg, which is not installed"):
        watch_elite(arm_archive, 99_999, tmp_path / "film.mp4")


def test_arm_is_drawn(arm_archive, tmp_path):
    niche = int(arm_archive.elites.niche[3])
    out = tmp_path / "arm.png"
    seen = watch_elite(arm_archive, niche, out)
    assert isinstance(seen, Motion)
    with Image.open(out) as picture:
        assert picture.size == (460, 460)
    behavior = arm_archive.elite(niche).behavior
    np.testing.assert_allclose(seen.tracks["hand"][-1], behavior, atol=1e-6)


def test_paths_are_drawn_over_the_map(arm_archive):
    ax = Figure().subplots()
    track = np.array([[0.0, 0.0], [0.5, 0.2], [1.7, 0.3]])
    motion = Motion({"block": track, "gripper": track + 0.1}, None, 25.0)
    assert plot_motion(arm_archive, motion, ax, niche=3) is ax
    drawn = [line.get_xydata() for line in ax.lines if len(line.get_xydata()) == 3]
    np.testing.assert_allclose(drawn[0], track)
    # What leaves the map is seen.
    assert ax.get_xlim()[1] > 1.7


@pytest.mark.parametrize("name", ["film.avi", "film"])
def test_unknown_endings(arm_archive, tmp_path, name):
    with pytest.raises(NichechainError, match=r"must end in \.gif"):
        watch_elite(arm_archive, 0, tmp_path / name)
