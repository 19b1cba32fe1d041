"""The explorer and the report as a reader meets them: in the system's Chromium, headless."""

import contextlib
import os
import re
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import freqid as fq
from freqid.pages.explorer import answers
from freqid.pages.explorer.bias_cells import cells_figure, cells_of, clicked
from freqid.pages.explorer.figures import left_figure
from freqid.pages.explorer.layout import layout
from freqid.pages.explorer.page import application, explore, free_port
from freqid.pages.explorer.scene import scene
from freqid.pages.explorer.state import Own, State, presets
from freqid.pages.explorer.subjects import Subjects
from freqid.pages.explorer.words import believed, sentence

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
SHOTS = Path(__file__).parents[2] / "artefacts"
# seconds, of a machine that does other things as well
PATIENCE = 60


@pytest.fixture(scope="module")
def browser():
    if not (CHROMIUM and DRIVER):
        pytest.skip("no Chromium and ChromeDriver on this machine: apt install chromium-driver")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-quic",
                 "--no-first-run", "--disable-background-networking", "--disable-sync",
                 "--disable-component-update", "--disable-dev-shm-usage",
                 "--window-size=1400,1200", "--hide-scrollbars"):  # fmt: skip
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, Service(DRIVER))
    driver.set_page_load_timeout(60)
    yield driver
    driver.quit()


@pytest.fixture(scope="module")
def address():
    """The explorer as its own process, on a port that turned out to be free."""
    taken = socket.socket()
    taken.bind(("127.0.0.1", 0))
    taken.listen()
    port = taken.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "freqid.cli", "explore", "--port", str(port)],
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    lines = []
    while not lines or "http" not in lines[-1]:
        lines.append(process.stdout.readline())
        assert process.poll() is None, lines
    assert f"port {port} is busy" in lines[0]
    url = re.search(r"http://[^ ]+", lines[-1]).group()
    for _ in range(100):
        with contextlib.suppress(OSError):
            urllib.request.urlopen(url, timeout=1).read()
            break
        time.sleep(0.1)
    yield url
    process.terminate()
    process.wait(10)
    process.stdout.close()
    taken.close()


def shot(browser, name):
    SHOTS.mkdir(exist_ok=True)
    browser.save_screenshot(str(SHOTS / f"{name}.png"))


def errors(browser):
    return [e for e in browser.get_log("browser") if e["level"] == "SEVERE"]


def until(browser, condition, what):
    for _ in range(10 * PATIENCE):
        with contextlib.suppress(Exception):
            found = browser.execute_script(condition)
            if found:
                return found
        time.sleep(0.1)
    raise AssertionError(f"waited {PATIENCE} s for {what}")


VERDICT = "return document.getElementById('verdict').textContent"
CURVE = """
const plot = document.querySelector('#bode .js-plotly-plot');
return plot.data.filter(t => !t.yaxis || t.yaxis === 'y').map(t => [t.name, Array.from(t.x), Array.from(t.y)])
"""  # noqa: E501


def notch(curve):
    f, magnitude = np.array(curve[1]), np.array(curve[2])
    inside = (f > 12) & (f < 22)
    return f[inside][magnitude[inside].argmin()]


def eventually(browser, condition, what):
    """The curves once they meet a condition: the figure follows the sentence by a moment."""
    for _ in range(10 * PATIENCE):
        curves = {c[0]: c for c in browser.execute_script(CURVE)}
        if "estimate" in curves and condition(curves):
            return
        time.sleep(0.1)
    raise AssertionError(f"waited {PATIENCE} s for {what}")


def left_notch(curves):
    return notch(curves["estimate"]) < notch(curves["true, ZOH at 0.5 ms"]) - 0.4


def together(curves):
    estimate, true = (np.array(curves[n][2]) for n in ("estimate", "true, ZOH at 0.5 ms"))
    return len(estimate) == len(true) and np.abs(estimate / true - 1).max() < 0.02


HEIGHTS = """
return [...document.querySelectorAll('.graph .main-svg')].map(e => e.getBoundingClientRect().height)
"""
SLIDERS = """
return [...document.querySelectorAll('[role=slider]')].map(
  e => [e.getAttribute('aria-label'), e.getAttribute('aria-valuetext')])
"""


