"""The page in a real browser, opened from disk."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from small_report import HOSTILE, until

from pftrack_sim import report, score
from tests.contrast import faint_texts

CENTRE_OF_FRAME = """frame => {
    const plot = document.getElementById('overlap'), box = plot.getBoundingClientRect(), full = plot._fullLayout;
    const x = plot.data[0].x[frame], y = plot.data[0].y[frame];
    return [box.x + full.xaxis._offset + full.xaxis.l2p(x), box.y + full.yaxis._offset + full.yaxis.l2p(y)];
}"""


SHIFTED = """() => new Promise((done) => {
    let sum = 0;
    const seen = new PerformanceObserver((list) => { for (const one of list.getEntries()) sum += one.value; });
    seen.observe({ type: 'layout-shift', buffered: true });
    setTimeout(() => done(sum), 300);
})"""


LABELS = """name => {
    const shown = [...document.querySelectorAll(`#${name} .annotation-text`)];
    const boxes = shown.map((one) => one.getBoundingClientRect()), order = [...shown.keys()];
    order.sort((a, b) => boxes[a].top - boxes[b].top);
    const covered = order.slice(1).some((one, k) => boxes[one].top < boxes[order[k]].bottom - 2);
    return covered ? null : order.map((one) => shown[one].textContent.slice(2));
}"""


@pytest.fixture
def opened(show: Callable[[Path], Any], finished: Path) -> Any:
    return show(report.write_report(finished))


def board(page: Any) -> dict[str, list[str]]:
    rows = page.locator("#board tbody tr").all()
    return {row.locator("th").inner_text().splitlines()[0]: row.locator("td").all_inner_texts() for row in rows}


def test_it_opens_from_disk_and_ranks(opened: Any):
    assert list(board(opened)) == ["oracle", "stay"]
    assert board(opened)["oracle"][1] == "1.00\n1.00 1.00", "two seeds have no interval"
    assert opened.locator("#board tbody th").first.bounding_box()["width"] > 150, "a name is read across, not down"
    assert opened.locator("#speed .xtick").first.text_content() == "0", "a linear scale"
    heads = opened.locator("#board thead th").all_inner_texts()
    assert heads[2:6] == ["mean overlap", "stay", "skill", "tracked at 0.5"]
    assert [board(opened)[name][3] for name in ("oracle", "stay")] == ["1.00", "0.00"]
    shown = [float(board(opened)[name][-1]) for name in ("oracle", "stay")]
    assert sorted(shown) == opened.evaluate("document.getElementById('speed').data[0].text.map(Number)"), (
        "the same median"
    )
    for name in ("overlap", "success", "precision"):
        assert opened.evaluate(LABELS, name) == ["oracle", "stay"], "names at the ends of the curves, none on another"
    assert opened.evaluate("document.getElementById('overlap').layout.xaxis.title.text") == "time [s]"
    assert "first box" in opened.locator("#board th", has_text="stay").first.get_attribute("title")
    assert opened.locator("#axes .plot").count() == 1
    assert opened.locator(".strip img").count() >= 5
    seconds = opened.locator(".strip").first.locator("small").all_inner_texts()
    assert [seconds[0], seconds[-1]] == ["0.0 s", "0.8 s"]


def test_answers_begin_with_mark_and_name(opened: Any):
    for line in opened.locator("#answers li").all():
        mark, name, share = (line.locator(part).bounding_box() for part in (".swatch", "b", "strong"))
        assert mark["x"] < name["x"] < share["x"]
        assert abs(mark["y"] - name["y"]) < 20


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_moves_while_it_loads(show: Callable[..., Any], finished: Path, width: int):
    page = show(report.write_report(finished), width)
    until(page, "document.getElementById('video').readyState >= 1")
    assert page.evaluate(SHIFTED) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_texts_can_be_read(show: Callable[..., Any], finished: Path, scheme: str):
    page = show(report.write_report(finished))
    page.emulate_media(color_scheme=scheme)
    page.wait_for_timeout(500)  # plots are drawn again
    page.evaluate("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    assert faint_texts(page, 100) == []
    page.evaluate("document.getElementById('extent').style.color = 'rgb(128, 128, 128)'")
    assert len(faint_texts(page, 100)) == 1 or scheme == "dark"


def test_intervals_are_those_of_the_tables(opened: Any):
    assert opened.evaluate("interval([0.1, 0.2])") is None
    values = [0.1, 0.2, 0.2, 0.4, 0.9, 0.3]
    opened.evaluate("t => DATA.quantiles[6] = t", score.student_quantile(6))
    ours = score.mean_over_seeds(values, (0.0, 1.0))
    assert opened.evaluate("values => interval(values)", values) == pytest.approx([ours.low, ours.high])


@pytest.mark.slow
def test_plots_of_several_axes_stand_beside_each_other(opened: Any):
    opened.evaluate("DATA.axes.push(...DATA.axes.map((row) => ['other [m]', ...row.slice(1)])); drawAxes()")
    first, second = (plot.bounding_box() for plot in opened.locator("#axes .plot").all())
    drawn = opened.locator("#axes .plot .main-svg").first.bounding_box()
    assert first["x"] + first["width"] <= second["x"]
    assert drawn["width"] <= first["width"]


@pytest.mark.slow
def test_one_tracker_has_no_table_of_pairs(opened: Any):
    pairs = opened.locator("section:has(#matrix)")
    assert pairs.is_visible()
    opened.evaluate("() => { DATA.trackers.splice(1); DATA.matrix = []; drawMatrix(); }")
    assert not pairs.is_visible()


@pytest.mark.slow
def test_filters_change_the_board(opened: Any):
    everywhere = board(opened)["stay"][1]
    opened.select_option("#filter-scenario", label="corridor")
    assert board(opened)["stay"][1] != everywhere
    opened.get_by_label("oracle").uncheck()
    assert list(board(opened)) == ["stay"]
    opened.select_option("#filter-condition", label="jitter=2")
    assert board(opened)["stay"][0] == "2"


@pytest.mark.slow
def test_a_click_on_the_curve_seeks_the_video_and_keys_step(opened: Any):
    until(opened, "document.getElementById('video').readyState >= 1")
    opened.locator("#overlap").scroll_into_view_if_needed()
    rate = 25.0
    x, y = opened.evaluate(CENTRE_OF_FRAME, 12)
    opened.mouse.click(x, y)
    until(opened, f"Math.abs(document.getElementById('video').currentTime - 12.5 / {rate}) < 0.5 / {rate}")
    opened.locator("#viewer").focus()
    opened.keyboard.press("ArrowRight")
    until(opened, f"Math.abs(document.getElementById('video').currentTime - 13.5 / {rate}) < 0.5 / {rate}")
    opened.keyboard.press("ArrowLeft")
    opened.keyboard.press("ArrowLeft")
    until(opened, f"Math.abs(document.getElementById('video').currentTime - 11.5 / {rate}) < 0.5 / {rate}")


def test_a_name_that_is_a_script_stays_text(browser: Any, hostile: Path):
    page = browser.new_page()
    page.goto(report.write_report(hostile).as_uri())
    page.wait_for_selector("body[data-ready=yes]")
    assert page.title() != "taken"
    assert HOSTILE in board(page)
    names = page.locator("#success .annotation-text, #success .legendtext").all_text_contents()
    assert any(HOSTILE in text for text in names)
    assert page.locator("img[src=x]").count() == 0
    page.close()


@pytest.mark.slow
def test_everything_can_be_reached_by_keyboard(opened: Any):
    reached = set()
    for _ in range(90):  # Plotly has buttons of its own
        opened.keyboard.press("Tab")
        reached.add(opened.evaluate("document.activeElement.id || document.activeElement.type"))
    assert {"checkbox", "filter-scenario", "filter-condition", "episode", "viewer"} <= reached


@pytest.mark.slow
def test_nothing_is_fetched_from_elsewhere(browser: Any, finished: Path):
    page = browser.new_page()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(report.write_report(finished).as_uri())
    page.wait_for_selector("body[data-ready=yes]")
    page.wait_for_timeout(500)
    assert all(url.startswith(("file:", "data:", "blob:")) for url in asked)
    page.close()


def test_brackets_are_explained_where_there_are_some(finished: Path, lost: Path):
    words = "; in brackets its 95 % interval"
    assert words in report.write_report(finished).read_text()
    assert words not in report.write_report(lost).read_text(), "one seed has none"
