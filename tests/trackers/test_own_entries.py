"""Entries of users: MODULE:OBJECT, and names that installed packages register."""

import sys
from textwrap import dedent

import pytest

from sensors import RADARS
from sensors import find as find_radar
from trackers import MultiObjectTracker, RandomMatrix, SensorModel, build, find
from trackers.lookup import installed, parse
from trackers.multi.ground import GroundTest

MODULE = """
    from dataclasses import dataclass, replace

    from sensors import RADARS
    from trackers import MultiObjectTracker, RandomMatrix

    tuned = RandomMatrix(sigma=0.4)

    @dataclass(frozen=True)
    class Mine(RandomMatrix):
        gain: float = 1.0

    def whole(sensors, prune=0.02):
        return MultiObjectTracker(tuned, sensors, prune_below=prune)

    class Own:
        def __init__(self, sensors, depth=3):
            self.sensors, self.depth = sensors, depth

        def start(self): ...
        def step(self, tracks, scan, dt): ...

    class Fails:
        def __init__(self, share: "float" = 0.5):
            raise KeyError("no such file")

    class Namespace:
        inner = tuned

    def needy(must): ...

    fast = replace(RADARS["front"], rate=5.0)
    number = 3
"""
SENSORS = (SensorModel(),)


@pytest.fixture
def user(tmp_path, monkeypatch):
    """The folder of a user, in which a command is started."""
    (tmp_path / "my_filters.py").write_text(dedent(MODULE))
    (tmp_path / "needs_more.py").write_text("import no_such_library\n")
    (tmp_path / "unfinished.py").write_text("def f(:\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    for name in ("my_filters", "needs_more", "unfinished"):
        sys.modules.pop(name, None)


def register(folder, package, groups):
    """What an installation leaves of a package: its metadata."""
    info = folder / f"{package}-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.2\n")
    lines = [f"[eot_testbed.{group}]\n{entry}\n" for group, entry in groups.items()]
    (info / "entry_points.txt").write_text("\n".join(lines))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("my_ekf:CentroidEKF", ("my_ekf:CentroidEKF", {})),
        ("my.pack_2:a.B:gain=2,on=off", ("my.pack_2:a.B", {"gain": 2, "on": False})),
        ("rm-koch:sigma=0.3", ("rm-koch", {"sigma": 0.3})),
        ("dra:form=soft", ("dra", {"form": "soft"})),
    ],
)
def test_one_grammar_reads_names_and_objects(text, expected):
    assert parse(text) == expected


@pytest.mark.parametrize("text", ["my:A:", "my:A:gain", "my:A:gain=", "my-ekf:A", "2my:A"])
def test_what_is_no_object_and_no_parameter_is_refused(text):
    with pytest.raises(ValueError, match="write NAME:key=value,key=value"):
        parse(text)


def test_filters_classes_and_functions_of_a_user_are_trackers(user):
    assert build("my_filters:tuned", SENSORS) == MultiObjectTracker(RandomMatrix(sigma=0.4), SENSORS)
    assert build("my_filters:tuned:rho=0.3", SENSORS).filter == RandomMatrix(sigma=0.4, rho=0.3)
    assert build("my_filters:Mine:gain=2,sigma=0.1", SENSORS).filter.gain == 2
    assert build("my_filters:Namespace.inner", SENSORS).filter.sigma == 0.4
    layered = build("my_filters:Mine:size=ends,prune_below=0.01", SENSORS, ground=GroundTest())
    assert (layered.prune_below, layered.ground) == (0.01, GroundTest())
    assert layered.filter.place.gain == 1.0
    assert layered.filter.size.sensors == SENSORS
    assert build("my_filters:whole:prune=0.01", SENSORS).prune_below == 0.01
    own = build("my_filters:Own:depth=5", SENSORS)
    assert (own.sensors, own.depth) == (SENSORS, 5)
    assert find("my_filters:tuned", rho=0.2).rho == 0.2