def press(browser, element_id, key, count):
    from selenium.webdriver.common.by import By

    place = f"#{element_id} [role=slider]"
    until(browser, f"return document.querySelector('{place}') !== null", "the slider")
    handle = browser.find_element(By.CSS_SELECTOR, place)
    for _ in range(count):
        handle.send_keys(key)


def test_the_slider_shows_a_negative_damping_and_the_cure(browser, address):
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    browser.get(address)
    until(browser, f"{VERDICT}.startsWith('d = -2')", "the phenomenon at once")
    browser.get(address + "?factor=1")
    until(browser, f"{VERDICT}.includes('true to a tenth')", "the page")
    shot(browser, "explorer_start")
    press(browser, "factor", Keys.ARROW_RIGHT, 9)
    until(browser, f"{VERDICT}.startsWith('d = -2')", "the negative damping")
    eventually(browser, left_notch, "the notch to the left of the true one")
    shot(browser, "explorer_zoh")
    browser.find_elements(By.CSS_SELECTOR, "#hold input")[2].click()
    until(browser, f"{VERDICT}.includes('not physical') ? null : true", "the remembered hold")
    eventually(browser, together, "the curves to come together")
    shot(browser, "explorer_remembered")
    link = browser.find_element(By.ID, "link").get_attribute("href")
    assert "factor=10" in link
    assert "hold=remembered" in link
    browser.get(link)
    until(browser, "return document.getElementById('link').href.includes('hold=remembered')", "it")
    code = until(browser, "return document.getElementById('code').textContent", "the code")
    assert "decimate(10)" in code
    assert not errors(browser)


def test_the_address_follows_and_a_reload_keeps_it(browser, address):
    from selenium.webdriver.common.keys import Keys

    browser.get(address)
    until(browser, f"{VERDICT}.startsWith('d = -2')", "the page")
    press(browser, "factor", Keys.ARROW_LEFT, 3)
    until(browser, "return location.search.includes('factor=7')", "the address")
    browser.refresh()
    until(browser, "return document.getElementById('code').textContent.includes('decimate(7)')", "")


def test_who_hears_the_page_is_told_names_and_values(browser, address):
    browser.get(address)
    until(browser, f"{VERDICT}.startsWith('d = -2')", "the page")
    # the plant's sliders come with its parameters
    there = "s.every(x => x[0]) && s.some(x => x[0].startsWith('k = ')) && s"
    named = until(browser, f"const s = (() => {{{SLIDERS}}})(); return {there}", "sliders")
    told = dict(named)
    assert told["keep one sample in"] == "10"
    assert told["chirp, Hz, from"] == "10.0 Hz"
    assert told["k = 150000 N m/rad times"] == "1.00 times"
    verdict = "return document.getElementById('verdict')"
    assert browser.execute_script(f"{verdict}.getAttribute('aria-live')") == "polite"
    table = browser.execute_script("return document.getElementById('table').href")
    assert table.startswith("data:text/csv")
    assert "frequency" in table


DROP = """
const [text, name] = arguments, files = new DataTransfer();
files.items.add(new File([text], name));
const more = {dataTransfer: files, bubbles: true, cancelable: true};
document.dispatchEvent(new DragEvent('drop', more));
"""
SAID = "return document.getElementById('dropped').textContent"


def test_a_file_dropped_on_the_page_is_read_as_read_does(browser, address, slow, tmp_path):
    from selenium.webdriver.common.by import By

    browser.get(address)
    until(browser, f"{VERDICT}.startsWith('d = -2')", "the page")
    # larger than any request may be, with a decimal comma and another channel
    rows = np.column_stack([slow.time, slow.u, slow.y, slow.y**2])
    lines = "\n".join(";".join(f"{v:.17f}".replace(".", ",") for v in row) for row in rows)
    text = f"t [s];torque [N m];speed [rad/s];other\n{lines}\n{'# rest' + ' ' * 70}\n" * 1
    text += "# a long comment\n" * 70_000
    assert len(text) > 2**20
    browser.execute_script(DROP, "no table at all", "evil.html")
    until(browser, f"{SAID}.includes('no samples')", "the reason")
    browser.execute_script(DROP, text, "../my run.csv")
    until(browser, f"{SAID}.includes('name them')", "the question")
    names = browser.find_elements(By.CSS_SELECTOR, "#channels select")
    assert [n.text.split() for n in names] == [["torque", "speed", "other"]] * 2
    browser.find_element(By.CSS_SELECTOR, "#channels button").click()
    until(browser, "return location.search.includes('data=')", "its address")
    until(browser, f"{VERDICT}.includes('explained')", "the fit")
    code = browser.execute_script("return document.getElementById('code').textContent")
    assert "fq.read('my run.csv', inputs='torque', outputs='speed')" in code
    # a plant that does not fit is no good news: the samples were held for a tenth of their time
    until(browser, "return document.getElementById('verdict').className.includes('doubt')", "doubt")
    until(browser, "return document.getElementById('believed').textContent.includes('Hold')", "why")
    shot(browser, "explorer_dropped")
    browser.get(address + "?data=0123456789abcdef")
    until(browser, f"{SAID}.includes('drop it again')", "what became of it")
    assert not errors(browser)


