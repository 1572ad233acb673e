//! What the page shows, by its elements and the pixels of its pictures.

use super::chromium::{Browser, DEFAULT, Page, WINDOWS, Window};
use super::{CAMPAIGN, COMPUTED, page_of};
use crate::harness::{fail, folder, json, spoil, sweep};
use serde_json::Value;
use sweep::text::format::{NumberFormat, uncertain};

/// Helpers for every user of the page.
const COMMON: &str = r"
const seen = {}, $ = id => document.getElementById(id);
const until = async test => { for (let n = 0; n < 1200; n++) { if (test()) return; await new Promise(done => setTimeout(done, 50)); } throw new Error('waited for ' + test); };
const text_of = address => decodeURIComponent(address.split(',').slice(1).join(','));
/* Selects, and waits for the figure, or for the reason why there is none. */
const pick = async (id, value) => {
  $('plot').src = 'data:,'; $('plot-problem').textContent = '';
  $(id).value = value; $(id).dispatchEvent(new Event('change'));
  await until(() => $('plot-problem').textContent || $('plot').complete && $('plot').naturalWidth > 1);
};
/* The figure as a document. */
const figure = () => new DOMParser().parseFromString(text_of($('plot').src), 'image/svg+xml');
const words = () => [...figure().querySelectorAll('text')].map(text => text.textContent);
const rows = () => [...document.querySelectorAll('#points tr')].map(row => [...row.children].map(cell => cell.textContent));
const is_wide = () => document.documentElement.scrollWidth > document.documentElement.clientWidth;
/* Colours of a picture that cover at least some dots. */
const colours = picture => {
  const canvas = document.createElement('canvas'); canvas.width = picture.naturalWidth; canvas.height = picture.naturalHeight;
  const pen = canvas.getContext('2d'); pen.drawImage(picture, 0, 0);
  const dots = pen.getImageData(0, 0, canvas.width, canvas.height).data, counts = new Map();
  for (let i = 0; i < dots.length; i += 4) { const key = (dots[i] << 16) + (dots[i + 1] << 8) + dots[i + 2]; counts.set(key, (counts.get(key) ?? 0) + 1); }
  return [...counts].filter(([, n]) => n > 40).map(([key]) => '#' + key.toString(16).padStart(6, '0'));
};
";

/// The visible content of a page.
pub(super) fn seen_by(page: &mut Page<'_>, user: &str) -> Value {
    page.value(&format!(
        "(async () => {{ {COMMON} {user}; return seen; }})()"
    ))
}

/// A user who looks at everything.
const LOOKER: &str = r"
await until(() => $('plot').complete && $('plot').naturalWidth > 1);
seen.dark = matchMedia('(prefers-color-scheme: dark)').matches;
seen.window = innerWidth;
seen.figures = [...$('figure').options].map(option => option.value);
seen.along = [...$('along').options].map(option => option.value);
seen.colours = colours($('plot'));
seen.words = words();
seen.figure = text_of($('plot').src);
const box = $('plot').getBoundingClientRect();
seen.inside = box.left >= 0 && box.right <= innerWidth && box.width > 200;
seen.wide = is_wide();
await pick('along', 'friction'); seen.friction = words();
await pick('figure', 'n2'); seen.n2 = words();
await pick('figure', 'contacts'); seen.contacts = words();
await pick('figure', 'flow-curve'); seen.flow = words();
await pick('figure', 'viscosity');
/* The table: what matters is within the window. */
const heads = [...document.querySelectorAll('#points th')];
seen.viscosity_right = heads.find(h => h.textContent === 'viscosity').getBoundingClientRect().right;
seen.rows = rows();
seen.scrolls = $('points-box').scrollWidth > $('points-box').clientWidth + 2; seen.cue = !$('cue').hidden;
document.querySelector('[data-column=n1]').click();
seen.more_heads = document.querySelectorAll('#points th').length;
seen.csv = text_of($('save-points').href);
seen.names = [$('save-points').download, $('save-plot').download];
/* The last point, its second run, and what its layer can be coloured by. */
document.querySelectorAll('#points button')[5].click();
await until(() => document.querySelectorAll('#run-list button').length === 2 && $('trace').complete && $('trace').naturalWidth > 1);
seen.point = $('point').textContent;
seen.trace = [...new DOMParser().parseFromString(text_of($('trace').src), 'image/svg+xml').querySelectorAll('text')].map(text => text.textContent);
document.querySelectorAll('#run-list button')[1].click();
await until(() => $('movie-name').textContent.endsWith('seed 2') && +$('scrub').value > 0);
$('play').click(); $('scrub').value = 3; $('scrub').dispatchEvent(new Event('input'));
seen.strain = $('strain').textContent;
$('scrub').value = $('scrub').max; $('scrub').dispatchEvent(new Event('input'));
const pictures = ['', 'pressure', 'contacts', 'spin'].map(kind => { $('paint').value = kind; $('paint').dispatchEvent(new Event('change')); return $('layer').toDataURL(); });
seen.pictures = new Set(pictures).size; seen.meaning = $('meaning').textContent;
seen.described = [...document.querySelectorAll('img, canvas')].every(picture => picture.alt || picture.getAttribute('aria-label'));
";

