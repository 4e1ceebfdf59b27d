"""Recordings in every layout become the same traffic, and a wrong file is answered by the name of what is wrong."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from scenarios import find
from scenarios.traffic.fitting import fit
from scenarios.traffic.motion import course, smoothed
from scenarios.traffic.scenario import replay_of
from tests.scenarios.traffic.recorded import (
    LANES,
    LENGTH,
    LONG,
    WIDE,
    WIDTH,
    common_road,
    exi_d,
    high_d,
    ngsim,
    own,
    traffic,
)

EXTRACT = Path(__file__).resolve().parents[4] / "shared" / "data"


def plan(path, parameters=""):
    return find(f"replay:{path}{parameters}").builder.plan


@pytest.mark.parametrize(
    ("write", "name"), [(own, "a.csv"), (ngsim, "a.csv"), (high_d, "a.csv"), (exi_d, "a.csv"), (common_road, "a.xml")]
)
def test_every_layout_gives_the_same_traffic(write, name, tmp_path):
    found = plan(write(tmp_path / name), ":ego=5")
    np.testing.assert_allclose(found.lanes.places, np.subtract(LANES, LANES[0]), atol=0.02)
    assert found.lanes.width == pytest.approx(3.7, abs=0.02)
    ego, other = found.ego, next(part for part in found.others if part.id == "9")
    np.testing.assert_allclose(ego.size, [LENGTH, WIDTH], atol=1e-6)
    np.testing.assert_allclose(other.size, [LONG, WIDE], atol=1e-6)
    assert (ego.kind, other.kind) == ("car", "truck")
    assert ego.table[-1, 0] == pytest.approx(6.0)
    np.testing.assert_allclose(np.hypot(*ego.table[:, 4:6].T), 20.0, atol=1e-3)
    np.testing.assert_allclose(ego.table[:, [3, 6]], 0.0, atol=1e-3)
    np.testing.assert_allclose(other.table[:, 1:3] - ego.table[:, 1:3], [[35.0, 3.7]] * len(ego.table), atol=0.02)


def test_a_compressed_file_is_read(tmp_path):
    text = own(tmp_path / "a.csv").read_bytes()
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(text))
    assert plan(tmp_path / "a.csv.gz", ":ego=5").ego.id == "5"


def test_the_default_ego_is_on_the_middle_lane(tmp_path):
    assert plan(own(tmp_path / "a.csv")).ego.id in {"2", "5", "8", "11"}


def test_noise_of_a_decimetre_leaves_headings_calm(tmp_path):
    """Differences of such positions turn by 2 degrees (0.1 sqrt(2) m over 4 m); smoothed ones by less than a third."""
    table = plan(ngsim(tmp_path / "a.csv", noise=0.1), ":ego=5").ego.table
    raw = plan(ngsim(tmp_path / "b.csv", noise=0.1), ":ego=5,smooth=0").ego.table
    assert raw[:, 3].std() > 0.03
    assert table[:, 3].std() < 0.01
    assert np.hypot(*table[:, 4:6].T).std() < 0.4


def test_smoothing_keeps_a_parabola_to_its_ends():
    t = np.arange(40) * 0.1
    np.testing.assert_allclose(smoothed(np.column_stack([t, 3 * t**2]), 10), np.column_stack([t, 3 * t**2]), atol=1e-12)


def test_a_vehicle_that_stops_keeps_its_heading():
    t = np.arange(100) * 0.1
    rng = np.random.default_rng(0)
    x = np.where(t < 5, 10 * t - t**2, 25.0)
    xy = np.column_stack([x, 0 * x]) + 0.05 * rng.standard_normal((100, 2))
    heading = course(t, xy, None, 2.0, along=0.0)[:, 3]
    assert np.abs(heading).max() < 0.1


def test_lanes_without_numbers_are_those_where_most_drive():
    rng = np.random.default_rng(0)
    y = np.concatenate([rng.normal(place, 0.3, 400) for place in (1.0, 4.6, 8.3)] + [np.linspace(1.0, 8.3, 60)])
    lanes = fit(y, np.full(len(y), -1))
    np.testing.assert_allclose(lanes.places, [1.0, 4.6, 8.3], atol=0.15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,id,x,y,length\n", "no column width"),
        ("frame,id,x,y,width,heigth,laneId\n", "highD but has no column height; is it what 'heigth' holds"),
        ("Vehicle_ID,Frame_ID,Local_X,Local_Y,v_length\n", "NGSIM but has no column v_Width"),
        ("a,b\n1,2\n", "of no known layout"),
        ("", "has the columns none"),
        ("time,id,x,y,length,width\n", "no rows"),
        ("time,id,x,y,length,width\n0,1,zero,0,4,2\n", "column x, row 1: 'zero' is no finite number"),
        ("time,id,x,y,length,width\n0,1,0,0,4,2\n1,1,0\n", "row 2: has 3 cells"),
        ("time,id,x,y,length,width\n0,1,0,0,0,2\n", "column length, row 1: 0 is no size"),
        ("time,id,x,y,length,width\n0,1,0,0,4,2\n0,1,5,0,4,2\n", "vehicle 1 has two rows at 0.00 s"),
        ("time,id,x,y,length,width\n0,1,0,0,4,2\n3,1,5,0,4,2\n", "vehicle 1 has no row for 3.0 s after 0.00 s"),
        ("time,id,x,y,length,width\n0,1,0,0,440,2\n", "column length, row 1: 440 is more than 100 m; give metres"),
        ("time;id;x;y;length;width\n0;1;0;0;4;2\n", "columns separated by ';'; write it with commas"),
    ],
)
def test_a_wrong_file_is_answered_by_name(text, message, tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        find(f"replay:{path}")
    assert "\n" not in str(caught.value)


def scaled(path, column, factor):
    """A recording with one column of numbers multiplied."""
    head, *lines = path.read_text().splitlines()
    rows = [line.split(",") for line in lines]
    k = head.split(",").index(column)
    path.write_text(
        "\n".join([head, *(",".join([*row[:k], str(float(row[k]) * factor), *row[k + 1 :]]) for row in rows)])
    )
    return path


def test_places_and_headings_of_another_unit_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"a\.csv: vehicle 1 drives 2000 m/s; give places in metres"):
        plan(scaled(own(tmp_path / "a.csv"), "x", 100))
    rows = [line + ",1.57" for line in own(tmp_path / "b.csv").read_text().splitlines()]
    (tmp_path / "b.csv").write_text("\n".join(rows).replace(",1.57", ",heading", 1))
    with pytest.raises(ValueError, match=r"column heading: most vehicles do not drive where it points; give radians"):
        plan(tmp_path / "b.csv")


def test_an_id_is_a_text(tmp_path):
    for name in ("007", "1e3", "on"):
        assert replay_of(f"replay:a.csv:react=off,ego={name}").ego == name


def test_a_vehicle_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"ego must be a vehicle of a\.csv, got '77'"):
        plan(own(tmp_path / "a.csv"), ":ego=77")


def test_a_missing_file_and_unknown_parameters_are_named(tmp_path):
    with pytest.raises(ValueError, match=r"cannot read nowhere\.csv"):
        find("replay:nowhere.csv")
    with pytest.raises(ValueError, match="no parameter speed; it has ego, react, smooth"):
        find("replay:a.csv:speed=3")
    with pytest.raises(ValueError, match="react must be a number from 0 on, got 'yes'"):
        find("replay:a.csv:react=yes")
    with pytest.raises(ValueError, match="has no file"):
        find("replay:")


def test_vehicles_of_several_clocks_are_refused(tmp_path):
    rows = [(t, i + 20 * copy, x, y, lane) for copy in (0, 1) for t, i, x, y, lane in traffic()]
    with pytest.raises(ValueError, match=r"vehicle 5 of a\.csv begins inside of 1 other, such as 25"):
        plan(own(tmp_path / "a.csv", rows), ":ego=5")


def test_the_extract_of_i80_is_no_traffic():
    """All its vehicles enter the road at the same moment: they are side by side and within each other."""
    path = EXTRACT / "ngsim_i80" / "i80_0400_200_vehicles_10s.csv.gz"
    if not path.is_file():
        pytest.skip("the recordings of I-80 are not here")
    with pytest.raises(ValueError, match=r"begins inside of .* times are all of one clock"):
        plan(path)


def test_a_file_that_is_no_common_road_is_refused(tmp_path):
    path = tmp_path / "a.xml"
    for text, message in [
        ("<commonRoad", "is no XML"),
        ("<osm/>", "begins with 'osm'"),
        ('<commonRoad timeStepSize="0.1"><dynamicObstacle id="7"/></commonRoad>', "obstacle 7 has no shape/rectangle"),
        ('<commonRoad timeStepSize="0.1"/>', "no rows"),
        ('<commonRoad timeStepSize="fast"/>', "a.xml: timeStepSize is 'fast'; give a number"),
    ]:
        path.write_text(text)
        with pytest.raises(ValueError, match=message):
            plan(path)


def test_real_traffic_of_us101_is_driven_smoothly():
    """22 vehicles of a jam on five lanes: lanes of usual width, and headings that agree with the motion."""
    path = EXTRACT / "ngsim_us101" / "USA_US101-4_1_T-1.xml"
    if not path.is_file():
        pytest.skip("the recordings of US-101 are not here")
    found = plan(path)
    assert len(found.others) == 21
    assert len(found.lanes.places) == 5
    assert 3.3 < found.lanes.width < 3.9
    for part in found.others:
        speed = np.hypot(*part.table[:, 4:6].T)
        assert speed.max() < 25.0
        assert np.abs(np.gradient(speed, part.table[:, 0])).max() < 8.0
        assert np.abs(part.table[:, 6] * speed).max() < 4.0