def test_the_map_of_bias_is_clicked_into(browser, address):
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    browser.get(address)
    until(
        browser, "return document.querySelectorAll('#cells .heatmap-label text').length > 20", "map"
    )
    until(browser, "return document.getElementById('believed').textContent.includes('Hold')", "why")
    # the fourth of eight columns, the lowest of ten rows: a tenth of the map from its corner
    place = browser.find_element(By.CSS_SELECTOR, "#cells .nsewdrag")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", place)
    width, height = place.size["width"], place.size["height"]
    ActionChains(browser).move_to_element_with_offset(
        place, int(width * (3.5 / 8 - 0.5)), int(height * 0.45)
    ).click().perform()
    until(browser, "return location.search.includes('factor=5')", "the factor")
    until(browser, "return location.search.includes('hold=foh')", "the hold")
    assert not errors(browser)


@pytest.mark.parametrize("look", ["phone", "dark", "zoom"])
def test_other_screens(browser, address, look):
    size = {"phone": (390, 844), "dark": (1400, 1200), "zoom": (700, 600)}[look]
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": size[0], "height": size[1], "deviceScaleFactor": 2 if look == "zoom" else 1,
        "mobile": look == "phone"})  # fmt: skip
    scheme = "dark" if look == "dark" else "light"
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {
        "features": [{"name": "prefers-color-scheme", "value": scheme}]})  # fmt: skip
    try:
        browser.get(address + "?factor=10&hold=zoh")
        until(browser, f"{VERDICT}.startsWith('d = -2')", "the page")
        wide = browser.execute_script("return document.documentElement.scrollWidth")
        assert wide <= size[0] + 2
        until(browser, "return document.querySelectorAll('.graph .main-svg').length > 4", "figures")
        assert min(browser.execute_script(HEIGHTS)) > 300
        shot(browser, f"explorer_{look}")
        if look == "dark":
            paper = "return getComputedStyle(document.body).backgroundColor"
            assert browser.execute_script(paper) == "rgb(22, 24, 27)"
            # what is black on paper, and what sliders run on, is light on dark
            for selector, what in (("#bode .scatterlayer path.js-line", "stroke"),
                                   ("#factor .dash-slider-track", "backgroundColor"),
                                   ("#bode .xtick text", "fill")):  # fmt: skip
                script = f"return getComputedStyle(document.querySelector('{selector}')).{what}"
                found = [int(x) for x in re.findall(r"\d+", browser.execute_script(script))[:3]]
                assert sum(found) > 300, (selector, found)
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def unplug(browser, offline):
    rate = 0 if offline else -1
    conditions = {"offline": offline, "latency": 0}
    conditions |= {"downloadThroughput": rate, "uploadThroughput": rate}
    browser.execute_cdp_cmd("Network.emulateNetworkConditions", conditions)


def test_the_report_opens_offline(browser, plant, slow, tmp_path):
    est = fq.fit(plant, slow.with_noise(0.3, seed=1), hold="zoh", band=(10, 80))
    est.report(tmp_path / "report.html")
    browser.execute_cdp_cmd("Network.enable", {})
    unplug(browser, True)
    browser.get_log("browser")
    try:
        browser.get((tmp_path / "report.html").as_uri())
        until(browser, "return document.querySelectorAll('.plot .main-svg').length >= 4", "plots")
        assert "Do not use" in browser.execute_script(VERDICT)
        shot(browser, "report")
        assert not errors(browser)
    finally:
        unplug(browser, False)