/// Shows everything to a user, in every window; the page may request only these addresses.
pub(super) fn look_at_everything(
    browser: &mut Browser,
    address: &str,
    report: &Value,
    figure: &str,
    may_ask: &dyn Fn(&str) -> bool,
) {
    for window in WINDOWS {
        let mut page = browser.open(address, window);
        let seen = seen_by(&mut page, LOOKER);
        check(&seen, report, window);
        // But for its origin, the figure is that of the command.
        let shapes = |svg: &str| svg.split_once("</metadata>").unwrap().1.to_owned();
        assert_eq!(shapes(seen["figure"].as_str().unwrap()), shapes(figure));
        let foreign: Vec<String> = page.requests();
        let foreign: Vec<&String> = foreign.iter().filter(|asked| !may_ask(asked)).collect();
        assert!(foreign.is_empty(), "{window:?}: {foreign:?}");
        assert_eq!(page.errors(), [""; 0], "{window:?}");
        page.close();
    }
}

fn check(seen: &Value, report: &Value, window: Window) {
    assert_eq!(seen["dark"], window.1, "{window:?}");
    assert_eq!(seen["window"], window.0, "{window:?}");
    let list = |name: &str| seen[name].as_array().unwrap();
    let has = |name: &str, word: &str| {
        let words = list(name);
        assert!(words.iter().any(|w| w == word), "{word:?} in {words:?}");
    };
    for figure in ["viscosity", "contacts", "flow-curve", "n2", "minimum_gap"] {
        has("figures", figure);
    }
    assert_eq!(list("along"), &["shear_rate", "friction"]);
    for (figure, label) in [
        ("words", "shear rate Γ"),
        ("words", "ν = 0.3"),
        ("friction", "friction coefficient ν"),
        ("friction", "Γ = ∞"),
        ("n2", "stress difference N₂ (μ × rate)"),
        ("contacts", "rolling"),
        ("flow", "shear stress σ* (Fcrit/a²)"),
        ("trace", "seed 2"),
    ] {
        has(figure, label);
    }
    // Lines are thin, so that most of their dots are mixed with the paper.
    has("colours", "#ffffff");
    assert!(list("colours").len() > 5, "{:?}", list("colours"));
    let figure = seen["figure"].as_str().unwrap();
    assert!(figure.contains("#0072b2") && figure.contains("#d55e00"));
    assert_eq!(seen["inside"], true, "{window:?}");
    assert_eq!(seen["wide"], false, "{window:?}");
    let rows = list("rows");
    let heads = rows[0].as_array().unwrap();
    assert_eq!(heads[..4], ["runs of", "ν", "Γ", "runs"]);
    assert_eq!(seen["more_heads"], heads.len() + 1);
    let number = |name: &str| seen[name].as_f64().unwrap();
    assert!(number("viscosity_right") <= number("window"), "{window:?}");
    assert_eq!(seen["scrolls"], seen["cue"], "{window:?}");
    let points = report["points"].as_array().unwrap();
    let place = heads.iter().position(|head| head == "viscosity").unwrap();
    let csv = seen["csv"].as_str().unwrap();
    assert_eq!(csv.lines().count(), 1 + points.len());
    for (point, row) in points.iter().zip(&rows[1..]) {
        let [value, half] = ["viscosity", "viscosity_ci95"].map(|name| point[name].as_f64());
        let shown = uncertain(value.unwrap(), half.unwrap(), NumberFormat::Plain);
        assert_eq!(row[place], shown);
        assert!(csv.contains(&point["viscosity"].to_string()), "{csv}");
    }
    let names = [
        "browser-points.csv",
        "browser-relative viscosity η against shear rate Γ.svg",
    ];
    assert_eq!(list("names"), &names);
    assert_eq!(seen["point"], "ν = 0.3, Γ = ∞");
    // Without loaded contacts a frame is that of the beginning of its step.
    assert!(
        seen["strain"].as_str().unwrap().starts_with("0.06"),
        "{}",
        seen["strain"]
    );
    assert_eq!(seen["pictures"], 4);
    assert!(seen["meaning"].as_str().unwrap().starts_with("rotation"));
    assert_eq!(seen["described"], true);
}

