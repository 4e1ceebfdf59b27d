"""Files that are written completely or not at all."""

import json
from pathlib import Path

import pytest

from testbed.files import atomic_file, write_atomic, write_json


def test_text_and_bytes_come_back_and_nothing_else_is_left(tmp_path):
    write_atomic(tmp_path / "a.txt", "Länge\n")
    write_atomic(tmp_path / "b.bin", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == "Länge\n".encode()
    assert (tmp_path / "b.bin").read_bytes() == b"\x00\xff"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "b.bin"]


def test_a_reader_sees_the_old_file_until_the_new_one_is_complete(tmp_path):
    path = tmp_path / "table.csv"
    write_atomic(path, "old")
    with atomic_file(path) as file:
        file.write(b"new")
        file.flush()
        assert path.read_text() == "old"
    assert path.read_text() == "new"


@pytest.mark.parametrize("error", [KeyboardInterrupt, ZeroDivisionError])
def test_whatever_stops_the_writer_leaves_the_old_file_and_no_part(tmp_path, error):
    path = tmp_path / "table.csv"
    write_atomic(path, "old")

    def write():
        with atomic_file(path) as file:
            file.write(b"half of the n")
            raise error

    with pytest.raises(error):
        write()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_one_sentence(tmp_path):
    path = tmp_path / "table.csv"

    def write():
        with atomic_file(path), open("/dev/full", "wb") as full:
            full.write(b"x")

    with pytest.raises(OSError, match=r"cannot write .*table\.csv: No space left on device; choose another directory"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    for place, why in (
        ("missing/a", "No such file or directory"),
        ("file/a", "Not a directory"),
        ("folder", "Is a directory"),
    ):
        with pytest.raises(OSError, match=f"^cannot write .*{place}: {why}; choose another directory$"):
            write_atomic(tmp_path / place, "text")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_a_symbolic_link_is_replaced_and_what_it_points_to_stays(tmp_path):
    (tmp_path / "kept").write_text("kept")
    (tmp_path / "link").symlink_to(tmp_path / "kept")
    write_atomic(tmp_path / "link", "new")
    assert (tmp_path / "kept").read_text() == "kept"
    assert not (tmp_path / "link").is_symlink()
    assert (tmp_path / "link").read_text() == "new"


def test_json_is_indented_and_takes_no_nan(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": [1, None]})
    assert path.read_text() == json.dumps({"a": [1, None]}, indent=1) + "\n"
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": [1, None]}