def test_a_report_stays_in_order_when_narrowed_and_prints_on_two_pages(
    browser, plant, slow, tmp_path
):
    import base64

    est = fq.fit(plant, slow.with_noise(0.3, seed=1), band=(10, 80))
    est.report(tmp_path / "report.html")
    browser.get((tmp_path / "report.html").as_uri())
    until(browser, "return document.querySelectorAll('.plot .main-svg').length >= 4", "plots")
    boxes = """return [...document.querySelectorAll('.plot')].map(
        p => [p, p.querySelector('.main-svg')].map(e => e.getBoundingClientRect().height))"""
    whole = browser.execute_script(boxes)
    size = browser.get_window_size()
    try:
        browser.set_window_size(600, 1200)
        time.sleep(0.8)
        assert browser.execute_script(boxes) == whole
        assert all(box >= drawn for box, drawn in whole)
    finally:
        browser.set_window_size(size["width"], size["height"])
    paper = {"paperWidth": 8.27, "paperHeight": 11.69, "marginTop": 0.4, "marginBottom": 0.4}
    pdf = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", paper)["data"])
    assert len(re.findall(rb"/Type\s*/Page[^s]", pdf)) <= 2


def test_names_are_escaped_in_the_report(browser, tmp_path):
    evil = "<img src=x onerror=\"document.title='pwned'\">"
    model = fq.GreyBox(
        lambda **v: ([[-v[evil]]], [[v[evil]]], [[1.0]], None), [fq.Parameter(evil, 50.0)],
        inputs=[evil], outputs=["</script><script>document.title='pwned'</script>"], name=evil,
    )  # fmt: skip
    record = fq.simulate(model, fq.white_noise(500), 1e-3, input_names=model.inputs,
                         output_names=model.outputs).with_noise(0.01)  # fmt: skip
    fq.fit(model, record).report(tmp_path / "evil.html")
    browser.get((tmp_path / "evil.html").as_uri())
    until(browser, "return document.querySelectorAll('.plot .main-svg').length >= 2", "plots")
    time.sleep(0.3)
    assert "pwned" not in browser.title.replace(evil, "")
    assert browser.execute_script("return document.images.length") == 0


def test_reports_of_odd_estimates(plant, slow, tmp_path):
    import dataclasses

    est = fq.fit(plant, slow, band=(10, 80))
    broken = dataclasses.replace(est, converged=False, message="gave up")
    broken.report(tmp_path / "broken.html", title="a & b")
    text = (tmp_path / "broken.html").read_text()
    assert "Do not use these numbers" in text
    assert "a &amp; b" in text
    n = 10_000
    many = dataclasses.replace(
        est, names=[f"p{i}" for i in range(n)], values=np.ones(n), nominal=np.ones(n),
        units=[""] * n, uncertainty=np.eye(n), data=(), problem=None,
    )  # fmt: skip
    many.report(tmp_path / "many.html")
    text = (tmp_path / "many.html").read_text()
    assert "p499" in text
    assert "9500 more" in text
    nothing = fq.asymptotic_fit(plant, fq.ChirpSpectrum(10, 80), 5e-3, "zoh",
                                fq.ZeroOrderHold(0.5e-3))  # fmt: skip
    nothing.report(tmp_path / "asymptotic.html")
    assert "made without fit" in (tmp_path / "asymptotic.html").read_text()
    with pytest.raises(ValueError, match="html"):
        est.report(tmp_path / "est.pdf")


def test_states_survive_links_and_nonsense():
    state = State("first-order", 7, "foh", 2, 30, 0.05, 0.0, {"a": 1.5})
    assert State.of(state.query()) == state
    for query in (
        "?factor=1e9&hold=<script>",
        "?low=nan&high=-3",
        "?x.k=99&x.evil=2",
        "?=&&",
        None,
    ):
        odd = State.of(query)
        assert 1 <= odd.factor <= 40
        assert odd.low < odd.high
        assert "evil" not in odd.factors
        assert scene(odd).slow.n_samples > 1


