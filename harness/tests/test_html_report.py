"""The report of a run as HTML: what it says, what it embeds, and what it refuses."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from typing import TYPE_CHECKING, Any

import pytest
from PIL import Image

from harness import cli
from harness.errors import InputError
from harness.html_report import pictures, scenes
from harness.html_report.bars import Bar, bars
from harness.html_report.names import reference_model
from harness.html_report.scenes import FAILED, MISSED, SCORED, picker_data, rank_scenes
from harness.html_report.timings import timing_grid
from harness.html_report.verdict import HEADLINE
from harness.html_report.write import write_report
from harness.recordings.file import encode
from harness.runs.records import Record, Timing, write_records
from harness.table.cells import UNDEFINED
from harness.table.differences import Contrast
from harness.tests import fake_html_report as fake

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

MEGABYTE = 1_000_000


class Elements(HTMLParser):
    """What a browser would make of a page: elements, their attributes, and the text of each."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.scripts: list[str] = []
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        (self.scripts if self._inside == "script" else self.texts).append(data)

    def rows(self, caption: str) -> list[str]:
        """Texts of a table's cells, from its caption on."""
        start = self.texts.index(caption)
        return [text.strip() for text in self.texts[start:] if text.strip()]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> fake.FakeRun:
    return fake.write_run(tmp_path_factory.mktemp("report") / "run")


@pytest.fixture(scope="module", autouse=True)
def small_pictures() -> Iterator[None]:
    """What a picture costs is its surface, cast ray by ray."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "SIZE", (100, 75))
        yield


@pytest.fixture(scope="module")
def page(run: fake.FakeRun) -> str:
    return write_report(run.folder).file.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def elements(page: str) -> Elements:
    return Elements(page)


@pytest.fixture(scope="module")
def unrecorded(tmp_path_factory: pytest.TempPathFactory) -> fake.FakeRun:
    return fake.write_run(tmp_path_factory.mktemp("unrecorded") / "run", record_scenes=False)


@pytest.fixture
def bare(unrecorded: fake.FakeRun, tmp_path: Path) -> fake.FakeRun:
    """A run without recordings, for a test to change."""
    return fake.FakeRun(
        shutil.copytree(unrecorded.folder, tmp_path / "bare"), list(unrecorded.records)
    )


def data(elements: Elements, name: str) -> Any:
    """Data that a page's scripts read."""
    order = [a.get("id") for tag, a in elements.found if tag == "script"]
    return json.loads(elements.scripts[order.index(name)])


def test_the_page_needs_nothing_but_itself(page: str, elements: Elements) -> None:
    assert 4 * MEGABYTE < len(page.encode()) < 10 * MEGABYTE
    for tag, attributes in elements.found:
        assert not attributes.keys() & {"srcset", "action", "data", "poster", "background"}
        if "src" in attributes:
            assert (attributes["src"] or "").startswith("data:")
        if tag == "a":
            assert (attributes["href"] or "").startswith("#")
        if tag == "link":
            assert (attributes["href"] or "").startswith("data:")
    policy = next(a for tag, a in elements.found if "http-equiv" in a)
    assert (policy["content"] or "").startswith("default-src 'none';")
    assert "form-action 'none'" in (policy["content"] or "")


def test_the_same_run_is_the_same_page(run: fake.FakeRun, page: str, tmp_path: Path) -> None:
    found = write_report(run.folder, out=tmp_path / "again.html")
    assert found.file.read_text(encoding="utf-8") == page
    assert (found.scenes, found.failed, found.missed, found.pictured) == (12, 1, 1, 8)
    assert found.bytes == found.file.stat().st_size
    assert found.lacking == ()


def test_text_of_a_run_stays_text(elements: Elements) -> None:
    assert fake.HOSTILE in elements.texts
    assert [a.get("id") for tag, a in elements.found if tag == "script"] == [
        "curves-data",
        None,
        "scenes-data",
        None,
    ]
    assert not [a for tag, a in elements.found if tag == "img" or "onerror" in a]
    assert data(elements, "scenes-data")["failures"] == [fake.HOSTILE, "the target was missed"]
    assert "<" not in elements.scripts[2]


def test_a_hostile_folder_and_setting_stay_text(bare: fake.FakeRun, tmp_path: Path) -> None:
    folder = tmp_path / "<img src=x onerror=alert(1)>"
    shutil.copytree(bare.folder, folder)
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    manifest["config"]["pipeline"]["<b>key</b>"] = "<script>"
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")
    found = Elements(write_report(folder).file.read_text(encoding="utf-8"))
    assert folder.name in found.texts
    assert "pipeline.<b>key</b>" in found.texts
    assert not [tag for tag, _ in found.found if tag in ("img", "b-key")]