def test_radars_of_a_user_are_found_and_those_of_the_catalogue_take_parameters(user):
    assert find_radar("my_filters:fast").rate == 5.0
    assert find_radar("my_filters:fast:rate=7.0").rate == 7.0
    assert find_radar("front:rate=7.0").sensors == RADARS["front"].sensors


@pytest.mark.parametrize(
    ("text", "fault", "sentence"),
    [
        ("no_such:thing", LookupError, "there is no module 'no_such' here or on PYTHONPATH; start in its folder, or"),
        ("my_filters:tunned", LookupError, "my_filters has no 'tunned'; did you mean 'tuned'"),
        ("my_filters:zzz", LookupError, "my_filters has no 'zzz'; known: "),
        ("needs_more:f", LookupError, "needs_more imports no_such_library, which is not installed"),
        ("unfinished:f", LookupError, "importing unfinished fails with SyntaxError: invalid syntax"),
        ("dra:soft", LookupError, "'dra:soft' has no value for a parameter; write dra:key=value,key=value"),
        ("my_filters:tuned:gain=2", ValueError, "my_filters:tuned has no parameter gain; it has accel_std, "),
        ("my_filters:needy", ValueError, "needs a value of must; write my_filters:needy:must=VALUE"),
        ("my_filters:number", ValueError, "is 3, which has no init, predict, update, estimate; a filter has"),
        ("my_filters:Own:size=ends", ValueError, "is a whole tracker, which has no parameter size"),
        (
            "my_filters:tuned:sigma=wide",
            ValueError,
            "tuned: sigma must be a number, such as 0.5, got 'wide'",
        ),
        ("my_filters:Mine:gain=none", ValueError, "my_filters:Mine: gain must be a number, such as 0.5, got None"),
        ("my_filters:Fails:share=x", ValueError, "my_filters:Fails: share must be a number, such as 0.5, got 'x'"),
        (
            "my_filters:Fails",
            ValueError,
            "making it fails with KeyError: 'no such file' (my_filters.py:",
        ),
        ("my_filters:tuned:prune_below=on", ValueError, "tuned: prune_below must be a number, such as 0.5, got True"),
        ("rm-feldmann:sigma=on", ValueError, "rm-feldmann: sigma must be a number, such as 0.5, got True"),
        ("rm-feldmann:prune_below=off", ValueError, "prune_below must be a number, such as 0.5, got False"),
        ("htg-rm:rounds=2.5", ValueError, "htg-rm: rounds must be a whole number, such as 2, got 2.5"),
        ("./my_filters.py:tuned", ValueError, "names a file; start in its folder, and write my_filters:OBJECT"),
        ("rm-kochh", LookupError, "no tracker 'rm-kochh'; did you mean 'rm-koch'"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(user, text, fault, sentence):
    with pytest.raises(fault) as caught:
        build(text, SENSORS)
    assert sentence in str(caught.value)


def test_a_radar_must_be_one(user):
    with pytest.raises(ValueError, match=r"which has no models, rate, scan; make it a `sensors\.Radar`"):
        find_radar("my_filters:number")


def test_what_installed_packages_register_works_by_name(user, monkeypatch):
    register(user, "my-package", {"trackers": "centroid = my_filters:tuned", "radars": "fast = my_filters:fast"})
    monkeypatch.syspath_prepend(str(user))
    assert installed("tracker")["centroid"].value == "my_filters:tuned"
    assert build("centroid:rho=0.3", SENSORS).filter == RandomMatrix(sigma=0.4, rho=0.3)
    assert find_radar("fast").rate == 5.0
    with pytest.raises(LookupError, match="no tracker 'centroidd'; did you mean 'centroid'"):
        build("centroidd", SENSORS)
    register(user, "other", {"trackers": "centroid = my_filters:Mine"})
    with pytest.raises(LookupError, match="two packages have registered the tracker 'centroid'"):
        build("centroid", SENSORS)
    assert build("rm-koch", SENSORS)