def test_every_preset_and_every_code_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert len(presets()) == 10
    for state in presets().values():
        shown = scene(state)
        assert shown.estimate is not None, shown.message
        names: dict = {}
        exec(compile(state.code(), "explorer", "exec"), names)
        assert np.allclose(names["est"].values, shown.estimate.values, rtol=1e-6)
    figure4 = scene(presets()["Figure 4: the lag estimated at 50 rad/s"]).estimate
    assert figure4["b"] == pytest.approx(135.1, rel=0.01)


def test_an_own_record_takes_the_place_of_the_simulated_one():
    record = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 0.5e-3), 0.5e-3)
    import dash

    subject, state = Subjects(None, record, "").linked("")
    assert repr(record)[1:-1] in str(layout(dash, state, subject.record))
    shown = scene(State(factor=10), record)
    assert shown.slow.n_samples == 400
    assert shown.estimate["d"] < 0
    # nobody knows what is true of somebody's own record
    names = list(shown.responses)
    assert all(name.startswith(("nominal", "measured", "estimate")) for name in names)
    told = shown.responses["measured"]
    np.testing.assert_allclose(
        told.response, record_response(shown, told.omega), rtol=0.05, atol=1e-2
    )
    assert "fq.read('a.csv')" in shown.state.code(record, "fq.read('a.csv')")
    assert "simulate" not in shown.state.code(record)


def record_response(shown, omega):
    """Of the plant behind the fast hold, which is what the slow record was made by."""
    return fq.two_mass().frequency_response(omega, fq.ZeroOrderHold(0.5e-3)).response


def test_what_is_wrong_is_never_green():
    for name, state in presets().items():
        text, doubt = sentence(scene(state))
        right = name in ("Figure 5: the two-mass plant",)
        assert doubt != right, (name, text)
    text, doubt = sentence(scene(presets()["Figure 1: a lag at both rates"]))
    assert doubt
    assert "where" in text
    text, doubt = sentence(scene(State(hold="remembered", noise=0.02)))
    assert not doubt, text


def gimbal(J, k, c):
    return [[0, 1], [-k / J, -c / J]], [[0], [1 / J]], [[0.0, 1.0]], None


GIMBAL = fq.GreyBox(
    gimbal, [fq.Parameter("J", 0.02), fq.Parameter("k", 3.0), fq.Parameter("c", 0.01)]
)


def test_a_plant_of_ones_own_is_explored_where_its_modes_are():
    own = Own(GIMBAL, ("from my_plant import gimbal as own", "own"))
    state = State.first(own)
    mode = np.sqrt(3.0 / 0.02) / (2 * np.pi)
    assert state.low < mode < state.high < 0.5 / state.dt / state.factor
    shown = scene(state)
    assert shown.estimate is not None
    assert set(shown.estimate.names) == {"J", "k", "c"}
    assert State.of(state.query(), state) == state
    code = state.code()
    assert code.startswith("import freqid as fq\nfrom my_plant import gimbal as own\n")
    names = {"own": GIMBAL}
    exec(compile(code.replace(own.lines[0], ""), "explorer", "exec"), names)
    assert np.allclose(names["est"].values, shown.estimate.values, rtol=1e-6)
    moved = scene(State.of("?plant=own&x.k=2&hold=remembered", state))
    assert moved.estimate["k"] == pytest.approx(6.0, rel=1e-4)
    two = fq.GreyBox(lambda a: ([[-a]], [[1.0, 2.0]], [[1.0]], None), [fq.Parameter("a", 1.0)])
    with pytest.raises(ValueError, match="one input and one output; this one has 2 and 1"):
        application(plant=Own(two))


@pytest.mark.parametrize("dt", [1e-4, 0.01, 2.0, 60.0])
def test_own_records_of_any_rate(dt):
    u = fq.white_noise(600, seed=0)
    plant = GIMBAL.with_values(J=0.02 * (dt / 0.01) ** 2, c=0.01 * dt / 0.01)
    record = fq.simulate(plant, u, dt)
    record = record.with_noise(0.01 * record.y.std(), seed=1)
    state = State.first(Own(plant), record)
    assert 0 < state.low < state.high <= 0.5 / dt
    shown = scene(state, record)
    assert shown.estimate is not None, shown.message
    assert shown.estimate["k"] == pytest.approx(3.0, rel=0.05)
    _, high = state.band(dt, record.duration)
    assert high < 0.5 / dt
    assert shown.response is not None


