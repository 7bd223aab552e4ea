"""The report in a real browser: no error, no request, and what it does when it is used."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from harness.html_report import pictures
from harness.html_report.write import write_report
from harness.tests import fake_html_report as fake

sync_api = pytest.importorskip(
    "playwright.sync_api", reason="needs Playwright: pip install 'credence[dev]'"
)

if TYPE_CHECKING:
    from collections.abc import Iterator

    from playwright.sync_api import Browser, Page

PHONE, DESK = (390, 844), (1280, 900)
NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_api.sync_playwright() as playwright:
        found = next(filter(None, map(shutil.which, NAMES)), playwright.chromium.executable_path)
        if not Path(found).exists():
            pytest.skip(
                "no Chromium: install it with `apt-get install chromium` or "
                "`playwright install chromium`"
            )
        # The sandbox refuses to run for root, as in containers; the page is our own.
        browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield browser
        browser.close()


@dataclass
class Opened:
    """A page, and what the browser said and asked for while it was used."""

    page: Page
    said: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("browser")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pictures, "SIZE", (100, 75))
        run = fake.write_run(folder / "run")
        other = fake.write_run(folder / "other", precision=-0.05, record_scenes=False)
        return write_report(run.folder, against=other.folder).file


def open_page(
    browser: Browser, file: Path, *, size: tuple[int, int] = DESK, dark: bool = False
) -> Iterator[Opened]:
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]},
        color_scheme="dark" if dark else "light",
    )
    opened = Opened(context.new_page())
    opened.page.on("console", lambda message: opened.said.append(message.text))
    opened.page.on("pageerror", lambda error: opened.said.append(str(error)))
    opened.page.on("request", lambda request: opened.asked.append(request.url))
    opened.page.goto(file.as_uri())
    opened.page.wait_for_selector("#reliability-chart .main-svg")
    yield opened
    # Whatever was done with it: nothing was said, and nothing fetched but the file itself.
    assert opened.said == []
    assert [url for url in opened.asked if not url.startswith("data:")] == [file.as_uri()]
    context.close()


@pytest.fixture(scope="module")
def opened(browser: Browser, file: Path) -> Iterator[Opened]:
    yield from open_page(browser, file)


@pytest.fixture
def on_phone(browser: Browser, file: Path) -> Iterator[Page]:
    for opened in open_page(browser, file, size=PHONE, dark=True):
        yield opened.page


def column(page: Page, caption: str, heading: int) -> list[str]:
    """Texts of a table's column, without the notes below them."""
    texts = page.evaluate(
        """([caption, heading]) => {
            const table = [...document.querySelectorAll("table")]
                .find((item) => item.caption.textContent.startsWith(caption));
            const cells = [...table.tBodies[0].rows].map((row) => row.cells[heading]);
            return cells.map((cell) => cell.firstChild?.data ?? "");
        }""",
        [caption, heading],
    )
    return [str(text) for text in texts]


def test_it_is_drawn(opened: Opened) -> None:
    page = opened.page
    assert page.title() == "run \N{EN DASH} Credence report"
    traces = page.evaluate("document.getElementById('risk-chart').data.map((item) => item.name)")
    assert traces[:3] == ["classic, tuned", "metric", "nearest observation"]
    assert len(traces) == 5
    assert page.evaluate("document.getElementById('reliability-chart').data.length") == 4
    assert page.evaluate("window.hacked") is None
    offered = page.locator(".modebar-btn").evaluate_all("(all) => all.map((a) => a.dataset.title)")
    assert "Zoom" in offered
    assert not [title for title in offered if "Share" in title or "loud" in title]
    assert fake.HOSTILE in page.inner_text("#verdict")


def test_tables_sort_by_numbers_and_names(opened: Opened) -> None:
    page = opened.page
    table = page.locator("table", has=page.locator("caption", has_text="Mug, box: 6 scenes"))
    assert column(page, "Mug, box: 6", 0)[:3] == ["classic tuned", "metric", "nearest"]
    precision = table.locator("thead th", has_text="precision")
    assert precision.get_attribute("aria-sort") is None
    precision.get_by_role("button").click()
    assert precision.get_attribute("aria-sort") == "ascending"
    # The seed's model among ours, all by their numbers.
    rising = ["0.539", "0.675", "0.775", "0.875"]
    assert column(page, "Mug, box: 6", 5) == rising
    precision.get_by_role("button").press("Enter")
    assert precision.get_attribute("aria-sort") == "descending"
    assert column(page, "Mug, box: 6", 5) == rising[::-1]
    # The seed states no AUROC: undefined values stay last, both ways.
    auroc = table.locator("thead th", has_text="AUROC")
    for values in (["0.700", "0.800", "0.900", ""], ["0.900", "0.800", "0.700", ""]):
        auroc.get_by_role("button").click()
        assert column(page, "Mug, box: 6", 7) == values
    assert precision.get_attribute("aria-sort") is None
    table.locator("thead th", has_text="model").get_by_role("button").click()
    names = ["classic tuned", "metric", "nearest", "seed: metric"]
    assert column(page, "Mug, box: 6", 0) == names


