//! The phase map of the page: marks of its cells, one map per value of a third axis, and the
//! numbers of each plot.

use super::chromium::{Browser, WINDOWS};
use super::views::seen_by;
use super::{CAMPAIGN, COMPUTED, page_of};
use crate::harness::{fail, folder, json, spoil, sweep};

/// A user of the phase map: mark and tooltip of each cell.
const MAPPER: &str = r"
pick('view', 'map');
seen.dark = matchMedia('(prefers-color-scheme: dark)').matches;
seen.cells = [...document.querySelectorAll('#plot .cell')].map(cell => {
  const box = cell.querySelector('rect').getBoundingClientRect(), marks = [...cell.querySelectorAll('.jammed, .failed')];
  const inside = mark => { const own = mark.getBoundingClientRect(); return own.width > 4 && own.left >= box.left && own.right <= box.right && own.top >= box.top - 1 && own.bottom <= box.bottom + 1; };
  const apart = marks.length < 2 || marks[0].getBoundingClientRect().right <= marks[1].getBoundingClientRect().left;
  return { text: cell.getAttribute('aria-label'), jammed: !!cell.querySelector('.jammed'), failed: !!cell.querySelector('.failed'), empty: !!cell.querySelector('.empty'), inside: marks.every(inside), apart };
});
const csv = saved(); $('save-csv').click();
seen.csv = text_of((await csv).address);
$('plot').scrollIntoView();
const cell = [...document.querySelectorAll('#plot .cell')].find(cell => cell.querySelector('.jammed'));
const box = cell.querySelector('.jammed').getBoundingClientRect();
seen.mark = [box.left + box.width / 2, box.top + box.height / 2, innerWidth];
pick('view', 'curve');
seen.lost = all('.lost');
pick('view', 'map'); $('plot').scrollIntoView();
";

#[test]
fn the_phase_map_marks_what_jammed_and_what_failed() {
    let Some(mut browser) = Browser::start("the_phase_map_marks_what_jammed_and_what_failed")
    else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    // At ν = 0.3: of Γ = 0.1 a run jammed, of Γ = 1 one jammed and one failed, of Γ = ∞ both
    // failed.
    let at_rate = |rate: &str| format!("friction > 0.2 AND shear_rate = {rate}");
    fail(
        at,
        &format!(
            "({} AND seed = 2) OR ({})",
            at_rate("1.0"),
            at_rate("9e999")
        ),
    );
    spoil(
        at,
        "UPDATE cases SET state = 'jammed' WHERE seed = 1
             AND point IN (SELECT id FROM axes WHERE friction > 0.2 AND shear_rate < 2);
         UPDATE results SET jammed_strain = 0.01 WHERE case_id IN (SELECT id FROM cases WHERE state = 'jammed')",
    );
    let report = json(at, &["report", "s.sqlite"]);
    assert_eq!(report["cases"]["jammed"], 2);
    assert_eq!(report["cases"]["failed"], 3);
    let address = page_of(at, &[]);
    for window in WINDOWS {
        let mut page = browser.open(&address, window);
        let seen = seen_by(&mut page, MAPPER);
        assert_eq!(seen["dark"], window.1);
        let cells = seen["cells"].as_array().unwrap();
        assert_eq!(cells.len(), 6);
        for cell in cells {
            let text = cell["text"].as_str().unwrap();
            let is = |name: &str| cell[name].as_bool().unwrap();
            let at =
                |rate: &str| text.contains("ν = 0.3") && text.contains(&format!("Γ = {rate},"));
            let wanted = [at("0.1") || at("1"), at("1") || at("∞"), at("1") || at("∞")];
            let found = [is("jammed"), is("failed"), is("empty")];
            assert_eq!(found, wanted, "{window:?}: {text}");
            assert!(is("inside") && is("apart"), "{window:?}: {cell}");
            assert_eq!(text.contains("jammed"), wanted[0], "{text}");
            assert_eq!(text.contains("failed"), wanted[1], "{text}");
        }
        let csv = seen["csv"].as_str().unwrap();
        assert!(csv.contains("1,0.3,,0,1,1"), "{csv}");
        // A point all of whose runs failed or jammed has a cross on the axis of the curves.
        assert_eq!(seen["lost"], 2);
        // The cross is seen: its middle has another colour than the cell beside it.
        let [x, y, width] = [0, 1, 2].map(|place| seen["mark"][place].as_f64().unwrap());
        let pixels = page.pixels();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "places in a window"
        )]
        let dot = |x: f64, y: f64| pixels[y as usize * width as usize + x as usize];
        let apart = |a: [u8; 3], b: [u8; 3]| {
            let each = a.iter().zip(b).map(|(a, b)| a.abs_diff(b));
            each.max().unwrap()
        };
        let difference = apart(dot(x, y), dot(x + 14.0, y));
        assert!(difference > 60, "{window:?}: {difference}");
        assert_eq!(page.requests(), [address.as_str()]);
        assert_eq!(page.errors(), [""; 0]);
        page.close();
    }
}

