"""`wedge`: one scene with many values, each in a cache of its own."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import content_hashes, environment
from eulerfsi.cache.manifest import Manifest
from eulerfsi.errors import SceneError, UsageError
from eulerfsi.farm import summary
from eulerfsi.farm.summary import Row
from eulerfsi.farm.variations import MOST_JOBS, parse_list, plan, read_table
from eulerfsi.farm.wedge import jobs_at_once
from eulerfsi.run.simulate import Options, simulate


def folders(*lists: str, together: bool = False) -> list[str]:
    return [job.folder for job in plan([parse_list(text) for text in lists], together)]


def table(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "wedge.csv").read_text().splitlines()))


def test_all_combinations_or_side_by_side():
    stiff, fast = "Ball.youngsModulus=1e4,4e4", "Ball.velocity=(0,-1,0),(0, -2, 0)"
    assert folders(stiff) == ["Ball.youngsModulus_10000", "Ball.youngsModulus_40000"]
    assert folders(stiff, fast) == [
        f"Ball.youngsModulus_{e}__Ball.velocity_0_-{v}_0" for e in (10000, 40000) for v in (1, 2)
    ]
    assert folders(stiff, fast, together=True) == [
        f"Ball.youngsModulus_{v}0000__Ball.velocity_0_-{n}_0" for n, v in ((1, 1), (2, 4))
    ]


def test_a_long_name_is_a_number():
    names = [f"/World/SomeBall{'x' * 30}{n}.youngsModulus=1e4,2e4" for n in range(4)]
    assert folders(*names) == [f"{n:02d}" for n in range(1, 17)]


@pytest.mark.parametrize(
    ("lists", "together", "message"),
    [
        ([], False, "nothing varies"),
        (["Ball.youngsModulus"], False, "must read PRIM.ATTR=VALUE,VALUE"),
        (["youngsModulus=1,2"], False, "must read PRIM.ATTR=VALUE,VALUE"),
        (["Ball.youngsModulus="], False, "value 1 of 1 is empty"),
        (["Ball.youngsModulus=1,,2"], False, "value 2 of 3 is empty"),
        (["Ball.youngsModulus=1,2,"], False, "value 3 of 3 is empty"),
        (["Ball.youngsModulus=1,2", "Ball.youngsModulus=3"], False, "is given 2 times"),
        (["Ball.youngsModulus=1,2", "Ball.density=1,2,3"], True, "as many values as each other"),
        (["Ball.youngsModulus=1e4,10000"], False, "jobs 1 and 2 would both write to the folder"),
        (["Ball.youngsModulus=" + ",".join(map(str, range(101))), "Ball.density=" + ",".join(map(str, range(100)))],
         False, f"10100 jobs: must be at most {MOST_JOBS}"),
    ],
)  # fmt: skip
def test_refused(lists, together, message):
    with pytest.raises(UsageError) as error:
        folders(*lists, together=together)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("Ball.youngsModulus\n", "at least one row"),
        ("youngsModulus\n1\n", "line 1: 'youngsModulus'"),
        ("Ball.a,Ball.a\n1,2\n", "Ball.a is there 2 times"),
        ("Ball.a,Ball.b\n1,2\n3\n", "row 3 has 1 values: must have 2"),
        ("Ball.a,Ball.b\n1,\n", "row 2: Ball.b is empty"),
        (b"\xff\xfe\x00", "no table"),
        (None, "No such file"),
    ],
)
def test_refused_tables(tmp_path, text, message):
    path = tmp_path / "jobs.csv"
    if text is not None:
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(UsageError) as error:
        read_table(path)
    assert message in str(error.value) and str(path) in str(error.value)


def test_a_table_is_rows_and_combines_with_lists(tmp_path):
    path = tmp_path / "jobs.csv"
    path.write_text('Ball.youngsModulus,Ball.velocity\n1e4,"(0, -1, 0)"\n2e4,"0,-2,0"\n')
    axes = [read_table(path), parse_list("Ball.density=1,2")]
    assert [list(job.values.values()) for job in plan(axes, False)] == [
        ["1e4", "(0, -1, 0)", "1"], ["1e4", "(0, -1, 0)", "2"], ["2e4", "0,-2,0", "1"], ["2e4", "0,-2,0", "2"],
    ]  # fmt: skip
    assert len(plan(axes, True)) == 2


def test_as_many_at_once_as_memory_and_processors_allow():
    assert jobs_at_once(6, 8, 100, 450) == 4
    assert jobs_at_once(6, 2, 100, 450) == 2
    assert jobs_at_once(1, 8, 100, 450) == 1
    assert jobs_at_once(6, 8, 1000, 450) == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--vary", "Ball.youngsModuls=1,2"], "did you mean youngsModulus"),
        (["--vary", "Bal.youngsModulus=1,2"], "did you mean Ball"),
        (["--vary", "Ball.youngsModulus=1,soft"], "--vary Ball.youngsModulus=soft: 'soft' is not a value"),
        (["--vary", "Ball.youngsModulus=1,2", "--vary", "/World/Ball.youngsModulus=3,4"], "are both /World/Ball."),
        (["--vary", "Ball.youngsModulus=1,2", "-o", "mine"], "is not empty and contains no wedge"),
    ],
)
def test_refused_before_the_first_job(cli, scene, tmp_path, options, message):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    done = cli("wedge", scene, *options)
    assert done.returncode == 2 and message in done.stderr, done.stderr
    assert not (tmp_path / "small_wedge").exists() and len(list((tmp_path / "mine").glob("*"))) == 1


@pytest.mark.slow
def test_six_jobs_one_of_which_diverges(cli, scene, tmp_path):
    """The others finish, each with the bits of the same run alone."""
    speeds = [f"(0,-{speed},0)" for speed in (0.5, 1, 1000, 1.5, 2, 2.5)]
    options = ["--vary", f"Ball.velocity={','.join(speeds)}", "--set", "Ball.compressible=1", "--frames", "1-4"]
    done = cli("wedge", scene, *options)
    folder = tmp_path / "small_wedge"
    rows = table(folder)
    assert done.returncode == 8 and [row["exit_code"] for row in rows] == ["0", "0", "4", "0", "0", "0"], done.stderr
    bad = rows.pop(2)
    assert (bad["status"], bad["last_frame"], bad["Ball.velocity"]) == ("diverged", "1", "(0,-1000,0)")
    assert "diverged at time" in bad["reason"]
    assert bad["folder"] in done.stderr and "1 of 6 jobs failed" in done.stderr
    assert all(row["last_frame"] == "4" and not row["reason"] for row in rows)
    settings = ("Ball.velocity=(0,-1,0)", "Ball.compressible=1")
    simulate(scene, Options(output=tmp_path / "one", settings=settings, frames="1-4", progress="none"))
    caches = {row["folder"]: content_hashes(folder / row["folder"]) for row in rows}
    assert caches[rows[1]["folder"]] == content_hashes(tmp_path / "one")
    assert len({json.dumps(hashes) for hashes in caches.values()}) == 5


def test_a_job_that_is_refused_and_a_wedge_taken_up_again(cli, scene, tmp_path):
    vary = ["--vary", "Domain.voxelSize=0.06,-1"]
    done = cli("wedge", scene, *vary, "--frames", "1-2")
    good, bad = table(tmp_path / "small_wedge")
    assert done.returncode == 8 and (good["exit_code"], bad["exit_code"], bad["status"]) == ("0", "3", "scene")
    assert "must be > 0" in bad["reason"] and not bad["last_frame"]
    assert "already contains a wedge" in cli("wedge", scene, *vary, "--frames", "1-2").stderr
    other = cli("wedge", scene, "--vary", "Domain.voxelSize=0.06,0.07", "--frames", "1-2", "--resume")
    assert other.returncode == 7 and "the first that differs is job 2" in other.stderr


@pytest.mark.slow
def test_a_wedge_that_is_stopped_goes_on(scene, tmp_path, library):
    """SIGTERM reaches every job; --resume ends with the cache of a run that was left alone."""
    folder = tmp_path / "wedge"
    command = [sys.executable, "-m", "eulerfsi", "wedge", scene, "--vary", "Ball.velocity=(0,-2,0),(0,-1,0)"]
    command += ["--frames", "1-30", "--threads", "2", "-o", folder]
    job = subprocess.Popen(command, env=environment(), stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    caches = [folder / f"Ball.velocity_0_-{n}_0" for n in (2, 1)]
    while not all(list(cache.glob("frames/*.0002.*")) for cache in caches) and time.monotonic() < until:
        time.sleep(0.02)
    job.send_signal(signal.SIGTERM)
    assert "continue with --resume" in job.communicate(timeout=60)[1] and job.returncode == 143
    assert "143" in {row["exit_code"] for row in table(folder)} <= {"0", "143"}
    again = subprocess.run([*command, "--resume"], env=environment(), capture_output=True)
    assert again.returncode == 0 and [row["last_frame"] for row in table(folder)] == ["30", "30"]
    simulate(
        scene, Options(output=tmp_path / "one", settings=("Ball.velocity=(0,-1,0)",), frames="1-30", progress="none")
    )
    assert content_hashes(caches[1]) == content_hashes(tmp_path / "one")
    assert not list(folder.rglob(".*"))


def test_the_sheet_shows_every_picture_in_its_place(tmp_path):
    """Pictures of one colour each: their colours are found in the order of the jobs, the missing one is left out."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    jobs = plan([parse_list("Ball.youngsModulus=1,2"), parse_list("Ball.density=1,2,3")], False)
    colors = {0: (1, 0, 0), 1: (0, 1, 0), 2: (0, 0, 1), 3: (1, 1, 0), 5: (1, 0, 1)}
    for number, color in colors.items():
        (tmp_path / jobs[number].folder).mkdir()
        pyplot.imsave(tmp_path / jobs[number].folder / "preview.png", np.full((60, 80, 3), color, float))
    (path,) = summary.draw(tmp_path, [Row(job, 0, "ok") for job in jobs])
    sheet = pyplot.imread(path)[..., :3]
    height, width = sheet.shape[0] // 2, sheet.shape[1] // 3
    for number in range(6):
        cell = sheet[number // 3 * height :, number % 3 * width :][int(0.7 * height), width // 2]
        expected = np.array(colors.get(number, (0.075, 0.085, 0.105)))
        assert np.abs(cell - expected).max() < 0.02, number


def test_what_a_killed_job_leaves(tmp_path):
    (job,) = plan([parse_list("Ball.youngsModulus=1")], False)
    row = Row(job)
    row.take(128 + signal.SIGKILL, [], "", 1.0, tmp_path)
    assert (row.status, row.reason) == ("signal 9", "ended without a word")
    assert os.path.basename(job.folder) == job.folder


def test_a_wedge_is_no_cache_but_holds_some(tmp_path):
    """`info`, `verify`, `view`, `plot` of its folder, or of a file, say what to give in its place."""
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "manifest.json").touch()
    with pytest.raises(SceneError, match=r"no manifest\.json; 2 of its folders have one, the first is a$"):
        Manifest.load(tmp_path)
    with pytest.raises(SceneError, match=r"manifest\.json: is a file: must be the folder of a cache"):
        Manifest.load(tmp_path / "a" / "manifest.json")
