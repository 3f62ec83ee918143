"""The page as a browser runs it."""

import io
import shutil
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import nichechain as nc
from nichechain.evolvability.coverage import visit_probabilities
from nichechain.plots.explorer import write_explorer
from nichechain.plots.explorer.transitions import rounded_transition

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser") / "arm"
    config = nc.BuildConfig("arm", (6, 9), ((-0.9, 0.9), (-1, 1)), evaluations=900, scale=0.3)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    if not (CHROMIUM and DRIVER):
        pytest.skip("no browser: needs chromium and chromedriver (Debian: chromium, chromium-driver)")
    webdriver = pytest.importorskip(
        "selenium.webdriver", reason="selenium, which drives it, is not installed"
    )
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (
        "headless",
        "no-sandbox",
        "disable-gpu",
        "disable-quic",
        "no-first-run",
        "disable-background-networking",
        "disable-component-update",
        "disable-sync",
        "window-size=1300,900",
        f"user-data-dir={tmp_path_factory.mktemp('profile')}",
    ):
        options.add_argument(f"--{flag}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def pages(archive, tmp_path_factory):
    """Addresses of pages, one for each estimator."""
    folder = tmp_path_factory.mktemp("pages")
    made = {}
    for estimator in ("empirical-bayes", "mle"):
        out = folder / f"{estimator}.html"
        write_explorer(archive, archive.chain(estimator), out, l=4, lineages=50, draws=3)
        made[estimator] = out.as_uri()
    return made


@pytest.fixture
def browser(chromium, pages):
    # Only the address's fragment may have changed, which loads nothing anew.
    chromium.get("about:blank")
    chromium.get(pages["empirical-bayes"])
    yield chromium
    assert chromium.get_log("browser") == []


def text(browser, identifier):
    return browser.find_element("id", identifier).text


def slide(browser, identifier, value):
    browser.execute_script(
        "const s = document.getElementById(arguments[0]); s.value = arguments[1];"
        "s.dispatchEvent(new Event('input'));",
        identifier,
        value,
    )


def rectangle(browser, archive, index):
    return browser.find_element("css selector", f'[data-niche="{archive.niches.flat(index)}"]')


def reached(browser, niche):
    """h of the page, (10, S)."""
    return np.array(
        browser.execute_script(
            "return explorer.visitProbabilities(arguments[0]).map((h) => Array.from(h))", niche
        )
    )


@pytest.mark.parametrize("estimator", ["empirical-bayes", "mle"])
def test_page_computes_what_the_library_does(chromium, pages, archive, estimator):
    chromium.get(pages[estimator])
    chain = archive.chain(estimator)
    transition = rounded_transition(chain)[0].toarray()
    n = len(archive.niches)
    found = np.stack([reached(chromium, niche) for niche in range(n)], axis=1)
    assert found.shape == (10, n, chain.states)
    for generations in range(1, 11):
        blocks = visit_probabilities(transition, transition[:n], generations)
        expected = np.hstack([h for _, h in blocks])
        np.testing.assert_allclose(found[generations - 1], expected, atol=1e-12)
    # What is embedded is rounded to single precision; the library's own T is not.
    exact = np.hstack([h for _, h in visit_probabilities(chain.T, chain.T[:n], 5)])
    np.testing.assert_allclose(found[4], exact, atol=1e-6)
    column = chromium.execute_script(
        "return Array.from({length: explorer.data.states}, (_, i) => explorer.entry(i, 20))"
    )
    np.testing.assert_allclose(column, transition[:, 20], atol=1e-12)


def test_click_shows_the_niche(browser, archive):
    elite = archive.elite(int(archive.elites.niche[4]))
    rectangle(browser, archive, elite.niche).click()
    assert text(browser, "niche") == f"Niche {archive.niches.label(elite.state)}"
    shown = text(browser, "elite").split("\n")
    assert str(elite.uid) in shown
    assert f"{elite.depth} generations" in shown
    births = text(browser, "births").split("\n")
    assert births[1] == str(archive.counts.visits[elite.state])
    assert births[3] == str(archive.counts.births[elite.state])
    scores = nc.niche_evolvability(archive.chain(), l=4, lineages=50, draws=3)
    value, low, high = (getattr(scores, name)[elite.state] for name in ("value", "low", "high"))
    assert text(browser, "value") == f"{value:.1f}"
    assert text(browser, "interval") == f"90 % interval {low:.1f} to {high:.1f}"


def test_every_stop_has_an_interval(browser, archive):
    rectangle(browser, archive, (3, 4)).click()
    state, chain = archive.niches.flat((3, 4)), archive.chain()
    for l, stop, lineages in ((1, 7, 50), (9, 7, 50), (9, 0, 1), (10, 12, 1000)):
        slide(browser, "l", l)
        slide(browser, "u", stop)
        assert text(browser, "u-value") == str(lineages)
        found = nc.niche_evolvability(chain, l=l, lineages=lineages, draws=3)
        value, low, high = (getattr(found, name)[state] for name in ("value", "low", "high"))
        assert text(browser, "value") == f"{value:.1f}"
        assert text(browser, "interval") == f"90 % interval {low:.1f} to {high:.1f}"


def test_map_is_coloured_by_the_number_that_is_shown(browser, archive):
    rectangle(browser, archive, (3, 4)).click()
    slide(browser, "colour", "evolvability")
    scores = nc.niche_evolvability(archive.chain(), l=4, lineages=50, draws=3).value
    known = archive.counts.births[: len(archive.niches)] > 0
    most = int(np.argmax(np.where(known, scores, -1.0)))
    fill = browser.find_element("css selector", f'[data-niche="{most}"]').value_of_css_property("fill")
    assert fill == "rgb(253, 231, 37)"


def test_who_leads_here(browser, archive):
    state = int(np.argmax(archive.counts.visits[:54]))
    rectangle(browser, archive, archive.niches.index(state)).click()
    slide(browser, "arrows", "in")
    enough = archive.counts.births >= 20
    enough[state] = False
    column = np.where(enough, archive.chain().T[:, state], -1.0)
    strongest = np.argsort(-column)[: min(8, int(enough.sum()))]
    best = int(strongest[0])
    first = browser.find_elements("css selector", "#incoming tr")[1].text
    assert first.startswith(f"{archive.niches.label(best)} {100 * column[best]:.1f} % ")
    assert len(browser.find_elements("css selector", "#overlay polygon")) == int((strongest < 54).sum())


def test_lineage_is_a_path_over_the_map(browser, archive):
    deepest = int(archive.elites.niche[np.argmax(archive.elites.depth)])
    rectangle(browser, archive, archive.niches.index(deepest)).click()
    slide(browser, "arrows", "lineage")
    states = browser.execute_script("return explorer.lineage(arguments[0])", deepest)
    assert len(states) == archive.elite(deepest).depth + 1
    assert states[-1] == deepest
    circles = browser.find_elements("css selector", "#overlay circle")
    assert len(circles) == sum(place < len(archive.niches) for place in states)


def test_two_archives_side_by_side(chromium, archive, tmp_path):
    from selenium.webdriver.support.ui import WebDriverWait

    out = tmp_path / "both.html"
    chain = archive.chain()
    write_explorer(archive, chain, out, draws=2, beside=(archive, archive.chain("mle")))
    chromium.get(out.as_uri())
    frames = chromium.find_elements("css selector", "iframe")
    assert len(frames) == 2

    def in_frame(frame, what):
        chromium.switch_to.frame(frame)
        found = what()
        chromium.switch_to.default_content()
        return found

    wait = WebDriverWait(chromium, 20)
    wait.until(lambda _: all(in_frame(frame, lambda: text(chromium, "niche")) for frame in frames))
    in_frame(frames[1], lambda: rectangle(chromium, archive, (4, 5)).click())
    in_frame(frames[1], lambda: slide(chromium, "l", 8))
    for frame in frames:
        wait.until(lambda _, frame=frame: in_frame(frame, lambda: text(chromium, "niche")) == "Niche 4,5")
        wait.until(lambda _, frame=frame: in_frame(frame, lambda: text(chromium, "l-value")) == "8")
    scales = {in_frame(frame, lambda: text(chromium, "legend").split("never")[0]) for frame in frames}
    assert len(scales) == 1
    assert chromium.get_log("browser") == []


def test_niche_by_name(browser):
    from selenium.webdriver import Keys

    box = browser.find_element("id", "go")
    box.clear()
    box.send_keys("4 7", Keys.ENTER)
    assert text(browser, "niche") == "Niche 4,7"
    box.clear()
    box.send_keys("77,1", Keys.ENTER)
    assert text(browser, "niche") == "Niche 4,7"
    assert "go up to 5,8" in box.get_attribute("validationMessage")


def test_births_so_far(browser, archive):
    slide(browser, "colour", "visits")
    slide(browser, "stage", 6)
    births = archive.births().head(315)["child_niche"]
    births = births[births < 54]
    assert text(browser, "stage-value") == "315"
    for niche in (int(births.iloc[5]), int(births.iloc[20])):
        cell = browser.find_element("css selector", f'[data-niche="{niche}"]')
        assert cell.value_of_css_property("fill") != "rgb(236, 236, 236)"
    later = int(np.flatnonzero((archive.counts.visits[:54] > 0) & ~np.isin(np.arange(54), births))[0])
    grey = browser.find_element("css selector", f'[data-niche="{later}"]').value_of_css_property("fill")
    assert grey in ("rgb(236, 236, 236)", "rgb(38, 43, 48)")


def test_table_and_picture_can_be_saved(browser, archive):
    table = pd.read_csv(io.StringIO(browser.execute_script("return explorer.tableOfNiches()")))
    assert len(table) == len(archive.niches)
    found = nc.niche_evolvability(archive.chain(), l=4, lineages=50, draws=3)
    np.testing.assert_allclose(table["niches_reached"], found.value, atol=2e-3)
    np.testing.assert_allclose(table["low"], found.low, atol=2e-3)
    assert (table["births"] == archive.counts.visits[:54]).all()
    assert table["niche"][10] == archive.niches.label(10)
    picture = browser.execute_script("return explorer.picture()")
    drawn = ElementTree.fromstring(picture["text"])
    assert len(drawn.findall(".//*[@data-niche]")) == len(archive.niches)
    assert "var(" not in picture["text"].split("<g", 1)[1].replace("--", "")
    for name in ("save-picture", "save-table"):
        browser.find_element("id", name).click()


def test_strongest_transitions(browser, archive):
    state = int(np.argmax(archive.counts.births[: len(archive.niches)]))
    rectangle(browser, archive, archive.niches.index(state)).click()
    row = archive.chain().T[state].copy()
    row[state] = -1
    best = int(np.argmax(row))
    first = browser.find_elements("css selector", "#edges tr")[1].text
    assert first.startswith(f"{archive.niches.label(best)} {100 * row[best]:.1f} % ")
    assert f"% {archive.counts.matrix[state, best]}" in first
    if best < len(archive.niches):
        browser.find_element("css selector", "#edges button").click()
        assert text(browser, "niche") == f"Niche {archive.niches.label(best)}"


def test_keys_walk_from_niche_to_niche(browser, archive):
    from selenium.webdriver import ActionChains, Keys

    rectangle(browser, archive, (2, 3)).click()
    keys = (Keys.ARROW_RIGHT, Keys.ARROW_UP, Keys.ARROW_UP, Keys.ARROW_LEFT, Keys.ARROW_LEFT, Keys.ARROW_DOWN)
    ActionChains(browser).send_keys(*keys).perform()
    assert text(browser, "niche") == "Niche 1,4"
    focused = browser.switch_to.active_element
    assert focused.get_attribute("aria-label").startswith("niche 1,4, x")
    assert focused.get_attribute("aria-selected") == "true"
    ActionChains(browser).send_keys(*[Keys.ARROW_LEFT] * 5).perform()
    assert text(browser, "niche") == "Niche 0,4"
    # One stop for the tabulator, whatever the number of niches.
    assert len(browser.find_elements("css selector", '#cells [tabindex="0"]')) == 1


def test_hover_tells_niche_and_place(browser, archive):
    from selenium.webdriver import ActionChains

    ActionChains(browser).move_to_element(rectangle(browser, archive, (5, 2))).perform()
    x, y = archive.niches.centers[archive.niches.flat((5, 2))]
    lines = text(browser, "tip").split("\n")
    assert lines[0] == "niche 5,2"
    assert lines[1] == f"x {x:.2f}, y {y:.2f} arm lengths".replace("-", "−")


def test_zoom_and_pan(browser, archive):
    from selenium.webdriver import ActionChains

    cell = rectangle(browser, archive, (2, 4))
    cell.click()
    before = cell.rect["width"]
    browser.find_element("id", "zoom-in").click()
    assert cell.rect["width"] == pytest.approx(1.5 * before, rel=0.02)
    at = cell.rect["y"]
    heading = text(browser, "niche")
    ActionChains(browser).move_to_element(cell).click_and_hold().move_by_offset(0, 30).release().perform()
    assert cell.rect["y"] == pytest.approx(at + 30, abs=1)
    assert text(browser, "niche") == heading
    for _ in range(6):
        browser.find_element("id", "zoom-in").click()
    box = browser.find_element("css selector", ".chosen").rect
    chart = browser.find_element("id", "chart").rect
    assert chart["x"] <= box["x"] <= chart["x"] + chart["width"]
    assert chart["y"] <= box["y"] <= chart["y"] + chart["height"]
    browser.find_element("id", "zoom-all").click()
    assert cell.rect["width"] == pytest.approx(before, rel=0.01)


def test_colours_and_theme(browser, archive):
    cell = rectangle(browser, archive, (3, 4))
    seen = set()
    for option in browser.find_elements("css selector", "#colour option"):
        slide(browser, "colour", option.get_attribute("value"))
        seen.add((cell.value_of_css_property("fill"), text(browser, "legend").split("\n")[0]))
    assert len({words for _, words in seen}) == 9
    paper = browser.find_element("tag name", "body").value_of_css_property("background-color")
    browser.find_element("id", "theme").click()
    assert browser.find_element("tag name", "body").value_of_css_property("background-color") != paper


def test_address_says_what_is_shown(browser, pages):
    browser.get("about:blank")
    browser.get(pages["empirical-bayes"] + "#niche=1,7&l=9&U=200&colour=visits")
    assert text(browser, "niche") == "Niche 1,7"
    assert text(browser, "l-value") == "9"
    assert text(browser, "u-value") == "200"
    assert text(browser, "legend").split("\n")[0] == "births"
    browser.get("about:blank")
    browser.get(pages["empirical-bayes"] + "#niche=99,1&l=77&U=x&colour=constructor")
    assert text(browser, "l-value") == "4"


def test_nothing_is_fetched(browser):
    entries = "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    assert browser.execute_script(entries) == []