def test_the_verdict(elements: Elements) -> None:
    text = " ".join(" ".join(elements.texts).split())
    # Of bowls one failed and one has no completion: 5 and 4 objects are too few for any test.
    assert (
        "The metric model against the classic tuned one, by precision, AUROC, AURC, ECE in each "
        "class and test set: better in 8, on too few objects to test in 8 of 16 comparisons."
    ) in text
    # All six mugs differ by 0.2: 2 of 64 changes of signs are as far out, so that p is 1/32 of 20
    # tests; of 8 more, those of the accuracy, it is 1. So q is 28/20 of 1/32.
    assert (
        "Mug, box 6 scenes, 6 objects precision best: metric 0.875 [0.857, 0.895] "
        "metric - classic tuned +0.200 [+0.200, +0.200], q .044: better, detected;"
    ) in text
    assert "AURC best: metric 0.125 [0.105, 0.143] metric - classic tuned -0.200" in text
    assert "12 scenes of mug, bowl, 3 views each, 3 models, masks by oracle" in text
    assert "11 scenes scored 12 objects 1 scenes failed 1 targets missed" in text


def test_the_page_says_on_how_many_scenes_the_best_is_best(bare: fake.FakeRun) -> None:
    records = [
        replace(r, auroc=None, precision=None)
        if (r.scene_id, r.model) == ("mug-0000", "nearest")
        else r
        for r in bare.records
    ]
    write_records(records, bare.folder / "records.parquet")
    text = " ".join(
        " ".join(Elements(write_report(bare.folder).file.read_text("utf-8")).texts).split()
    )
    assert "AUROC best: metric 0.900 [0.900, 0.900] (in 5 scenes)" in text
    assert "precision best: metric 0.875 [0.857, 0.895] metric" in text
    assert "the scenes that define the measure for every model" in text


def contrast(mean: float | None, low: float | None, high: float | None, least: float) -> Contrast:
    return Contrast(mean, low, high, 0.5, None, least, scenes=6, objects=6, q_value=0.5)


def test_bars_of_a_measure_share_a_scale() -> None:
    precision, _, aurc, _ = HEADLINE
    wide, narrow = contrast(0.1, 0.0, 0.2, 0.05), contrast(-0.1, None, None, 0.9)
    drawn = bars([wide, None, narrow, contrast(None, None, None, 0.1)], precision)
    assert drawn == [Bar(75.0, 50.0, 100.0, 12.5), None, Bar(25.0, 25.0, 25.0, 50.0), None]
    # Of an AURC less is better, and better is to the right.
    assert bars([wide], aurc) == [Bar(25.0, 0.0, 50.0, 12.5)]
    same = contrast(0.0, 0.0, 0.0, 0.0)
    assert bars([same], precision) == [Bar(50.0, 50.0, 50.0, 0.0)]


def test_losses_are_listed(elements: Elements) -> None:
    rows = elements.rows("Failures")
    models = "classic tuned, metric, nearest"
    assert rows[5:9] == ["bowl-0004", "SC (cloud)", models, "the target was missed"]
    assert rows[9:13] == ["bowl-0005", "SC (cloud)", models, fake.HOSTILE]
    missed = elements.rows("Targets that the segmenter missed")
    assert missed[4:7] == ["bowl-0004", "bowl_4", "oracle"]


def test_curves_and_their_numbers(elements: Elements) -> None:
    curves = data(elements, "curves-data")
    assert [cell["label"] for cell in curves["cells"]] == [
        "Mug, box",
        "Mug, SC (cloud)",
        "Bowl, box",
        "Bowl, SC (cloud)",
    ]
    box = curves["cells"][0]
    assert box["about"] == "6 scenes of 6 objects, 48 points; 50% of the points lie on the object."
    names = [series["label"] for series in curves["series"]]
    assert names[:3] == ["classic, tuned", "metric", "nearest observation"]
    # The metric model is right of every point; the nearest one puts all on the object.
    assert set(box["risk"]["confidence"][1]) == {0.0}
    assert set(box["risk"]["confidence"][2]) == {0.5}
    assert box["reliability"]["confidence"][1] == {
        "predicted": [0.05, 0.95],
        "observed": [0.0, 1.0],
        "counts": [24, 24],
    }
    calibration = elements.rows("Mean over scenes with its 95 % interval over objects")
    place = calibration.index("confidence")
    assert calibration[place - 2 : place + 1] == ["Mug, box", "classic tuned", "confidence"]


