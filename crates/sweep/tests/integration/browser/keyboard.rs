//! Use by keyboard only, with keys as the browser receives them.

use super::chromium::{Browser, Page, WINDOWS};
use super::{COMPUTED, page_of};
use serde_json::Value;

/// Presses Tab until the focus is on the element of a selector, which must show its focus.
fn tab_to(page: &mut Page<'_>, selector: &str) {
    let script = format!("!!document.activeElement?.matches({selector:?})");
    for _ in 0..150 {
        page.press("Tab");
        if page.value(&script) == true {
            let shown = page.value(
                "(() => { const e = document.activeElement; return e.matches(':focus-visible') && getComputedStyle(e).outlineStyle !== 'none'; })()",
            );
            assert_eq!(shown, true, "the focus on {selector} is not seen");
            return;
        }
    }
    assert_eq!(page.value(&script), true, "Tab does not lead to {selector}");
}

fn text(page: &mut Page<'_>, id: &str) -> String {
    let script = format!("document.getElementById({id:?}).textContent");
    page.value(&script).as_str().unwrap().to_owned()
}

fn count(page: &mut Page<'_>, selector: &str) -> u64 {
    let script = format!("document.querySelectorAll({selector:?}).length");
    page.value(&script).as_u64().unwrap()
}

/// Waits until a script returns true.
fn until(page: &mut Page<'_>, script: &str) {
    let waiting = format!(
        "(async () => {{ for (let n = 0; n < 1200; n++) {{ if ({script}) return true; await new Promise(done => setTimeout(done, 50)); }} return false; }})()"
    );
    assert_eq!(page.value(&waiting), true, "{script}");
}

#[test]
fn everything_is_reached_and_done_with_keys_alone() {
    let Some(mut browser) = Browser::start("everything_is_reached_and_done_with_keys_alone") else {
        return;
    };
    let folder = COMPUTED.folder();
    let address = page_of(folder.path(), &[]);
    for window in WINDOWS {
        let mut page = browser.open(&address, window);
        for part in [figures, movie, table] {
            part(&mut page);
        }
        // No control was skipped: from the end Tab cycles, and visits each once.
        let missed = passed_over(&mut page);
        assert_eq!(missed, [""; 0], "{window:?}");
        assert_eq!(page.requests(), [address.as_str()]);
        assert_eq!(page.errors(), [""; 0]);
        page.close();
    }
}

/// Figure and axis.
fn figures(page: &mut Page<'_>) {
    let drawn = |page: &mut Page<'_>, word: &str| {
        let script =
            format!("decodeURIComponent(document.getElementById('plot').src).includes({word:?})");
        until(page, &script);
    };
    drawn(page, "shear rate Γ");
    tab_to(page, "#figure");
    page.press("ArrowDown");
    drawn(page, "viscous number J");
    page.press("ArrowDown");
    drawn(page, "slipping");
    page.press("ArrowUp");
    page.press("ArrowUp");
    tab_to(page, "#along");
    page.press("ArrowDown");
    drawn(page, ">friction coefficient ν<");
    tab_to(page, "#save-plot");
}

/// Shows the runs of the fifth point; plays, scrubs and colours the layer of the second seed.
fn movie(page: &mut Page<'_>) {
    tab_to(page, "#points [data-index='4']");
    page.press("Enter");
    until(page, "!document.getElementById('movie').hidden");
    assert!(text(page, "point").contains("Γ = 1"));
    tab_to(page, "[aria-label='play the movie of seed 2']");
    page.press("Enter");
    until(
        page,
        "document.getElementById('movie-name').textContent.endsWith('seed 2')",
    );
    until(page, "+document.getElementById('scrub').value > 0");
    tab_to(page, "#play");
    page.press(" ");
    tab_to(page, "#scrub");
    page.press("Home");
    for _ in 0..4 {
        page.press("ArrowRight");
    }
    assert_eq!(page.value("document.getElementById('scrub').value"), "4");
    tab_to(page, "#paint");
    page.press("ArrowDown");
    assert!(text(page, "meaning").starts_with("contact forces"));
}

/// The table scrolls, and has the columns that are chosen.
fn table(page: &mut Page<'_>) {
    tab_to(page, "#points-box");
    if page.value("!document.getElementById('cue').hidden") == true {
        for _ in 0..8 {
            page.press("ArrowRight");
        }
        until(page, "document.getElementById('points-box').scrollLeft > 0");
    }
    let heads = count(page, "#points th");
    tab_to(page, "details:has(#columns) summary");
    page.press("Enter");
    tab_to(page, "[data-column=n1]");
    page.press(" ");
    assert_eq!(count(page, "#points th"), heads + 1);
    tab_to(page, "details:has(#text) summary");
    page.press(" ");
    tab_to(page, "#text");
}

/// Controls that Tab does not reach.
fn passed_over(page: &mut Page<'_>) -> Vec<String> {
    page.value(
        "window.usable = [...document.querySelectorAll('select, button, input, summary, pre, a[href], .scroll')]
            .filter(e => e.checkVisibility() && e.tabIndex >= 0 && e.id !== 'run-list'); 0",
    );
    for _ in 0..200 {
        page.press("Tab");
        page.value("usable = usable.filter(e => e !== document.activeElement); 0");
    }
    let left = page.value("usable.map(e => e.outerHTML.slice(0, 80))");
    let left = left.as_array().unwrap().iter();
    left.map(Value::to_string).collect()
}
