"""A recording in other formats. Exported as `turnbuckle.export_recording`."""

import re
from os import PathLike
from pathlib import Path

from turnbuckle import io, viewer
from turnbuckle.data.errors import InputError
from turnbuckle.io.export_glb import write_glb
from turnbuckle.io.export_meshes import SUFFIXES as MESHES
from turnbuckle.io.export_meshes import write_mesh_file
from turnbuckle.io.recording import Recording, read_recording

SUFFIXES = (*io.SUFFIXES, *MESHES, ".glb", *viewer.SUFFIXES)
_NUMBERED = re.compile(r"%0?\d*d")
_KEPT = ("up_axis", "frames_per_second", "schema_version")


def export_recording(
    recording: Recording | str | PathLike[str],
    out: str | PathLike[str],
    *,
    frame: int | None = None,
    every: int = 1,
) -> list[Path]:
    """Write a recording (or the path of one) as ``out``, in the format of its suffix; returns the files written.

    .usdc, .usda, .usd, .vtkhdf, .npz, .glb, .gif and .mp4 hold all frames, or every ``every``-th; .png the last one. Of
    .obj and .ply there is one file a frame, `NAME_0000.obj`, ...; with ``frame`` (from 0, or from the end: -1) that one
    alone, under the very name. Raises `InputError`.
    """
    out = Path(out)
    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"export {out}: the suffix '{out.suffix}' is not known; use one of {', '.join(SUFFIXES)}")
    if not out.absolute().parent.is_dir():
        raise InputError(f"export {out}: there is no folder {str(out.parent)!r}; make it first")
    if out.is_dir():
        raise InputError(f"export {out}: is a folder; give the name of a file")
    if every < 1:
        raise InputError(f"export {out}: every is {every}; give at least 1")
    if not isinstance(recording, Recording):
        source = Path(recording)
        if out.exists() and source.exists() and out.samefile(source):
            raise InputError(f"export {out}: is the recording itself; give another name")
        recording = read_recording(source)
    count = len(recording)
    if not count:
        raise InputError(f"export {out}: the recording has no frame")
    if frame is not None and not -count <= frame < count:
        raise InputError(f"export {out}: there is no frame {frame}; the recording has {count}, from 0")
    frames = list(range(0, count, every)) if frame is None else [frame % count]
    up, rate = recording.info["up_axis"], float(recording.info["frames_per_second"]) / every
    if suffix in MESHES:
        names = [out] if frame is not None else [_numbered(out, i, frames) for i in range(len(frames))]
        for name, number in zip(names, frames, strict=True):
            write_mesh_file(name, recording.shapes, recording.x(number), float(recording.times[number]))
        return names
    if suffix == ".glb":
        write_glb(out, recording.shapes, recording.times, recording.x, frames, up)
        return [out]
    info = {key: value for key, value in recording.info.items() if key not in _KEPT}
    start = io.open_recorder if suffix in io.SUFFIXES else viewer.open_picture
    recorder = start(out, recording.shapes, up_axis=up, frames_per_second=rate, info=info)
    try:
        for number in frames:
            recorder.write(float(recording.times[number]), recording.x(number), recording.v(number))
    finally:
        recorder.close()
    return [out]


def _numbered(out: Path, number: int, frames: list[int]) -> Path:
    """`NAME_0007.obj`, or the user's own pattern `NAME%04d.obj`."""
    if _NUMBERED.search(out.name):
        return out.with_name(_NUMBERED.sub(lambda found: found.group() % number, out.name, count=1))
    digits = max(4, len(str(len(frames) - 1)))
    return out.with_name(f"{out.stem}_{number:0{digits}d}{out.suffix}")
