//! The views of the page, by their elements and, as saved pictures, by their pixels.

use super::chromium::{Browser, DEFAULT, Page, WINDOWS, Window};
use super::{CAMPAIGN, COMPUTED, page_of};
use crate::harness::{fail, folder, json, spoil, sweep};
use serde_json::Value;
use sweep::text::format::{NumberFormat, uncertain};

/// Helpers for every user of the page.
const COMMON: &str = r"
const seen = {}, $ = id => document.getElementById(id);
const until = async test => { for (let n = 0; n < 1200; n++) { if (test()) return; await new Promise(done => setTimeout(done, 50)); } throw new Error('waited for ' + test); };
const pick = (id, value) => { $(id).value = value; $(id).dispatchEvent(new Event('change')); };
const saved = () => new Promise(done => document.addEventListener('saved', event => done(event.detail), { once: true }));
const text_of = address => decodeURIComponent(address.split(',').slice(1).join(','));
const all = selector => document.querySelectorAll('#plot ' + selector).length;
const is_wide = () => document.documentElement.scrollWidth > document.documentElement.clientWidth;
/* Colours of a picture that cover at least some dots. */
const colours = async address => {
  const image = new Image();
  await new Promise((done, failed) => { image.onload = done; image.onerror = failed; image.src = address; });
  const canvas = document.createElement('canvas'); canvas.width = image.width; canvas.height = image.height;
  const pen = canvas.getContext('2d'); pen.drawImage(image, 0, 0);
  const dots = pen.getImageData(0, 0, canvas.width, canvas.height).data, counts = new Map();
  for (let i = 0; i < dots.length; i += 4) { const key = (dots[i] << 16) + (dots[i + 1] << 8) + dots[i + 2]; counts.set(key, (counts.get(key) ?? 0) + 1); }
  return [...counts].filter(([, n]) => n > 150).map(([key]) => '#' + key.toString(16).padStart(6, '0'));
};
";

/// The visible content of a page.
pub(super) fn seen_by(page: &mut Page<'_>, user: &str) -> Value {
    page.value(&format!(
        "(async () => {{ {COMMON} {user}; return seen; }})()"
    ))
}

/// A user: hovers, chooses, hides a curve, plays, scrubs.
const USER: &str = r"
const points = () => [...document.querySelectorAll('#plot .point')];
seen.points = points().length;
seen.curves = all('.curve');
points()[4].dispatchEvent(new MouseEvent('mouseenter'));
seen.tip = $('tip').textContent; seen.shown = !$('tip').hidden;
points()[1].dispatchEvent(new MouseEvent('click', { bubbles: true }));
await until(() => !$('movie').hidden);
seen.traces = document.querySelectorAll('#trace .run').length;
const pixels = () => $('layer').toDataURL(), before = pixels();
$('play').click(); await until(() => +$('scrub').value > 0); $('play').click();
seen.moved = pixels() !== before;
$('scrub').value = 3; $('scrub').dispatchEvent(new Event('input'));
seen.strain = $('strain').textContent;
$('legend').querySelector('button').click();
seen.after_hiding = all('.curve');
pick('along', 'friction');
seen.along_friction = all('.curve');
seen.wide = is_wide();
";

