"""Maps on disk: one .npz with a version; whatever is not a whole map is refused with the reason."""

from __future__ import annotations

import zipfile
import zlib
from pathlib import Path

import cv2
import numpy as np

from landing_sim.geometry.fisheye import Fisheye
from landing_sim.vision.slam.corners import pyramid
from landing_sim.vision.slam.map import Map
from landing_sim.vision.slam.pose import Pose

VERSION = 1
KIND = "landing-sim slam map"
_FRAMES = ("R", "p", "t", "euler")
_POINTS = ("X", "ids", "source", "uv", "tried", "found")
_SEEN = ("frame", "point", "seen", "size")


class MapError(ValueError):
    """A file that is not a map that can be used. str() names the file and what is wrong with it."""


def save(path: Path | str, chart: Map) -> None:
    """Write the map. Raises ValueError for one without metric scale, OSError as usual; a file there is replaced whole."""
    if not chart.metric:
        raise ValueError(f"the map has no metric scale yet ({chart.frames} keyframes): it cannot be saved")
    path = Path(path)
    images = [
        cv2.imencode(".png", chart.views[0][k], [cv2.IMWRITE_PNG_COMPRESSION, 3])[1].ravel()
        for k in range(chart.frames)
    ]
    arrays = {name: getattr(chart, name) for name in (*_FRAMES, *_POINTS, *_SEEN)}
    body = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays.values())
    partial = path.with_name(path.name + ".part")
    with partial.open("wb") as file:
        np.savez(
            file, kind=KIND, version=VERSION, lens=np.array([chart.lens.width, chart.lens.height, chart.lens.focal]),
            next_id=chart.next_id, images=np.concatenate(images), ends=np.cumsum([len(i) for i in images]),
            check=zlib.crc32(body), **arrays,
        )  # fmt: skip
    partial.replace(path)


def load(path: Path | str) -> Map:
    """The map in a file. Raises MapError for one that is damaged, incomplete or of another version."""
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            if "kind" not in file or str(file["kind"]) != KIND:
                raise MapError(f"{path}: not a map")
            if int(file["version"]) != VERSION:
                raise MapError(f"{path}: a map of version {int(file['version'])}; this program reads {VERSION}")
            return _read(path, {name: file[name] for name in file.files})
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, ValueError, TypeError, cv2.error) as error:
        if isinstance(error, MapError):
            raise
        raise MapError(f"{path}: damaged, or not a map ({error})") from error


def _read(path: Path, a: dict[str, np.ndarray]) -> Map:
    for name in (*_FRAMES, *_POINTS, *_SEEN, "lens", "images", "ends", "next_id", "check"):
        if name not in a:
            raise MapError(f"{path}: incomplete, {name!r} is missing")
    arrays = {name: a[name] for name in (*_FRAMES, *_POINTS, *_SEEN)}
    if zlib.crc32(b"".join(np.ascontiguousarray(v).tobytes() for v in arrays.values())) != int(a["check"]):
        raise MapError(f"{path}: damaged, its check sum does not fit")
    lens = Fisheye(int(a["lens"][0]), int(a["lens"][1]), float(a["lens"][2]))
    chart = Map(lens)
    begin = 0
    for k, end in enumerate(a["ends"]):
        image = cv2.imdecode(a["images"][begin:end], cv2.IMREAD_GRAYSCALE)
        if image is None or image.shape != (lens.height, lens.width):
            raise MapError(f"{path}: damaged, the image of keyframe {k} cannot be read")
        chart.add_frame(float(a["t"][k]), Pose(a["R"][k], a["p"][k]), a["euler"][k], pyramid(image))
        begin = int(end)
    for name, value in arrays.items():
        setattr(chart, name, value)
    chart.metric, chart.next_id = True, int(a["next_id"])
    return chart