def test_differences_sort_by_their_mean_not_their_text(opened: Opened) -> None:
    page = opened.page
    table = page.locator("table", has=page.locator("caption", has_text="The first model less"))
    heading = table.locator("thead th", has_text="difference")
    heading.get_by_role("button").click()
    means = [float(text.split()[0]) for text in column(page, "The first model less", 3)]
    assert len(means) > 20
    assert means == sorted(means)
    assert means[0] < 0 < means[-1]


def test_scenes_are_picked(opened: Opened) -> None:
    page = opened.page
    groups = page.locator("#scene-picker optgroup").evaluate_all(
        "(groups) => groups.map((group) => [group.label, group.children.length])"
    )
    assert groups == [["worst", 6], ["median", 3], ["bowl", 1], ["mug", 2]]
    # The worst is shown first; it failed, so that it has no picture.
    assert page.inner_text("#scene-title") == "bowl-0005"
    assert page.locator("#scene-pictures img").count() == 0
    assert "No pictures" in page.inner_text("#scene-unpictured")
    assert fake.HOSTILE in page.inner_text("#scene-numbers")
    assert page.locator("#scene-before").is_disabled()
    page.select_option("#scene-picker", label="mug-0004")
    assert page.inner_text("#scene-title") == "mug-0004"
    assert page.locator("#scene-pictures img").count() == 5
    sizes = page.locator("#scene-pictures img").evaluate_all(
        "(images) => images.map((image) => image.naturalWidth)"
    )
    assert all(0 < size <= 100 for size in sizes)
    rows = page.locator("#scene-numbers tbody tr").all_inner_texts()
    assert rows[1].split("\t")[:4] == ["metric", "SC (cloud)", "0.500", "0.860"]
    page.click("#scene-after")
    assert page.inner_text("#scene-title") == "bowl-0003"
    page.locator("#scene-thumbs button", has_text="mug-0005").click()
    assert page.inner_text("#scene-title") == "mug-0005"
    assert page.locator("#scene-thumbs [aria-pressed=true]").inner_text() == "mug-0005 (worst)"
    page.select_option("#scene-picker", label="mug-0000")
    assert page.locator("#scene-after").is_disabled()
    assert page.locator("#scene-numbers tbody tr").count() == 6


def test_curves_follow_what_is_chosen(opened: Opened) -> None:
    page = opened.page
    risks = "document.getElementById('risk-chart').data.map((item) => item.y[99])"
    assert page.inner_text("#curve-about").startswith("6 scenes of 6 objects, 48 points;")
    before = page.evaluate(risks)
    # At full coverage: the tuned classic model is right too, the nearest one puts all on it.
    assert before == [0.0, 0.0, 0.5, 0.0, 0.0]
    page.select_option("#curve-cell", label="Bowl, SC (cloud)")
    assert page.inner_text("#curve-about").startswith("4 scenes of 4 objects, 32 points;")
    page.get_by_label("nearest observation").uncheck()
    assert page.evaluate(risks) == [0.0, 0.0, 0.0, 0.0]
    page.select_option("#curve-kind", index=2)
    kinds = page.evaluate("document.getElementById('reliability-chart').data.length")
    assert kinds == 3


def test_it_is_usable_on_a_phone_in_the_dark_too(on_phone: Page) -> None:
    page = on_phone
    for summary in page.locator("details > summary").all():
        summary.click()
    assert page.evaluate("document.documentElement.scrollWidth") == PHONE[0]
    beyond = page.evaluate(
        """(width) => [...document.querySelectorAll("main *, header *, footer *")]
            .filter((node) => node.closest(".box, .thumbs, pre, .js-plotly-plot, nav") === null)
            .filter((node) => node.getBoundingClientRect().right > width + 0.5)
            .map((node) => node.outerHTML.slice(0, 80))""",
        PHONE[0],
    )
    assert beyond == []
    # What is too wide scrolls in its own box, and what is touched is large enough.
    assert page.locator(".box").first.evaluate("(box) => box.scrollWidth > box.clientWidth")
    heights = page.locator(".controls select, .controls button").evaluate_all(
        "(items) => items.map((item) => item.getBoundingClientRect().height)"
    )
    assert min(heights) >= 36
    for dark in (True, False):
        page.emulate_media(color_scheme="dark" if dark else "light")
        ground, text = page.evaluate(
            """() => ["backgroundColor", "color"].map((name) =>
                getComputedStyle(document.body)[name].match(/\\d+/g).map(Number)[1])"""
        )
        assert (ground < text) == dark


def test_it_prints(opened: Opened) -> None:
    page = opened.page
    page.emulate_media(media="print")
    assert not page.locator("nav").is_visible()
    assert not page.locator("#scene-picker").is_visible()
    assert page.locator("#tables table").first.is_visible()
    assert page.locator(".box").first.evaluate("(box) => getComputedStyle(box).overflowX") == (
        "visible"
    )
    page.emulate_media(media="screen")