#[test]
fn page_draws_hovers_and_plays_without_requests() {
    let Some(mut browser) = Browser::start("page_draws_hovers_and_plays_without_requests") else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let address = page_of(at, &[]);
    let mut page = browser.open(&address, DEFAULT);
    let seen = seen_by(&mut page, USER);
    let point = &json(at, &["report", "s.sqlite"])["points"][4];
    let number = |name: &str| point[name].as_f64().unwrap();
    let [value, half] = ["viscosity", "viscosity_ci95"].map(number);
    let right = uncertain(value, half, NumberFormat::Plain);
    assert_eq!((&seen["points"], &seen["curves"]), (&6.into(), &2.into()));
    let tip = seen["tip"].as_str().unwrap();
    let line = tip.lines().find(|line| line.starts_with("viscosity"));
    assert_eq!(line.unwrap(), format!("viscosity {right}"));
    assert!(tip.contains("ν = 0.3") && tip.contains("Γ = 1"), "{tip}");
    for fact in ["shown", "moved"] {
        assert_eq!(seen[fact], true, "{fact}");
    }
    assert_eq!(seen["traces"], 2);
    let strain = seen["strain"].as_str().unwrap();
    // In the middle of the step that begins at 0.06.
    assert!(strain.starts_with("0.07"), "{strain}");
    assert_eq!(seen["after_hiding"], 1);
    assert_eq!(seen["along_friction"], 3);
    assert_eq!(seen["wide"], false);
    assert_eq!(page.requests(), [address]);
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn curves_run_along_the_stress_where_it_is_imposed() {
    let Some(mut browser) = Browser::start("curves_run_along_the_stress_where_it_is_imposed")
    else {
        return;
    };
    let imposed = CAMPAIGN.replace("shear_rate = [0.1, 1.0, inf]", "shear_stress = [0.1, 1.0]");
    let folder = folder("c.toml", &imposed);
    let at = folder.path();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    let mut page = browser.open(&page_of(at, &[]), DEFAULT);
    let user = "seen.along = $('along').value; seen.map = $('map-x').value;";
    let seen = seen_by(&mut page, user);
    assert_eq!(seen["along"], "shear_stress");
    assert_eq!(seen["map"], "shear_stress");
}

/// A user who looks at everything.
const LOOKER: &str = r"
seen.views = {};
seen.dark = matchMedia('(prefers-color-scheme: dark)').matches;
for (const view of ['curve', 'flow', 'contacts', 'histogram', 'map', 'versus']) {
  pick('view', view);
  const png = saved(); $('save-png').click();
  const box = $('plot').getBoundingClientRect();
  seen.views[view] = {
    curves: all('.curve'), points: all('.point'), cells: all('.cell'), runs: all('.run'), markers: all('.marker'),
    colours: await colours((await png).address), buttons: $('legend').childElementCount,
    inside: box.left >= 0 && box.right <= innerWidth && box.width > 200, wide: is_wide(),
  };
}
pick('view', 'curve');
seen.shapes = new Set([...document.querySelectorAll('#plot .marker')].map(m => m.getAttribute('d') + (m.style.fill.includes('panel') ? 'hollow' : ''))).size;
$('bands').click(); seen.bands = all('.band'); $('bands').click();
const csv = saved(); $('save-csv').click();
seen.csv = text_of((await csv).address);
const svg = saved(); $('save-svg').click();
const parsed = new DOMParser().parseFromString(text_of((await svg).address), 'image/svg+xml');
seen.svg = [parsed.querySelectorAll('.point').length, parsed.querySelector('parsererror') !== null, parsed.documentElement.outerHTML.includes('var(')];
/* A quantity with negative values on a logarithmic axis says so. */
pick('quantity', 'n2');
if (!$('log').checked) $('log').click();
seen.remark = $('remark').textContent;
$('log').click(); seen.remark_without = $('remark').textContent;
pick('quantity', 'viscosity');
/* The table: what matters is within the window. */
const heads = [...document.querySelectorAll('#points th')], head = heads.find(h => h.textContent === 'viscosity');
seen.heads = heads.map(h => h.textContent); seen.viscosity_right = head.getBoundingClientRect().right; seen.window = innerWidth;
seen.scrolls = $('points-box').scrollWidth > $('points-box').clientWidth + 2; seen.cue = !$('cue').hidden;
document.querySelector('[data-column=rolling_fraction]').click();
seen.more_heads = document.querySelectorAll('#points th').length;
/* The last point, its second run, and what its layer can be coloured by. */
document.querySelectorAll('#plot .point')[5].dispatchEvent(new MouseEvent('click', { bubbles: true }));
await until(() => document.querySelectorAll('#run-list button').length === 2);
document.querySelectorAll('#run-list button')[1].click();
await until(() => $('movie-name').textContent.endsWith('seed 2'));
const places = [];
for (const at of [2, 9]) { $('scrub').value = at; $('scrub').dispatchEvent(new Event('input')); places.push(+document.querySelector('#trace .cursor').getAttribute('x1')); }
seen.cursor_moves = places[1] > places[0] + 20;
/* The runs, the layer and the points can be saved too. */
seen.saved = {};
for (const id of ['trace-csv', 'trace-svg', 'trace-png', 'layer-png', 'points-csv']) {
  const one = saved(); $('save-' + id).click();
  const { name, address } = await one;
  seen.saved[id] = { name, lines: id.endsWith('csv') ? text_of(address).trim().split('\n') : [], colours: id.endsWith('png') ? (await colours(address)).length : 0 };
}
const pictures = ['', 'pressure', 'contacts', 'spin'].map(kind => { pick('paint', kind); return $('layer').toDataURL(); });
seen.pictures = new Set(pictures).size; seen.meaning = $('meaning').textContent;
";

/// Shows everything to a user, in every window; the page may request only these addresses.
pub(crate) fn look_at_everything(
    browser: &mut Browser,
    address: &str,
    report: &Value,
    may_ask: &dyn Fn(&str) -> bool,
) {
    for window in WINDOWS {
        let mut page = browser.open(address, window);
        let seen = seen_by(&mut page, LOOKER);
        check_views(&seen, report, window);
        let foreign: Vec<String> = page.requests();
        let foreign: Vec<&String> = foreign.iter().filter(|asked| !may_ask(asked)).collect();
        assert!(foreign.is_empty(), "{window:?}: {foreign:?}");
        assert_eq!(page.errors(), [""; 0], "{window:?}");
        page.close();
    }
}

fn check_views(seen: &Value, report: &Value, window: Window) {
    assert_eq!(seen["dark"], window.1, "{window:?}");
    assert_eq!(seen["window"], window.0, "{window:?}");
    // Two curves of three points; four kinds of contacts of each; six points; a map of three by
    // two; two runs.
    for (view, counts) in [
        ("curve", [2, 6, 0, 0, 2]),
        ("flow", [2, 4, 0, 0, 2]),
        ("contacts", [8, 24, 0, 0, 8]),
        ("histogram", [6, 0, 0, 0, 6]),
        ("map", [0, 6, 6, 0, 0]),
        ("versus", [0, 0, 0, 2, 2]),
    ] {
        let found = &seen["views"][view];
        let names = ["curves", "points", "cells", "runs", "buttons"];
        for (name, count) in names.into_iter().zip(counts) {
            assert_eq!(found[name], count, "{name} of {view}, {window:?}: {found}");
        }
        assert_eq!(found["inside"], true, "{view}, {window:?}");
        assert_eq!(found["wide"], false, "{view}, {window:?}");
    }
    let colours = |view: &str| seen["views"][view]["colours"].to_string();
    let curves = if window.1 {
        ["#4aa8e0", "#f0803c"]
    } else {
        ["#0072b2", "#d55e00"]
    };
    for colour in curves {
        let found = colours("curve");
        assert!(
            found.contains(colour),
            "{colour} is not in {found}, {window:?}"
        );
    }
    // The ends of the map of colours.
    for colour in ["#440154", "#fde725"] {
        assert!(colours("map").contains(colour), "{colour}, {window:?}");
    }
    assert_eq!(seen["shapes"], 2, "a marker of its own for each curve");
    assert!(seen["bands"].as_u64().unwrap() > 0);
    assert_eq!(seen["svg"], serde_json::json!([6, false, false]));
    let csv = seen["csv"].as_str().unwrap();
    assert_eq!(csv.lines().count(), 7);
    let all = report["points"].as_array().unwrap();
    for mean in all.iter().map(|point| point["viscosity"].to_string()) {
        assert!(csv.contains(&mean), "{mean} is not in {csv}");
    }
    let is_negative = |point: &&Value| point["n2"].as_f64() <= Some(0.0);
    let negative = all.iter().filter(is_negative).count();
    assert!(negative > 0);
    let remark = seen["remark"].as_str().unwrap();
    let expected = format!("{negative} of 6 values are 0 or negative");
    assert!(remark.starts_with(&expected), "{remark}");
    assert_eq!(seen["remark_without"], "");
    let number = |name: &str| seen[name].as_f64().unwrap();
    assert!(number("viscosity_right") <= number("window"), "{window:?}");
    assert_eq!(seen["scrolls"], seen["cue"], "{window:?}");
    let heads = seen["heads"].as_array().unwrap();
    assert_eq!(heads[..3], ["ν", "Γ", "viscosity"]);
    assert_eq!(seen["more_heads"], heads.len() + 1);
    assert_eq!(seen["cursor_moves"], true);
    check_saved(&seen["saved"], all);
    assert_eq!(seen["pictures"], 4);
    assert!(seen["meaning"].as_str().unwrap().starts_with("rotation"));
}

/// What is saved of the runs, the layer and the points.
fn check_saved(saved: &Value, points: &[Value]) {
    let lines = |id: &str| saved[id]["lines"].as_array().unwrap();
    assert_eq!(lines("trace-csv")[0], "key,seed,strain,viscosity");
    assert_eq!(
        lines("trace-csv").len(),
        1 + 2 * 20,
        "two runs of 20 samples"
    );
    assert_eq!(lines("points-csv").len(), 1 + points.len());
    let viscosity = points[5]["viscosity"].to_string();
    let last = lines("points-csv").last().unwrap().as_str().unwrap();
    assert!(last.contains(&viscosity), "{viscosity}: {last}");
    for (id, name) in [
        ("trace-svg", "browser-runs.svg"),
        ("trace-png", "browser-runs.png"),
        ("layer-png", "browser-layer.png"),
    ] {
        assert_eq!(saved[id]["name"], name);
        let is_picture = id.ends_with("png");
        assert_eq!(
            saved[id]["colours"].as_u64().unwrap() > 2,
            is_picture,
            "{id}"
        );
    }
}

#[test]
fn every_view_is_drawn_at_every_width_in_light_and_dark() {
    let Some(mut browser) = Browser::start("every_view_is_drawn_at_every_width_in_light_and_dark")
    else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let address = page_of(at, &[]);
    let report = json(at, &["report", "s.sqlite"]);
    look_at_everything(&mut browser, &address, &report, &|asked| asked == address);
}

#[test]
fn many_curves_repeat_no_colour() {
    let Some(mut browser) = Browser::start("many_curves_repeat_no_colour") else {
        return;
    };
    let many = CAMPAIGN
        .replace(
            "friction = [0.1, 0.3]",
            "friction = [0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]",
        )
        .replace("seeds = 2", "seeds = 1")
        .replace("spheres = 30", "spheres = 20")
        .replace("strain = 0.4", "strain = 0.2");
    let folder = folder("c.toml", &many);
    let at = folder.path();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    let address = page_of(at, &[]);
    for dark in [false, true] {
        let mut page = browser.open(&address, Window(960, dark));
        let strokes = page
            .value("[...document.querySelectorAll('#legend line')].map(line => line.style.stroke)");
        let strokes = strokes.as_array().unwrap().iter();
        let mut colours: Vec<String> = strokes.map(Value::to_string).collect();
        assert_eq!(colours.len(), 11);
        colours.sort();
        colours.dedup();
        assert_eq!(colours.len(), 11, "{colours:?}");
        // Of 33 histograms as many are shown at first as can be distinguished; the others can be
        // switched on.
        let seen = seen_by(
            &mut page,
            "pick('view', 'histogram'); seen.first = all('.bars'); seen.remark = $('remark').textContent;
             document.querySelector('#legend button[aria-pressed=false]').click(); seen.then = all('.bars');
             pick('view', 'curve'); pick('view', 'histogram'); seen.again = all('.bars');",
        );
        assert_eq!([&seen["first"], &seen["then"], &seen["again"]], [6, 7, 7]);
        let remark = seen["remark"].as_str().unwrap();
        assert!(remark.starts_with("6 of 33 histograms"), "{remark}");
        page.close();
    }
}

#[test]
fn hostile_text_is_shown_and_not_obeyed() {
    let Some(mut browser) = Browser::start("hostile_text_is_shown_and_not_obeyed") else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    fail(at, "1");
    spoil(
        at,
        "UPDATE failures SET error = '</script><script>document.title = 1</script>';
         UPDATE campaign SET name = '<b onclick=x>bold</b>'",
    );
    let address = page_of(at, &[]);
    let mut page = browser.open(&address, DEFAULT);
    assert_eq!(
        page.value("document.title"),
        "<b onclick=x>bold</b> · sweep"
    );
    let text = page.value("document.body.innerText");
    let text = text.as_str().unwrap();
    assert!(text.contains("</script><script>document.title = 1"));
    let drawn = page.value("document.getElementById('plot').textContent");
    assert!(drawn.as_str().unwrap().contains("no results yet"));
    assert_eq!(page.errors(), [""; 0]);
}

/// A user who reads numbers.
const READER: &str = r"
const heads = () => [...document.querySelectorAll('#points th')].map(head => head.textContent);
const labels = () => [...document.querySelectorAll('#plot text')].map(text => text.textContent);
seen.heads = heads();
seen.curve = labels();
const csv = saved(); $('save-csv').click();
seen.csv = text_of((await csv).address);
pick('view', 'flow'); seen.flow = labels();
pick('view', 'histogram'); seen.histogram = labels();
pick('view', 'versus'); seen.versus = labels();
";

#[test]
fn physical_units_reach_every_view() {
    let Some(mut browser) = Browser::start("physical_units_reach_every_view") else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let units = ["--units", "a=1um,mu=2mPas,f_crit=10pN"];
    let address = page_of(at, &units);
    let mut page = browser.open(&address, DEFAULT);
    let seen = seen_by(&mut page, READER);
    let has = |view: &str, word: &str| {
        let words = seen[view].as_array().unwrap();
        assert!(words.iter().any(|w| w == word), "{word:?}: {words:?}");
    };
    has("heads", "Γ (1/s)");
    has("heads", "viscosity (Pa s)");
    for (view, words) in [
        ("curve", ["shear rate (1/s)", "viscosity (Pa s)"]),
        ("flow", ["shear rate (1/s)", "shear stress (Pa)"]),
        ("histogram", ["share of samples", "viscosity (Pa s)"]),
        ("versus", ["strain", "viscosity (Pa s)"]),
    ] {
        for word in words {
            has(view, word);
        }
    }
    let report = json(at, &["report", "s.sqlite"]);
    let relative = report["points"][1]["viscosity"].as_f64().unwrap();
    let csv = seen["csv"].as_str().unwrap();
    let row = csv.lines().nth(2).unwrap();
    let shown: Vec<f64> = row
        .split(',')
        .filter_map(|cell| cell.parse().ok())
        .collect();
    let rate = 10e-12 / (6.0 * std::f64::consts::PI * 2e-3 * 1e-12);
    assert!((shown[0] / rate - 1.0).abs() < 1e-9, "{row}");
    assert!((shown[1] / (2e-3 * relative) - 1.0).abs() < 1e-9, "{row}");
    assert_eq!(page.errors(), [""; 0]);
}