#[test]
fn everything_is_shown_at_every_width_in_light_and_dark_without_requests() {
    let test = "everything_is_shown_at_every_width_in_light_and_dark_without_requests";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let address = page_of(at, &["--figure", "f.svg"]);
    let report = json(at, &["report", "s.sqlite"]);
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    look_at_everything(&mut browser, &address, &report, &figure, &|asked| {
        asked == address
    });
}

#[test]
fn figures_run_along_the_stress_where_it_is_imposed_and_have_panels_where_they_must() {
    let test = "figures_run_along_the_stress_where_it_is_imposed_and_have_panels_where_they_must";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let frictions: Vec<String> = (1..7).map(|n| format!("0.{n}")).collect();
    let imposed = CAMPAIGN
        .replace("shear_rate = [0.1, 1.0, inf]", "shear_stress = [0.1, 1.0]")
        .replace("area_fraction = 0.65", "area_fraction = [0.4, 0.5]")
        .replace("[0.1, 0.3]", &format!("[{}]", frictions.join(", ")))
        .replace("strain = 0.4", "strain = 0.2")
        .replace("seeds = 2", "seeds = 1");
    let folder = folder("c.toml", &imposed);
    let at = folder.path();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    let mut page = browser.open(&page_of(at, &[]), DEFAULT);
    let user = "await until(() => $('plot').naturalWidth > 1); seen.along = $('along').value; seen.words = words();";
    let seen = seen_by(&mut page, user);
    assert_eq!(seen["along"], "shear_stress");
    // Twelve curves that differ in two numbers are more than can be distinguished.
    let words = seen["words"].to_string();
    assert!(
        words.contains("\"c = 0.4\"") && words.contains("\"ν = 0.6\""),
        "{words}"
    );
    assert_eq!(page.errors(), [""; 0]);
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
    assert!(text.contains("No results yet"), "{text}");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn what_jammed_and_what_failed_is_counted_in_the_table() {
    let test = "what_jammed_and_what_failed_is_counted_in_the_table";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    fail(at, "friction > 0.2 AND shear_rate > 2");
    spoil(
        at,
        "UPDATE cases SET state = 'jammed' WHERE seed = 1
             AND point IN (SELECT id FROM axes WHERE friction > 0.2 AND shear_rate < 0.5);
         UPDATE results SET jammed_strain = 0.01 WHERE case_id IN (SELECT id FROM cases WHERE state = 'jammed')",
    );
    let mut page = browser.open(&page_of(at, &[]), DEFAULT);
    let seen = seen_by(
        &mut page,
        "seen.rows = rows(); seen.summary = $('summary').textContent;",
    );
    let said = seen["summary"].as_str().unwrap();
    assert!(
        said.starts_with("9 of 12 runs done, 1 jammed, 2 failed"),
        "{said}"
    );
    let cell = |row: usize, head: &str| {
        let rows = seen["rows"].as_array().unwrap();
        let place = rows[0]
            .as_array()
            .unwrap()
            .iter()
            .position(|name| name == head);
        rows[row][place.unwrap()].as_str().unwrap().to_owned()
    };
    assert_eq!([cell(4, "jammed"), cell(6, "failed")], ["1", "2"]);
    assert_eq!(cell(6, "viscosity"), "–");
}

#[test]
fn physical_units_reach_figures_and_table() {
    let Some(mut browser) = Browser::start("physical_units_reach_figures_and_table") else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let units = ["--units", "a=1um,mu=2mPas,f_crit=10pN"];
    let mut page = browser.open(&page_of(at, &units), DEFAULT);
    let user = "await until(() => $('plot').naturalWidth > 1); seen.curve = words(); seen.heads = rows()[0];
                await pick('figure', 'flow-curve'); seen.flow = words();";
    let seen = seen_by(&mut page, user);
    for (what, word) in [
        ("heads", "Γ 1/s"),
        ("heads", "viscosity Pa s"),
        ("curve", "shear rate (1/s)"),
        ("curve", "viscosity η (Pa s)"),
        ("flow", "shear stress (Pa)"),
    ] {
        let words = seen[what].as_array().unwrap();
        assert!(words.iter().any(|w| w == word), "{word:?}: {words:?}");
    }
    assert_eq!(page.errors(), [""; 0]);
}
