"""The page as a browser runs it."""

import shutil

import numpy as np
import pytest

import nichechain as nc
from nichechain.evolvability.coverage import expected_coverage, visit_probabilities
from nichechain.plots.explorer import rounded_transition, write_explorer

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
    transition = rounded_transition(chain).toarray()
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
    for lineages in (1, 50, 10_000):
        covered = chromium.execute_script(
            "return explorer.coverage(explorer.visitProbabilities(20)[3], arguments[0])", lineages
        )
        expected = expected_coverage(transition, transition[[20]], 4, lineages, counted=n)[0]
        assert covered == pytest.approx(expected, rel=1e-10)


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
    assert text(browser, "interval") == f"{value:.1f} ({low:.1f} to {high:.1f})"
    chain = archive.chain()
    plug_in = expected_coverage(chain.T, chain.T[[elite.state]], 4, 50, counted=len(archive.niches))[0]
    assert text(browser, "plug-in") == f"{plug_in:.1f}"
    assert text(browser, "plug-in-title") == "plug-in"


def test_sliders_count_again(browser, archive):
    rectangle(browser, archive, (3, 4)).click()
    state = archive.niches.flat((3, 4))
    chain = archive.chain()
    for l in (1, 9):
        slide(browser, "l", l)
        expected = expected_coverage(chain.T, chain.T[[state]], l, 50, counted=len(archive.niches))[0]
        assert text(browser, "plug-in") == f"{expected:.1f}"
    slide(browser, "u", 0)
    assert text(browser, "u-value") == "1"
    assert text(browser, "interval") == "not for U = 1"


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
    before = cell.rect["width"]
    browser.find_element("id", "zoom-in").click()
    assert cell.rect["width"] == pytest.approx(1.5 * before, rel=0.02)
    at = cell.rect["y"]
    heading = text(browser, "niche")
    ActionChains(browser).move_to_element(cell).click_and_hold().move_by_offset(0, 30).release().perform()
    assert cell.rect["y"] == pytest.approx(at + 30, abs=1)
    assert text(browser, "niche") == heading
    browser.find_element("id", "zoom-all").click()
    assert cell.rect["width"] == pytest.approx(before, rel=0.01)


def test_colours_and_theme(browser, archive):
    cell = rectangle(browser, archive, (3, 4))
    seen = set()
    for option in browser.find_elements("css selector", "#colour option"):
        slide(browser, "colour", option.get_attribute("value"))
        seen.add((cell.value_of_css_property("fill"), text(browser, "legend").split("\n")[0]))
    assert len({words for _, words in seen}) == 8
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
