"""`testbed learn-spline`: from detections to a model file with its provenance, through the command line too."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from testbed.cli import app
from testbed.learn.models import SplineConfig, learn
from trackers import find
from trackers.pmht.model import curve, load
from trackers.pmht.offline import OfflineLearning

QUICK = OfflineLearning(iterations=15)


def test_our_radar_on_lone_cars_gives_a_car(tmp_path):
    out = tmp_path / "car.json"
    learned = learn(SplineConfig("sampler:surround:car", 3000, options=QUICK), out)
    model = load(out)
    ring = curve(model.p) * model.size
    np.testing.assert_allclose(np.ptp(ring, axis=0), model.size, atol=0.35)
    assert (np.ptp(ring, axis=0) < model.size).all()  # the curve runs behind the outline
    assert 0.03 < model.interior < 0.3
    np.testing.assert_allclose(model.p, learned.model.p, atol=1e-6)
    provenance = json.loads(out.read_text())["provenance"]
    assert provenance["command"] == "testbed learn-spline sampler:surround:car --out car.json --count 3000"
    assert provenance["detections"] >= 3000
    text = "\n".join(str(part) for part in learned.report()[1:])
    assert "sampler" in text
    assert find("pmht-spline", model=str(out)).models == (model,)


def own_file(path, rng, aspects):
    """Detections of a file of one's own: a box of 4.5 m by 1.8 m, seen from some aspects."""
    phi = rng.choice(aspects, 4000)
    toward = np.stack([np.cos(np.pi - phi), np.sin(np.pi - phi)], -1)
    at = rng.uniform(-1, 1, 4000)
    ends = np.abs(toward[:, 0]) > np.abs(toward[:, 1])
    d = 1 - np.abs(rng.normal(0, 0.05, 4000))
    u = np.where(
        ends[:, None], np.stack([np.sign(toward[:, 0]) * d, at], -1), np.stack([at, np.sign(toward[:, 1]) * d], -1)
    )
    np.savez(path, u=u, aspect=phi, size=np.tile([4.5, 1.8], (4000, 1)))


def test_a_file_of_one_s_own_is_learned_and_unseen_ellipses_are_named(tmp_path):
    own_file(tmp_path / "own.npz", np.random.default_rng(0), [0.0, 0.05, np.pi / 2, 1.6])
    config = SplineConfig(str(tmp_path / "own.npz"), options=OfflineLearning(iterations=15, mirrored=False))
    learned = learn(config, tmp_path / "own.json")
    assert learned.model.size == (4.5, 1.8)
    assert any("caution" in str(line) for line in learned.report())
    whole = tmp_path / "whole.npz"
    own_file(whole, np.random.default_rng(1), np.linspace(-np.pi, np.pi, 40))
    better = learn(SplineConfig(str(whole), options=QUICK), tmp_path / "whole.json")
    np.testing.assert_allclose(np.ptp(curve(better.model.p), axis=0), 0.96, atol=0.05)
    assert not any("caution" in str(line) for line in better.report())


def test_the_command_line_writes_the_same_file(tmp_path):
    own_file(tmp_path / "own.npz", np.random.default_rng(2), np.linspace(-np.pi, np.pi, 40))
    out = tmp_path / "model.json"
    said = CliRunner().invoke(app, ["learn-spline", str(tmp_path / "own.npz"), "--out", str(out), "--ellipses", "16"])
    assert said.exit_code == 0, said.output
    assert "detections from inside" in " ".join(said.output.split())
    assert len(load(out).spread) == 16


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["sampler:surround:car", "--ellipses", "8"], "between 4 and their number"),
        (["sampler:surround:car", "--visibility", "some"], "visibility must be one of rays, none"),
        (["sampler:surround:car", "--count", "0"], "count must be at least 1"),
        (["no-such-file"], "there is no no-such-file"),
    ],
)
def test_input_that_makes_no_sense_ends_in_one_sentence(tmp_path, arguments, text):
    said = CliRunner().invoke(app, ["learn-spline", *arguments, "--out", str(tmp_path / "x.json")])
    assert said.exit_code == 2
    assert text in " ".join(said.output.split())


def test_too_few_detections_are_refused(tmp_path):
    np.savez(tmp_path / "few.npz", u=np.zeros((30, 2)) + 0.5, aspect=np.zeros(30))
    with pytest.raises(ValueError, match="too few"):
        learn(SplineConfig(str(tmp_path / "few.npz")), tmp_path / "x.json")
