"""Logs at which rerun ends the whole process, or that cannot be read to their end, are told from whole ones."""

import subprocess
import sys

import pytest
import rerun as rr
import rerun.blueprint as rrb

from testbed.log.intact import damage
from testbed.log.review import readable

READ_COPIES = """
import os, sys
from rerun.chunk import RrdReader
content = open(sys.argv[1], "rb").read()
for at in range(200, 600):
    with open(sys.argv[2], "wb") as file:
        file.write(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    process = os.fork()
    if process == 0:
        try:
            list(RrdReader(sys.argv[2]).stream().to_chunks())
        finally:
            os._exit(0)
    if os.WIFSIGNALED(os.waitpid(process, 0)[1]):
        sys.exit(0)
sys.exit(1)
"""


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A log of one number."""
    path = tmp_path_factory.mktemp("log") / "small.rrd"
    recording = rr.RecordingStream("small")
    recording.save(path)
    recording.log("a", rr.Scalars([1.0]))
    recording.disconnect()
    return path


def test_a_whole_log_has_no_damage(small):
    assert damage([small, small]) is None


def test_a_log_at_which_rerun_ends_the_process_is_refused(small, tmp_path):
    fatal = tmp_path / "fatal.rrd"
    found = subprocess.run([sys.executable, "-c", READ_COPIES, small, fatal], stderr=subprocess.DEVNULL, check=False)
    assert found.returncode == 0, "no flipped bit ends the process any more: is a process of its own still needed?"
    assert damage([small, fatal]) == (fatal, "a block cannot be decoded")
    with pytest.raises(ValueError, match=r"fatal\.rrd is not a review log.*\(a block .*rerun rrd optimize"):
        readable(small, fatal)


@pytest.mark.parametrize("content", [b"", b"RRF2", b"no log", b"RRF2" + b"\xff" * 100])
def test_what_is_no_log_is_refused_with_a_reason(small, tmp_path, content):
    other = tmp_path / "other.rrd"
    other.write_bytes(content)
    log, reason = damage([other, small])
    assert log == other
    assert reason
    assert "Traceback" not in reason
    assert str(other) not in reason


def test_a_log_that_holds_no_recording_says_so(tmp_path):
    path = tmp_path / "layout alone.rrd"
    rrb.Blueprint(rrb.TextLogView()).save("alone", path)
    assert "No recording" in damage([path])[1]
    with pytest.raises(ValueError, match=r"optimize '.*/layout alone\.rrd' -o '.*/layout alone-repaired\.rrd'`"):
        readable(path)


def test_a_log_that_ends_within_a_block_is_refused(small, tmp_path):
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(small.read_bytes()[:-2500])
    assert "exceeds file size" in damage([cut])[1]