/// A user who reads maps of a campaign with three axes, and the numbers of each plot in place of
/// its picture.
const MULTIPLE: &str = r"
const numbers = id => { $(id).open = true; $(id).dispatchEvent(new Event('toggle')); return [...document.querySelectorAll(`#${id} tr`)].map(row => row.textContent); };
pick('view', 'map'); pick('map-x', 'shear_rate'); pick('map-y', 'friction');
seen.maps = [...document.querySelectorAll('#plot .map')].map(map => map.lastElementChild.textContent);
seen.cells = all('.cell');
seen.texts = [...document.querySelectorAll('#plot .cell')].map(cell => cell.getAttribute('aria-label'));
seen.inside = [...document.querySelectorAll('#plot .map, #plot .cell')].every(part => { const own = part.getBoundingClientRect(), box = $('plot').getBoundingClientRect(); return own.left >= box.left - 1 && own.right <= box.right + 1 && own.bottom <= box.bottom + 1; });
seen.map_numbers = numbers('plot-numbers');
const filter = document.querySelector('#filters [data-axis=area_fraction]');
filter.value = '0.65'; filter.dispatchEvent(new Event('change'));
seen.one = [all('.map'), all('.cell')];
seen.rows = {};
for (const view of ['curve', 'flow', 'contacts', 'histogram', 'versus']) {
  pick('view', view);
  const csv = saved(); $('save-csv').click();
  seen.rows[view] = [numbers('plot-numbers').length, text_of((await csv).address).trimEnd().split('\n').length];
}
pick('view', 'curve');
document.querySelector('#plot .point').dispatchEvent(new MouseEvent('click', { bubbles: true }));
seen.trace = [numbers('trace-numbers').length, $('trace').getAttribute('aria-label'), $('trace').getAttribute('aria-details')];
seen.described = [...document.querySelectorAll('svg[id], canvas')].every(plot => plot.getAttribute('aria-label') && (plot.id === 'layer' || $(plot.getAttribute('aria-details'))));
";

#[test]
fn maps_of_three_axes_are_small_multiples_and_plots_have_their_numbers() {
    let test = "maps_of_three_axes_are_small_multiples_and_plots_have_their_numbers";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let campaign = CAMPAIGN
        .replace("area_fraction = 0.65", "area_fraction = [0.5, 0.65]")
        .replace("seeds = 2", "seeds = 1");
    let folder = folder("t.toml", &campaign);
    let at = folder.path();
    sweep(at, &["run", "t.toml", "--store", "s.sqlite", "-q"]);
    let address = page_of(at, &[]);
    for window in WINDOWS {
        let mut page = browser.open(&address, window);
        let seen = seen_by(&mut page, MULTIPLE);
        assert_eq!(seen["maps"], serde_json::json!(["c = 0.5", "c = 0.65"]));
        assert_eq!(
            (&seen["cells"], &seen["inside"]),
            (&12.into(), &true.into())
        );
        let texts = seen["texts"].as_array().unwrap();
        for (n, text) in texts.iter().map(|text| text.as_str().unwrap()).enumerate() {
            assert!(!text.contains("mean of"), "{text}");
            assert!(
                text.contains(if n < 6 { "c = 0.5" } else { "c = 0.65" }),
                "{text}"
            );
        }
        assert_eq!(seen["map_numbers"].as_array().unwrap().len(), 13);
        assert_eq!(seen["one"], serde_json::json!([1, 6]));
        for (view, rows) in seen["rows"].as_object().unwrap() {
            assert!(
                rows[0] == rows[1] && rows[0].as_u64().unwrap() > 2,
                "{view}: {rows}"
            );
        }
        assert!(seen["trace"][0].as_u64().unwrap() > 2, "{}", seen["trace"]);
        assert!(
            seen["trace"][1]
                .as_str()
                .unwrap()
                .contains("1 run at c = 0.5")
        );
        assert_eq!(seen["described"], true);
        assert_eq!(page.errors(), [""; 0]);
        page.close();
    }
}