def test_scenes_are_ranked_from_the_worst(run: fake.FakeRun) -> None:
    ranked = rank_scenes(run.records, model="metric")
    assert [item.scene_id for item in ranked[:4]] == [
        "bowl-0005",
        "bowl-0004",
        "mug-0005",
        "mug-0004",
    ]
    assert [item.state for item in ranked[:3]] == [FAILED, MISSED, SCORED]
    assert [item.loss for item in ranked[:3]] == pytest.approx([None, 0.14, 0.15])
    groups = {item.scene_id: item.group for item in ranked}
    # Of six no more than three are the worst; two scored ones lie about the middle.
    assert {name for name, group in groups.items() if group == "worst"} == {
        *("mug-0005", "mug-0004", "mug-0003"),
        *("bowl-0005", "bowl-0004", "bowl-0003"),
    }
    assert groups["mug-0002"] == groups["bowl-0002"] == "median"
    assert groups["mug-0000"] == "mug"


def test_the_picker_packs_numbers(run: fake.FakeRun) -> None:
    ranked = rank_scenes(run.records, model="metric")
    packed = picker_data(ranked, pictures={}, unpictured="none")
    groups = [scene["group"] for scene in packed["scenes"]]
    assert groups == [*["worst"] * 6, *["median"] * 3, "bowl", "mug", "mug"]
    scene = next(item for item in packed["scenes"] if item["id"] == "mug-0005")
    assert scene["about"] == "mug, object mug_5, seed 5, 1 views, scored; ranked by 0.150"
    row = dict(zip(packed["measures"], scene["rows"][0][3:], strict=True))
    model, test_set, failure = scene["rows"][0][:3]
    assert (packed["models"][model], packed["sets"][test_set], failure) == (
        "classic tuned",
        "SC (cloud)",
        None,
    )
    assert (row["precision"], row["AURC"], row["recal. ECE"]) == (650, 350, None)
    lost = next(item for item in packed["scenes"] if item["id"] == "bowl-0005")
    assert packed["failures"][lost["rows"][0][2]] == fake.HOSTILE


def test_the_model_that_ranks() -> None:
    assert reference_model(["nearest", "metric", "classic"]) == "metric"
    assert reference_model(["nearest", "theirs", "classic"]) == "classic"


def test_pictures_of_a_scene() -> None:
    recording = fake.recording(fake.job("mug", 0))
    drawn = list(pictures.scene_pictures(recording, model="metric", tolerance_m=0.005))
    assert [item.caption for item in drawn] == [
        "view 1: found mug 0.75",
        "map around the target, voxels by class",
        "completed points by the metric model's confidence, from the first camera's side",
        "completed points by the metric model's confidence, from behind",
        "completed points: 50% within 5 mm of the mesh, the others orange",
    ]
    for item in drawn:
        head, _, body = item.data.partition(",")
        assert head == "data:image/webp;base64"
        image = Image.open(io.BytesIO(base64.b64decode(body)))
        assert image.format == "WEBP"
        assert image.width <= 100
        assert image.height <= 75
    missed = fake.recording(fake.job("bowl", 4))
    captions = [
        item.caption for item in pictures.scene_pictures(missed, model="metric", tolerance_m=0.005)
    ]
    assert captions == ["view 1: nothing found", "map around the target, voxels by class"]


def test_timings_are_summarised() -> None:
    timings = [
        Timing(scene_id=name, stage=stage, model=model, seconds=seconds, peak_memory_mib=memory)
        for name, factor in (("a", 1.0), ("b", 3.0))
        for stage, model, seconds, memory in (
            ("fit", "classic_tuned", factor, None),
            ("scene", None, 4 * factor, 50 * factor),
        )
    ]
    whole, fit = timing_grid(timings).rows
    assert [cell.text for cell in whole] == [
        *("whole scene", "", "8.000", "8.000", "4.400", "11.600", "100.0%", "2", "150"),
    ]
    assert [cell.text for cell in fit] == [
        *("fit", "classic tuned", "2.000", "2.000", "1.100", "2.900", "25.0%", "2", UNDEFINED),
    ]


def test_provenance(run: fake.FakeRun, elements: Elements) -> None:
    texts = elements.texts
    assert "Tracked files differed from the git revision while the run was made." in texts
    command = next(text for text in texts if "harness bench --config" in text)
    assert command == (
        f"git checkout 0123abc\nmake setup\nharness bench --config {run.folder}/config.toml "
        f"--out {run.folder}-again"
    )
    changed = elements.rows("Settings that are not at this version's defaults")
    assert changed[4:16] == [
        *("protocol.tolerances_m", "[0.005]", "[0.0025, 0.005, 0.01]"),
        *("run.scenes", "6", "16"),
        *("run.seed", "3", "0"),
        *("pipeline.segmenter", "oracle", "maskrcnn_rgbd"),
    ]
    assert "0123abc with changes" in texts
    assert "Packages: credence 0.1.0, numpy 2.4.6." in " ".join(texts)