def slow_record():
    """A heater's, 0.3 mHz to 0.46 Hz, 12 s late."""
    heater = fq.GreyBox(
        lambda K, tau: ([[-1 / tau]], [[K / tau]], [[1.0]], [[0.0]]),
        [fq.Parameter("K", 1.0), fq.Parameter("tau", 60.0), fq.Parameter("Td", 0.0, "s")],
        input_delay="Td",
    )
    true = heater.with_values(K=0.9, tau=180.0, Td=12.0)
    record = fq.simulate(true, np.repeat([0.0, 10.0, 4.0, 8.0], 900), 1.0)
    return heater, record.with_noise(0.02, seed=1)


def test_a_delay_that_begins_at_nothing_is_drawn():
    """The page had stayed empty: nothing is a part of it."""
    from freqid.pages.explorer.figures import bias_figure, bode_figure

    heater, record = slow_record()
    shown = scene(
        replace(State.first(Own(heater), record), factor=1, hold="remembered", high=0.05), record
    )
    bars = bias_figure(shown)["data"][0]
    assert dict(zip(bars["x"], bars["text"], strict=True))["Td"].startswith("12")
    assert np.isfinite(bars["y"]).all()
    said = re.match(r"tau = ([\d.]+) ", sentence(shown)[0])
    assert float(said[1]) == pytest.approx(180, rel=0.01)
    bode = bode_figure(shown)
    by_name = {(c["name"], c["yaxis"]): c for c in bode["data"]}
    model = by_name["estimate", "y2"]
    # model and points reach as low, lie on one another and have numbers below them
    assert model["x"][0] < 1e-3
    measured = by_name["measured", "y2"]
    low = np.array(measured["x"]) < 0.01
    along = np.interp(np.array(measured["x"])[low], model["x"], model["y"])
    assert np.abs(np.array(measured["y"])[low] - along).max() < 30
    ticks = np.array(bode["layout"]["xaxis"]["tickvals"])
    assert np.sum((ticks > 1e-4) & (ticks < 0.5)) >= 3
    reach = np.ptp(model["y"])
    assert reach / bode["layout"]["yaxis2"]["dtick"] <= 6


def test_what_breaks_behind_the_page_is_said_on_it(monkeypatch):
    app = application(fq.simulate(fq.first_order(), fq.white_noise(400), 0.01))
    monkeypatch.setattr(answers, "believed", lambda shown: 1 / 0)
    key = next(name for name in app.callback_map if "believed" in name)
    asked = {
        "output": key,
        "outputs": [{"id": "believed", "property": "children"},
                    {"id": "verdict", "property": key.rpartition("verdict.")[2].strip(".")}],
        "inputs": [{"id": "settled", "property": "data", "value": "?factor=1"}],
        "changedPropIds": ["settled.data"], "state": [],
    }  # fmt: skip
    reply = app.server.test_client().post(
        "/_dash-update-component", json=asked, headers={"Host": "127.0.0.1"}
    )
    assert reply.status_code == 200
    assert "division by zero" in reply.json["sideUpdate"]["verdict"]["children"]


def test_a_record_of_two_outputs_says_what_is_drawn():
    from freqid.pages.explorer.figures import bias_figure, bode_figure, nyquist_figure, time_figure

    u = fq.white_noise(400, seed=0)
    record = fq.Record(u, np.column_stack([u, 2 * u]), 0.01)
    shown = scene(State.first(None, record), record)
    text, doubt = sentence(shown)
    assert doubt
    assert "1 inputs and 2 outputs" in text
    for figure in (bias_figure, bode_figure, nyquist_figure, time_figure):
        assert "layout" in figure(shown)


def test_a_remembered_hold_is_not_drawn_in_the_slow_steps():
    from freqid.pages.explorer.figures import time_figure

    fast = fq.simulate(fq.two_mass(), fq.chirp(10, 80, 2, 0.5e-3), 0.5e-3)
    slow = fast.decimate(10)
    shown = scene(State.first(None, slow), slow)
    names = [part["name"] for part in time_figure(shown)["data"]]
    assert "as the converter held it" not in names
    assert "nominal, ZOH at 0.5 ms" in shown.responses
    assert time_figure(scene(State.first(None, fast), fast))["data"][0]["line"]["shape"] == "hv"


