"""The explorer as people use it: in Chromium, over its server, with a scene and readings of their own.

One server and one browser serve the whole file, each test a page. The light is the closed form (nothing is
traced): a constant background is in the readings, and not in the scene.
"""

from __future__ import annotations

import re

import pytest
from explored import PATIENCE_MS, error, needs_browser, rest, until_error


@needs_browser
def test_an_effect_is_switched_on_and_the_error_falls(page) -> None:
    rest(page)
    before = error(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 0.5 * before)
    page.locator("#ladder li[aria-current]", has_text=f"{after:.1f} %").wait_for()
    assert page.locator("#ladder li").count() == 2
    page.get_by_role("button", name="Undo").click()
    until_error(page, 1.01 * before, 0.99 * before)
    page.keyboard.press("Control+y")
    until_error(page, 0.5 * before)
    page.locator("#ladder button").first.click()
    until_error(page, 1.01 * before, 0.99 * before)


@needs_browser
def test_a_slider_is_dragged_by_mouse_and_by_keyboard(page) -> None:
    rest(page)
    before = error(page)
    slider = page.get_by_role("slider", name="absorption in 1/m")
    box = slider.bounding_box()
    page.mouse.move(box["x"] + 0.2 * box["width"], box["y"] + box["height"] / 2)
    page.mouse.down()
    for k in range(12):
        page.mouse.move(box["x"] + (0.2 + 0.06 * k) * box["width"], box["y"] + box["height"] / 2)
    page.mouse.up()
    dragged = until_error(page, 1e6, 1.2 * before)
    page.locator("#ladder li[aria-current]", has_text="by hand").wait_for()
    slider.focus()
    page.keyboard.press("PageUp")
    page.keyboard.press("PageUp")
    until_error(page, 1e6, 1.001 * dragged)
    page.get_by_role("button", name="Fit these").click()
    until_error(page, 1.01 * before)


@needs_browser
def test_a_number_is_typed_as_people_write_it_or_is_refused(page) -> None:
    """A comma is a point (it was left out: ten times as much); what is none leaves the value that counts."""
    rest(page)
    before = error(page)
    field = page.get_by_label("absorption, value")
    shown = field.input_value()
    for wrong in ("NaN", "-", "1e400", "much", ""):
        field.fill(wrong)
        field.press("Tab")
        page.get_by_text("is no number; nothing was changed").wait_for()
        assert field.input_value() == shown and error(page) == before
    field.fill("0,2")
    field.press("Tab")
    until_error(page, 1e6, 1.05 * before)
    assert field.input_value() == "0.2"
    page.get_by_role("button", name="Undo").click()
    until_error(page, 1.01 * before, 0.99 * before)
    assert field.input_value() == shown


@needs_browser
def test_numbers_and_ticks_of_any_size_can_be_read(still) -> None:
    told = still.evaluate("[1.3e29, 2e4, 12.34].map(LF.percent)")
    assert told == ["1.3e+29 %", "20000 %", "12.3 %"]
    for reach in (4, 4.01, 4.5, 4.99, 6, 30):
        ticks = still.evaluate(f"LF.ticks(-{reach}, {reach}, 4)")
        assert len(ticks) >= 3 and max(map(abs, ticks)) <= reach
    assert still.evaluate("LF.number(LF.over(null, 30))") == "–"


@needs_browser
def test_the_wavelength_that_is_named_is_the_one_that_is_shown(still) -> None:
    """Also in a page that was loaded again, and where the experiment is told anew: it was the first one."""
    still.evaluate(
        """() => {
            LF.showExperiment({ ...LF.experiment, wavelengths_nm: [450, 550] });
            LF.showState({ ...LF.state, channel: 1 });
            LF.showExperiment(LF.experiment);
        }"""
    )
    assert still.evaluate("LF.$('channel').value") == "1"


