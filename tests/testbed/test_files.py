"""Files that are written completely or not at all."""

import json
import os
import socket
from pathlib import Path

import pytest

from testbed.files import ROOM, atomic_file, check_target, make_directory, reserve, write_atomic, write_json


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


def test_of_two_writers_of_one_file_the_last_to_finish_leaves_it_whole(tmp_path):
    path = tmp_path / "table.csv"
    with atomic_file(path) as slow:
        slow.write(b"slow and ")
        with atomic_file(path) as quick:
            quick.write(b"quick")
        assert path.read_text() == "quick"
        slow.write(b"whole")
    assert path.read_text() == "slow and whole"
    assert list(tmp_path.iterdir()) == [path]


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


def test_a_file_that_has_no_room_is_one_sentence_and_the_old_one_stays(tmp_path, limit_files):
    path = tmp_path / "table.csv"
    write_atomic(path, "old")
    refused = pytest.raises(OSError, match=r"^cannot write .*table\.csv: File too large; choose another directory$")
    with limit_files(1000), refused:
        write_atomic(path, "new" * 1000)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_room_is_taken_from_the_disk_without_a_name(tmp_path):
    with reserve(tmp_path) as file:
        assert os.fstat(file.fileno()).st_blocks * 512 >= ROOM
        assert list(tmp_path.iterdir()) == []


def test_a_directory_without_room_for_results_is_refused(tmp_path, limit_files):
    refused = pytest.raises(OSError, match=r"^out: cannot write to .*runs: File too large; choose another directory$")
    with limit_files(ROOM - 1), refused:
        make_directory(tmp_path / "runs")
    assert list((tmp_path / "runs").iterdir()) == []


def test_a_place_that_cannot_be_is_one_sentence(tmp_path):
    (tmp_path / "file").touch()
    for place, why in (("missing/a", "No such file or directory"), ("file/a", "Not a directory")):
        with pytest.raises(OSError, match=f"^cannot write .*{place}: {why}; choose another directory$"):
            write_atomic(tmp_path / place, "text")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def make_socket(path):
    with socket.socket(socket.AF_UNIX) as made:
        made.bind(path.name)  # a path of a socket must be short


IN_THE_WAY = {
    "a symbolic link": lambda path: path.symlink_to("kept"),
    "a directory": lambda path: path.mkdir(),
    "a named pipe": os.mkfifo,
    "a socket": make_socket,
}


@pytest.mark.parametrize("kind", IN_THE_WAY)
def test_only_a_regular_file_is_replaced(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "table.csv"
    (tmp_path / "kept").write_text("kept")
    IN_THE_WAY[kind](path)
    before = path.lstat()
    with pytest.raises(OSError, match=rf"^cannot write .*table\.csv: it is {kind}; choose another file$"):
        write_atomic(path, "new")
    assert (tmp_path / "kept").read_text() == "kept"
    assert (path.lstat().st_ino, path.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kept", "table.csv"]


def test_a_device_is_refused():
    """Nothing is written here: as root, a fault would replace the device for the whole machine."""
    with pytest.raises(OSError, match=rf"^cannot write {os.devnull}: it is a device; choose another file$"):
        check_target(Path(os.devnull))


def test_json_is_indented_and_takes_no_nan(tmp_path):
    path = tmp_path / "a.json"
    write_json(path, {"a": [1, None]})
    assert path.read_text() == json.dumps({"a": [1, None]}, indent=1) + "\n"
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(path, {"a": float("nan")})
    assert json.loads(path.read_text()) == {"a": [1, None]}