def test_without_recordings_it_says_what_lacks(bare: fake.FakeRun) -> None:
    found = write_report(bare.folder)
    why = (
        f"No curves and no pictures: there are no recordings in {bare.folder / 'recordings'}; run "
        "the benchmark again to have them."
    )
    assert found.lacking == (why,)
    assert (found.pictured, found.bytes < MEGABYTE) == (0, True)
    page = Elements(found.file.read_text(encoding="utf-8"))
    assert page.texts.count(why) == 2
    assert data(page, "scenes-data")["pictures"] == {}
    manifest = bare.folder / "manifest.json"
    manifest.write_text(manifest.read_text("utf-8").replace('"all"', '"nothing"'), "utf-8")
    assert 'made with record = "nothing" in [run]' in write_report(bare.folder).lacking[0]
    (bare.folder / "timings.parquet").unlink()
    text = write_report(bare.folder).file.read_text(encoding="utf-8")
    assert f"{bare.folder / 'timings.parquet'} is missing or empty: no timings." in text


def test_missing_recordings_are_listed(run: fake.FakeRun, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run.folder, folder)
    lost = ("mug-0003", "mug-0005")
    for scene_id in lost:
        (folder / "recordings" / f"{scene_id}.npz").unlink()
    found = write_report(folder)
    assert found.lacking == (
        "No recording of 2 of 11 scored scenes (the first: mug-0003): curves and pictures leave "
        f"them out; make them again with `harness bench --out {folder}`.",
    )
    page = Elements(found.file.read_text("utf-8"))
    assert found.lacking[0] in page.texts
    assert data(page, "curves-data")["cells"][0]["about"].startswith("4 scenes of 4 objects")
    assert not set(lost) & data(page, "scenes-data")["pictures"].keys()


def test_what_a_failed_scene_left_is_not_drawn(run: fake.FakeRun, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run.folder, folder)
    left = encode(fake.recording(fake.job("bowl", 5)))
    (folder / "recordings" / f"{fake.FAILED}.npz").write_bytes(left)
    found = write_report(folder)
    assert (found.pictured, found.lacking) == (8, ())
    page = Elements(found.file.read_text("utf-8"))
    assert fake.FAILED not in data(page, "scenes-data")["pictures"]
    assert data(page, "curves-data")["cells"][2]["about"].startswith("5 scenes of 5 objects")


def test_a_run_of_failures_alone(bare: fake.FakeRun) -> None:
    lost = [
        Record.failed(
            fake.job(record.category, record.seed),
            variant=record.variant,
            views=1,
            tolerance_m=0.005,
            failure="no arm",
        )
        for record in bare.records
    ]
    write_records(lost, bare.folder / "records.parquet")
    found = write_report(bare.folder)
    assert found.verdict == "No scene was scored: every one failed."
    assert found.failed == found.scenes == 12
    assert found.lacking == (
        "No curves and no pictures: every scene failed; tracebacks are in the run's logs.",
    )


def test_against_another_run(bare: fake.FakeRun, tmp_path: Path) -> None:
    other = fake.write_run(tmp_path / "other", record_scenes=False, precision=-0.05)
    moved = [replace(r, redraws=1) if r.scene_id == "mug-0000" else r for r in other.records]
    write_records(moved, other.folder / "records.parquet")
    found = write_report(bare.folder, against=other.folder)
    text = " ".join(" ".join(Elements(found.file.read_text("utf-8")).texts).split())
    # Five mugs and five bowls are left: too few for a test, so that equal ones are the same.
    assert "This run against other, on 10 scenes of both:" in text
    assert "Left out, not the same scene in both runs: mug-0000: its redraws is 0 in the" in text
    assert "Mug, box metric precision +0.050 [+0.050, +0.050] not tested: 6 objects are" in text
    same = write_report(bare.folder, against=bare.folder)
    text = " ".join(" ".join(Elements(same.file.read_text("utf-8")).texts).split())
    assert "on 11 scenes of both: the same in 72 of 72 comparisons." in text


def test_many_scenes_are_bounded() -> None:
    records = [
        fake.record(fake.job("mug", index), model=model, completion="none")
        for index in range(60)
        for model in fake.MODELS
    ]
    ranked = rank_scenes(records, model="metric")
    assert [item.group for item in ranked].count("worst") == 12
    assert [item.scene_id for item in ranked if item.group == "median"] == [
        f"mug-{index:04d}" for index in (31, 30, 29, 28)
    ]