@needs_browser
def test_a_page_that_is_loaded_again_is_where_it_was(page) -> None:
    rest(page)
    before = error(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 0.5 * before)
    page.reload()
    page.locator('html[data-maps="ready"]').wait_for()
    assert error(page) == after
    assert page.get_by_role("checkbox", name="background", exact=True).is_checked()


@needs_browser
def test_a_lost_connection_comes_back_with_its_state(page) -> None:
    rest(page)
    page.get_by_role("checkbox", name="background", exact=True).check()
    after = until_error(page, 4)
    painted = int(page.locator("html").get_attribute("data-painted"))
    page.evaluate("() => window.dispatchEvent(new Event('online'))")  # as after a sleep: the line is dropped
    page.locator("#connection.lost").wait_for(state="detached")
    for _ in range(PATIENCE_MS // 20):
        if int(page.locator("html").get_attribute("data-painted")) > painted:
            break
        page.wait_for_timeout(20)
    assert error(page) == after


@needs_browser
def test_all_is_done_by_keyboard(page) -> None:
    """No mouse: the first Tab enters the page, and every control is reached, named, and does its work."""
    rest(page)
    page.reload()
    page.locator('html[data-maps="ready"]').wait_for()
    before, seen = error(page), dict[str, str]()
    for _ in range(200):
        page.keyboard.press("Tab")
        hold, name = page.evaluate(
            """() => { const e = document.activeElement;
                return [e.dataset.hold || e.id || e.closest('[id]')?.id || e.tagName,
                    e.getAttribute('aria-label') || e.labels?.[0]?.textContent || e.textContent || '']; }"""
        )
        if hold == "BODY":
            break
        seen[hold] = name
    wanted = {"history-menu", "save-menu", "fit", "diagnose", "slider-gain", "effect-background", "planes",
              "map-render", "log", "profile-axis", "ladder", "residual-axis"}  # fmt: skip
    assert wanted <= seen.keys(), wanted - seen.keys()
    assert all(name.strip() for name in seen.values())

    page.get_by_role("checkbox", name="background", exact=True).focus()
    page.keyboard.press("Space")
    after = until_error(page, 0.5 * before)
    held = "() => document.activeElement.getAttribute('aria-label')"
    assert page.evaluate(held) == "background", "the focus stays where it was"
    page.locator("#ladder button").first.focus()
    page.keyboard.press("Enter")
    until_error(page, 1.01 * before, 0.99 * before)
    page.keyboard.press("Control+z")
    until_error(page, 1.01 * after)
    page.get_by_role("slider", name="half width in deg").focus()
    page.keyboard.press("PageUp")
    until_error(page, 1e6, 1.01 * after)
    page.locator("#map-render").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#cursor").inner_text().startswith("x ")
    # The plane of the scene, 2 m wide: to the edges of its outer cells.
    said = page.locator("#map-said").inner_text()
    assert "x from −1.00 to 1.00 m, y from −1.00 to 1.00 m. Formula over render: " in said
    page.locator("#save-menu > summary").focus()
    page.keyboard.press("Enter")
    page.get_by_role("link", name="Scene (TOML)").wait_for()
    page.keyboard.press("Escape")
    assert not page.get_by_role("link", name="Scene (TOML)").is_visible()


@needs_browser
def test_roles_and_labels_say_what_is_where(still) -> None:
    for name in ("Model", "Light", "Error ladder"):
        assert still.get_by_role("region", name=name, exact=True).count() == 1
    slider = still.get_by_role("slider", name="half width in deg")
    assert re.match(r"[\d.]+ deg", slider.get_attribute("aria-valuetext"))
    assert re.match(r"[\d.]+ to [\d.]+ deg", slider.get_attribute("title"))
    assert still.get_by_role("status").first.is_visible()
    for name in ("Readings, model and formula along x", "on the axis", "Residuals in sigma over"):
        assert still.get_by_role("img", name=name).count() == 1


#: Contrast of every text that is seen against what lies behind it (WCAG 2.2, relative luminance).


CONTRAST = """() => {
    const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
    const part = (v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4;
    const light = ([r, g, b]) => 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
    const behind = (e) => {
        for (; e; e = e.parentElement) {
            const c = rgb(getComputedStyle(e).backgroundColor);
            if (c.length === 3 || c[3] > 0.5) return c;
        }
        return [255, 255, 255];
    };
    const poor = [];
    for (const e of document.querySelectorAll('body *')) {
        const own = [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
        if (!own || !e.getClientRects().length || e.disabled || e.closest(':disabled')) continue;
        const style = getComputedStyle(e), ink = rgb(e instanceof SVGElement ? style.fill : style.color);
        const [a, b] = [light(ink), light(behind(e))].sort((x, y) => y - x);
        const large = parseFloat(style.fontSize) >= 24;
        const contrast = (a + 0.05) / (b + 0.05), words = e.textContent.trim().slice(0, 40);
        if (contrast < (large ? 3 : 4.5)) poor.push(`${words}: ${contrast.toFixed(2)}`);
    }
    return [light(behind(document.body)), poor];
}"""


@needs_browser
def test_dark_and_light_can_both_be_read(still) -> None:
    still.get_by_role("checkbox", name="background", exact=True).check()
    still.locator("#ladder li").nth(1).wait_for()
    paper = {}
    for scheme in ("light", "dark"):
        still.emulate_media(color_scheme=scheme)
        paper[scheme], poor = still.evaluate(CONTRAST)
        assert poor == [], scheme
    assert paper["light"] > 0.9 and paper["dark"] < 0.05


@needs_browser
def test_nothing_moves_for_whoever_asked_for_that(page) -> None:
    moving = """() => { LF.$('job').hidden = LF.$('job-moving').hidden = false;
        return document.getAnimations().length; }"""
    page.emulate_media(reduced_motion="no-preference")
    assert page.evaluate(moving) > 0
    page.emulate_media(reduced_motion="reduce")
    assert page.evaluate(moving) == 0


@needs_browser
def test_everything_fits_the_window_and_has_a_name(still) -> None:
    for width in (1300, 420):
        still.set_viewport_size({"width": width, "height": 800})
        assert still.evaluate("() => document.documentElement.scrollWidth <= window.innerWidth")
    nameless = still.evaluate(
        """() => [...document.querySelectorAll('input, select, textarea, button, canvas, a')].filter((e) =>
            e.offsetParent !== null && !e.getAttribute('aria-label') && !e.textContent.trim()
            && !(e.labels && e.labels.length && e.labels[0].textContent.trim())).map((e) => e.outerHTML)"""
    )
    assert nameless == []


@needs_browser
def test_maps_have_the_shape_of_the_plane(page) -> None:
    """In a tank half as deep as wide a round beam looks round."""
    shape = page.evaluate("""() => {
      const e = LF.experiment, box = () => LF.$("map-formula").getBoundingClientRect();
      const paint = () => LF.paintMaps(null, LF.shown.map_formula || null, e.map_x_m.length, true);
      paint();
      const square = box().width / box().height;
      e.map_y_m = e.map_y_m.map((y) => y / 2);
      paint();
      return [square, box().width / box().height];
    }""")
    assert shape == [pytest.approx(1.0, abs=0.02), pytest.approx(2.0, abs=0.04)]


@pytest.mark.parametrize(
    ("error", "chi2", "met"),
    [(2.1, 1.1, True), (2.1, 9.0, False), (2.5, 1.1, False), (2.1, None, False), (None, 1.1, False)],
)
def test_an_error_below_the_floor_is_met_where_chi_square_is_noise_too(
    still, error: float | None, chi2: float | None, met: bool
) -> None:
    """The floor in per cent is that of the dim readings, below which bright ones may be missed by far."""
    assert still.evaluate("([error, chi2]) => LF.met(error, 2.0, chi2)", [error, chi2]) is met
