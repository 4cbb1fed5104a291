"""Files cut at any byte: read up to the last whole frame, or refused with a reason; what is read is what was written."""

from pathlib import Path

import numpy as np
import pytest
import wrong_inputs

import turnbuckle
from turnbuckle.data.errors import InputError
from turnbuckle.io import Recording, open_recorder, read_recording
from turnbuckle.io.checkpoint import load


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return wrong_inputs.made_files(tmp_path_factory.mktemp("whole"))


def same_frames(found: Recording, whole: Recording) -> None:
    assert np.array_equal(found.times, whole.times[: len(found)])
    for frame in {0, len(found) - 1} if len(found) else ():
        assert np.array_equal(found.x(frame), whole.x(frame)) and np.array_equal(found.v(frame), whole.v(frame))


def try_cuts(path: Path, whole: Recording, places: list[int], at: Path) -> dict[int, int]:
    """Frames read of the file cut at each place; those that were refused are left out."""
    data, read = path.read_bytes(), {}
    for place in places:
        at.write_bytes(data[:place])
        try:
            found = read_recording(at)
            same_frames(found, whole)
        except InputError as error:
            assert "\n" not in str(error) and str(at) in str(error)
        else:
            read[place] = len(found)
    return read


def test_a_finished_recording_cut_anywhere_is_refused(made: dict[str, Path], tmp_path: Path) -> None:
    size = made["npz"].stat().st_size
    whole = read_recording(made["npz"])
    assert len(whole) >= 5
    places = [*range(0, size, 19), *range(size - 400, size), size]
    assert try_cuts(made["npz"], whole, places, tmp_path / "cut.npz") == {size: len(whole)}


def test_a_recording_under_way_cut_anywhere_has_all_whole_frames(made: dict[str, Path], tmp_path: Path) -> None:
    whole = read_recording(made["npz"])
    path = tmp_path / "going.npz"
    recorder = open_recorder(path, whole.shapes, up_axis="Z", frames_per_second=100.0)
    for frame in range(len(whole)):
        recorder.write(float(whole.times[frame]), whole.x(frame), whole.v(frame))
    recorder.flush()
    part = tmp_path / "going.npz.part"
    size, points = part.stat().st_size, len(whole.x(0))
    frame_size = 8 + 2 * 24 * points
    begin = size - len(whole) * frame_size
    dense = [*range(begin - 20, begin + 2 * frame_size), *range(size - frame_size - 9, size + 1)]
    places = [*range(0, begin, 67), *dense, *range(begin, size, 13)]
    read = try_cuts(part, whole, places, tmp_path / "cut.npz.part")
    recorder.close()
    assert min(read) <= begin, "the header alone is a recording without frames"
    for place, frames in read.items():
        assert frames == max(place - begin, 0) // frame_size, place
    assert all(place in read for place in places if place >= begin)


def test_vtkhdf_cut_anywhere_is_refused_or_right(made: dict[str, Path], tmp_path: Path) -> None:
    size = made["vtkhdf"].stat().st_size
    places = [*range(0, size, 331), *range(size - 40, size), size]
    read = try_cuts(made["vtkhdf"], read_recording(made["vtkhdf"]), places, tmp_path / "cut.vtkhdf")
    assert read[size] == len(read_recording(made["vtkhdf"]))


def test_a_checkpoint_cut_anywhere_is_refused_and_changes_nothing(made: dict[str, Path], tmp_path: Path) -> None:
    model, state = turnbuckle.Scene.load(made["scene"]).build()
    before = state.positions().copy()
    data = made["checkpoint"].read_bytes()
    cut = tmp_path / "cut.checkpoint"
    for place in [*range(0, len(data), 61), *range(len(data) - 60, len(data))]:
        cut.write_bytes(data[:place])
        with pytest.raises(InputError) as caught:
            load(cut, model, state)
        assert "\n" not in str(caught.value) and str(cut) in str(caught.value)
    assert np.array_equal(state.positions(), before) and state.time == 0.0
    load(made["checkpoint"], model, state)
    assert state.time == pytest.approx(0.05)


def test_usd_cut_anywhere_is_refused_or_read(tmp_path: Path) -> None:
    pytest.importorskip("pxr.Usd")
    turnbuckle.export_scene(turnbuckle.Scene.loads(wrong_inputs.JOINTS), tmp_path / "s.usdc")
    data, cut = (tmp_path / "s.usdc").read_bytes(), tmp_path / "cut.usdc"
    refused = 0
    for place in range(0, len(data), len(data) // 60):
        cut.write_bytes(data[:place])
        try:
            turnbuckle.import_scene(cut)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) or str(cut) in str(error).splitlines()[-1]
    assert refused > 50