def test_the_picker_holds_the_worst(bare: fake.FakeRun, monkeypatch: pytest.MonkeyPatch) -> None:
    # Six records of each scene.
    monkeypatch.setattr(scenes, "MOST_ROWS", 17)
    ranked = rank_scenes(bare.records, model="metric")
    packed = picker_data(ranked, pictures={}, unpictured="")
    assert {item["id"] for item in packed["scenes"]} == {"bowl-0005", "bowl-0004"}
    page = Elements(write_report(bare.folder).file.read_text("utf-8"))
    assert any("Only the worst 2 of 12 are listed." in text for text in page.texts)


def test_a_long_reason_is_cut(bare: fake.FakeRun) -> None:
    records = [
        replace(r, failure="x" * 10_000) if r.failure is not None else r for r in bare.records
    ]
    write_records(records, bare.folder / "records.parquet")
    page = Elements(write_report(bare.folder).file.read_text("utf-8"))
    assert "x" * 500 + " ..." in page.texts
    assert data(page, "scenes-data")["failures"] == ["x" * 500 + " ..."]


def damage_recording(run: fake.FakeRun) -> None:
    path = run.folder / "recordings" / "mug-0000.npz"
    path.write_bytes(path.read_bytes()[:200])


def other_schema(run: fake.FakeRun) -> None:
    path = run.folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text("utf-8")) | {"schema_version": 3}))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda run: (run.folder / "manifest.json").unlink(), "run holds no run; pass the folder"),
        (
            lambda run: (run.folder / "records.parquet").unlink(),
            "run is unfinished; finish it with `harness bench --out ",
        ),
        (other_schema, "was written with record schema 3, this version reads 5; "),
        (
            lambda run: (run.folder / "records.parquet").write_bytes(b"PAR1"),
            r"records.parquet is damaged \(",
        ),
        (
            lambda run: (run.folder / "timings.parquet").write_bytes(b"PAR1"),
            r"timings.parquet is damaged \(",
        ),
        (
            lambda run: write_records([], run.folder / "records.parquet"),
            "records.parquet holds no record; run the benchmark again",
        ),
        (damage_recording, "mug-0000.npz"),
    ],
)
def test_runs_that_cannot_be_reported(
    run: fake.FakeRun, tmp_path: Path, spoil: Callable[[fake.FakeRun], None], message: str
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run.folder, folder)
    (folder / "report.html").unlink(missing_ok=True)
    spoil(fake.FakeRun(folder, run.records))
    with pytest.raises(InputError, match=message):
        write_report(folder)
    assert not (folder / "report.html").exists()


def test_runs_that_cannot_be_compared(bare: fake.FakeRun, tmp_path: Path) -> None:
    other = fake.write_run(tmp_path / "other", record_scenes=False)
    moved = [replace(record, redraws=1) for record in other.records if record.status == "ok"]
    write_records(moved, other.folder / "records.parquet")
    with pytest.raises(InputError, match=r"share no scene that both scored \(its redraws is 0 in"):
        write_report(bare.folder, against=other.folder)
    theirs = [replace(record, model="theirs") for record in other.records]
    write_records(theirs, other.folder / "records.parquet")
    with pytest.raises(
        InputError, match=r"no model in common \(classic_tuned, metric, nearest and theirs\); comp"
    ):
        write_report(bare.folder, against=other.folder)
    with pytest.raises(InputError, match="none holds no run"):
        write_report(bare.folder, against=tmp_path / "none")
    assert not (bare.folder / "report.html").exists()


def test_files_that_cannot_be_written(bare: fake.FakeRun, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--out .* is a folder; name a file in it, such as"):
        write_report(bare.folder, out=tmp_path)
    with pytest.raises(InputError, match=r"cannot write .*none/x\.html: there is no folder"):
        write_report(bare.folder, out=tmp_path / "none" / "x.html")


def test_the_command(bare: fake.FakeRun, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(bare.folder)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("The metric model against the classic tuned one")
    assert re.search(r"12 scenes, 1 failed, 1 targets missed; 0\.\d MB in \d+ s, written to", said)
    out = bare.folder / "other.html"
    assert cli.main(["report", str(bare.folder), "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["file"] == str(out)
    assert found["bytes"] == out.stat().st_size
    assert cli.main(["report", str(bare.folder / "none")]) == 2
    assert "none holds no run; pass the folder that" in capsys.readouterr().err