def test_a_record_of_one_sample_is_no_crash():
    from freqid.pages.explorer.figures import bias_figure, bode_figure, nyquist_figure, time_figure

    tiny = fq.Record([1.0], [2.0], dt=0.01)
    assert "1" in tiny._repr_html_()
    assert fq.check_record(tiny)["finding"].tolist() == ["constant", "constant"]
    for state in (State(), State(factor=10, hold="remembered")):
        shown = scene(state, tiny)
        assert shown.estimate is None
        assert shown.message
        for figure in (bias_figure, bode_figure, nyquist_figure, time_figure):
            assert "layout" in figure(shown)


def test_only_loopback_unless_told_otherwise():
    with pytest.raises(ValueError, match="allow-remote"):
        explore(host="0.0.0.0")
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert free_port("127.0.0.1", port) > port


def test_a_setting_is_worked_out_once(monkeypatch):
    """The page asks for its first one as it opens, after the server has begun with it."""
    asked = []

    def counted(state, record=None):
        asked.append(state.factor)
        return scene(state, record)

    monkeypatch.setattr(answers, "scene", counted)
    known, begin = answers.Answers(Subjects(None, None, "")), State.first()
    first = known.of(begin)
    assert known.of(replace(begin, factor=5)) != first
    assert known.of(begin) == first
    assert asked == [begin.factor, 5]


def test_settings_are_forgotten_one_by_one(monkeypatch):
    monkeypatch.setattr(answers, "_KEPT", 2)
    known = answers.Answers(Subjects(None, None, ""))
    worked = []
    monkeypatch.setattr(known, "_worked_out", lambda state: worked.append(state.factor) or ())
    for factor in (2, 3, 2, 4, 2, 3):
        known.of(replace(State.first(), factor=factor))
    assert worked == [2, 3, 4, 3]


def test_the_map_of_bias_is_that_of_bias_map():
    state = State.first()
    cells = cells_of(state, None)
    table = fq.bias_map(fq.two_mass(), {"": fq.ChirpSpectrum(10, 80)}, cells.factors,
                        ["zoh", "foh"], 0.5e-3, progress=False)  # fmt: skip
    for (hold, name), errors in zip(cells.rows, cells.errors, strict=True):
        own = table[(table["hold"] == hold) & (table["parameter"] == name)]
        assert np.allclose(own.sort_values("factor")["relative_bias"], errors)
    figure = cells_figure(cells, state)
    assert len(figure["layout"]["shapes"]) == 1
    assert cells_figure(cells, replace(state, sine=8.0))["data"] == []
    point = {"points": [{"x": "1 in 5", "y": "FOH: d"}]}
    assert (clicked(state, point).factor, clicked(state, point).hold) == (5, "foh")
    odd_points = [
        {"x": "1 in 6", "y": "ZOH: d"},
        {"x": 5, "y": None},
        {"x": ["1 in 5"], "y": "FOH"},
    ]
    for odd in (None, {}, {"points": 3}, {"points": []}, *({"points": [p]} for p in odd_points)):
        assert clicked(state, odd) == state


def test_the_map_of_a_record_holds_inputs_as_its_converter_did(slow):
    state = State.first(None, slow)
    cells = cells_of(state, slow)
    exact = fq.asymptotic_fit(
        fq.two_mass(), fq.ChirpSpectrum(state.low, state.high), 5e-3, "zoh",
        fq.ZeroOrderHold(0.5e-3),
    )  # fmt: skip
    row = cells.rows.index(("zoh", "d"))
    assert cells.errors[row][0] == pytest.approx(exact["d"] / 10 - 1, rel=1e-3)


def test_what_is_left_is_drawn_and_believed_as_the_verdict_says(slow):
    noisy = slow.with_noise(0.5, seed=2)
    state = State.first(None, noisy)
    shown = scene(state, noisy)
    measured, left = left_figure(shown)["data"]
    level = 2 * 0.5 * np.sqrt(1 / noisy.n_samples)
    assert np.median(left["y"]) == pytest.approx(level, rel=0.5)
    assert max(measured["y"]) > 20 * level
    said, trusted = believed(shown)
    assert trusted == shown.estimate.verdict.trusted
    assert shown.estimate.witness.sentence in said[-1]
    wrong = scene(replace(state, hold="zoh"), noisy)
    assert not believed(wrong)[1]
