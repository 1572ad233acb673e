//! The page and the live page in a real browser, headless. Skipped, and said so, on a machine without Chromium.
#![expect(
    clippy::unwrap_used,
    reason = "tests: a panic is the failure, and names state the fact"
)]
#![expect(clippy::print_stderr, reason = "says which tests were skipped")]

use assert_cmd::cargo::cargo_bin;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Stdio};

const CAMPAIGN: &str = r#"name = "browser"
[protocol]
strain = 0.4
discard = 0.1
[[grid]]
area_fraction = 0.65
friction = [0.0, 0.3]
roughness = 0.01
shear_rate = [0, 1.0, inf]
seeds = 2
spheres = 30
hydrodynamics = "ball-melrose"
"#;

/// The browser, if there is one.
fn browser(test: &str) -> Option<&'static str> {
    let found = ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok());
    if found.is_none() {
        eprintln!("SKIPPED {test}: no Chromium on this machine (apt-get install chromium)");
    }
    found
}

/// A directory with a computed store in it.
fn directory() -> tempfile::TempDir {
    let directory = tempfile::tempdir().unwrap();
    std::fs::write(directory.path().join("c.toml"), CAMPAIGN).unwrap();
    sweep(
        directory.path(),
        &["run", "c.toml", "--store", "s.sqlite", "--trajectory", "-q"],
    );
    directory
}

fn sweep(directory: &Path, arguments: &[&str]) -> String {
    let output = Command::new(cargo_bin("sweep"))
        .current_dir(directory)
        .args(arguments)
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

/// A window: its width, and whether the user likes it dark.
#[derive(Debug, Clone, Copy)]
struct Window(u32, bool);

/// The window of most tests.
const USUAL: Window = Window(1000, false);

/// The document of an address once its scripts have run for a while, and what the browser said on its console.
fn visit(
    browser: &str,
    directory: &Path,
    address: &str,
    Window(width, dark): Window,
) -> (String, String) {
    let profile = tempfile::tempdir_in(directory).unwrap();
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--enable-logging=stderr",
            "--virtual-time-budget=8000",
            "--dump-dom",
        ])
        .arg(format!("--window-size={width},900"))
        .arg(format!(
            "--blink-settings=preferredColorScheme={}",
            u8::from(!dark)
        ))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(address)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr)
        .lines()
        .filter(|line| line.contains("CONSOLE"))
        .collect::<Vec<_>>()
        .join("\n");
    (String::from_utf8_lossy(&output.stdout).into_owned(), said)
}

/// What a user's script sees on the page `p.html` of a directory.
fn seen_by(browser: &str, at: &Path, user: &str, window: Window) -> serde_json::Value {
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    let tested = page.replace("</body>", &format!("<script>{user}</script></body>"));
    std::fs::write(at.join("t.html"), tested).unwrap();
    let address = format!("file://{}", at.join("t.html").display());
    let (document, console) = visit(browser, at, &address, window);
    assert_eq!(console, "");
    let (_, rest) = document.split_once("SEEN").unwrap();
    let (seen, _) = rest.split_once("END").unwrap();
    // A title is text: its markup is escaped.
    let seen = seen
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    serde_json::from_str(&seen).unwrap()
}

/// A user: hovers, walks with keys, chooses, hides a curve, plays, scrubs; what came of it ends up in the title.
const USER: &str = r"
(async () => {
  const seen = {}, $ = id => document.getElementById(id), pause = ms => new Promise(r => setTimeout(r, ms));
  try {
    const points = () => [...document.querySelectorAll('#plot .point')];
    seen.points = points().length;
    seen.curves = document.querySelectorAll('#plot .curve').length;
    points()[4].dispatchEvent(new MouseEvent('mouseenter'));
    seen.tip = $('tip').textContent; seen.shown = !$('tip').hidden;
    points()[0].focus();
    points()[0].dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowRight', bubbles: true }));
    seen.walked = document.activeElement === points()[1];
    document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', bubbles: true }));
    await pause(100);
    seen.traces = document.querySelectorAll('#trace .run').length;
    seen.movie = !$('movie').hidden;
    const pixels = () => $('layer').toDataURL();
    const before = pixels();
    $('play').click(); await pause(700);
    seen.played = +$('scrub').value; $('play').click();
    seen.moved = pixels() !== before;
    $('scrub').value = 3; $('scrub').dispatchEvent(new Event('input'));
    seen.strain = $('strain').textContent;
    $('legend').querySelector('button').click();
    seen.after_hiding = document.querySelectorAll('#plot .curve').length;
    $('along').value = 'friction'; $('along').dispatchEvent(new Event('change'));
    seen.along_friction = document.querySelectorAll('#plot .curve').length;
    seen.resources = performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length;
    seen.wide = document.documentElement.scrollWidth > document.documentElement.clientWidth;
  } catch (error) { seen.error = String(error); }
  document.title = 'SEEN' + JSON.stringify(seen) + 'END';
})();
";

#[test]
fn page_draws_hovers_and_plays_and_asks_nobody() {
    let Some(browser) = browser("page_draws_hovers_and_plays_and_asks_nobody") else {
        return;
    };
    let directory = directory();
    let at = directory.path();
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]);
    let seen = seen_by(browser, at, USER, USUAL);
    let report: serde_json::Value =
        serde_json::from_str(&sweep(at, &["report", "s.sqlite", "--json"])).unwrap();
    let right = report["points"][4]["viscosity"].as_f64().unwrap();
    assert_eq!(seen["error"], serde_json::Value::Null);
    assert_eq!((&seen["points"], &seen["curves"]), (&6.into(), &2.into()));
    let tip = seen["tip"].as_str().unwrap();
    let told = tip.split("viscosity ").nth(1).unwrap();
    let told: f64 = told.split(' ').next().unwrap().parse().unwrap();
    assert!((told / right - 1.0).abs() < 1e-3, "{tip} is not {right}");
    assert!(tip.contains("ν = 0.3") && tip.contains("Γ = 1"), "{tip}");
    for fact in ["shown", "walked", "movie", "moved"] {
        assert_eq!(seen[fact], true, "{fact}");
    }
    assert_eq!(seen["traces"], 2);
    assert!(seen["played"].as_u64().unwrap() > 0);
    assert!(seen["strain"].as_str().unwrap().starts_with("0.06"));
    assert_eq!(seen["after_hiding"], 1);
    assert_eq!(seen["along_friction"], 3);
    assert_eq!(seen["resources"], 0);
    assert_eq!(seen["wide"], false);
}

/// A user who looks at everything: each view, by its elements and, as the picture it is saved as, by its pixels.
const LOOKER: &str = r"
(async () => {
  const seen = { views: {} }, $ = id => document.getElementById(id), pause = ms => new Promise(r => setTimeout(r, ms));
  const saved = () => new Promise(done => document.addEventListener('saved', e => done(e.detail), { once: true }));
  const pick = (id, value) => { $(id).value = value; $(id).dispatchEvent(new Event('change')); };
  const all = selector => document.querySelectorAll('#plot ' + selector).length;
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
  try {
    seen.dark = matchMedia('(prefers-color-scheme: dark)').matches;
    for (const view of ['curve', 'flow', 'contacts', 'histogram', 'map', 'versus']) {
      pick('view', view); await pause(20);
      const png = saved(); $('save-png').click();
      const box = $('plot').getBoundingClientRect();
      seen.views[view] = {
        curves: all('.curve'), points: all('.point'), cells: all('.cell'), runs: all('.run'), markers: all('.marker'),
        colours: await colours((await png).address), buttons: $('legend').childElementCount,
        inside: box.left >= 0 && box.right <= innerWidth && box.width > 200,
        wide: document.documentElement.scrollWidth > document.documentElement.clientWidth,
      };
    }
    seen.shapes = (pick('view', 'curve'), new Set([...document.querySelectorAll('#plot .marker')].map(m => m.getAttribute('d') + (m.style.fill.includes('panel') ? 'hollow' : ''))).size);
    $('bands').click(); seen.bands = all('.band'); $('bands').click();
    const csv = saved(); $('save-csv').click();
    seen.csv = decodeURIComponent((await csv).address.split(',').slice(1).join(','));
    const svg = saved(); $('save-svg').click();
    const parsed = new DOMParser().parseFromString(decodeURIComponent((await svg).address.split(',').slice(1).join(',')), 'image/svg+xml');
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
    /* The keyboard alone: everything that can be used can be reached. */
    const used = [...document.querySelectorAll('select, button, input, summary, [role=button], .scroll')].filter(e => e.getClientRects().length);
    seen.out_of_reach = used.filter(e => e.tabIndex < 0 && !e.classList.contains('point') && e.id !== 'run-list').map(e => e.outerHTML.slice(0, 80));
    const first = document.querySelector('#plot .point[tabindex=\'0\']'); first.focus();
    first.dispatchEvent(new KeyboardEvent('keydown', { key: 'End', bubbles: true }));
    document.activeElement.dispatchEvent(new KeyboardEvent('keydown', { key: ' ', bubbles: true })); await pause(50);
    seen.watchable = document.querySelectorAll('#run-list button').length;
    document.querySelectorAll('#run-list button')[1].click(); await pause(50);
    seen.second = $('movie-name').textContent;
    const places = [];
    for (const at of [2, 9]) { $('scrub').value = at; $('scrub').dispatchEvent(new Event('input')); places.push(+document.querySelector('#trace .cursor').getAttribute('x1')); }
    seen.cursor_moves = places[1] > places[0] + 20;
    const pictures = ['', 'pressure', 'contacts', 'spin'].map(kind => { pick('paint', kind); return $('layer').toDataURL(); });
    seen.pictures = new Set(pictures).size; seen.meaning = $('meaning').textContent;
    seen.resources = performance.getEntriesByType('resource').filter(e => !e.name.startsWith('data:')).length;
  } catch (error) { seen.error = String(error) + error.stack; }
  document.title = 'SEEN' + JSON.stringify(seen) + 'END';
})();
";

#[test]
fn every_view_is_drawn_at_every_width_in_light_and_dark() {
    let Some(browser) = browser("every_view_is_drawn_at_every_width_in_light_and_dark") else {
        return;
    };
    let directory = directory();
    let at = directory.path();
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]);
    let report: serde_json::Value =
        serde_json::from_str(&sweep(at, &["report", "s.sqlite", "--json"])).unwrap();
    for window in [
        Window(1920, false),
        Window(1920, true),
        Window(960, false),
        Window(960, true),
        Window(390, false),
        Window(390, true),
    ] {
        let seen = seen_by(browser, at, LOOKER, window);
        assert_eq!(seen["error"], serde_json::Value::Null, "{window:?}");
        assert_eq!(seen["dark"], window.1, "{window:?}");
        // Two curves of three points; four kinds of contacts of each; six points; a map of three by two; two runs.
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
        let means = report["points"].as_array().unwrap().iter();
        for mean in means.map(|point| point["viscosity"].to_string()) {
            assert!(csv.contains(&mean), "{mean} is not in {csv}");
        }
        let all = report["points"].as_array().unwrap();
        let is_negative = |point: &&serde_json::Value| point["n2"].as_f64() <= Some(0.0);
        let negative = all.iter().filter(is_negative).count();
        assert!(negative > 0);
        let remark = seen["remark"].as_str().unwrap();
        let told = format!("{negative} of 6 values are 0 or negative");
        assert!(remark.starts_with(&told), "{remark}");
        assert_eq!(seen["remark_without"], "");
        let number = |name: &str| seen[name].as_f64().unwrap();
        assert!(number("viscosity_right") <= number("window"), "{window:?}");
        assert_eq!(seen["scrolls"], seen["cue"], "{window:?}");
        let heads = seen["heads"].as_array().unwrap();
        assert_eq!(heads[..3], ["ν", "Γ", "viscosity"]);
        assert_eq!(seen["more_heads"], heads.len() + 1);
        assert_eq!(seen["out_of_reach"], serde_json::json!([]), "{window:?}");
        assert_eq!(seen["watchable"], 2, "both seeds");
        assert_eq!(seen["second"], "of the run with seed 2");
        assert_eq!(seen["cursor_moves"], true);
        assert_eq!(seen["pictures"], 4);
        assert!(seen["meaning"].as_str().unwrap().starts_with("turning"));
        assert_eq!(seen["resources"], 0);
    }
}

#[test]
fn many_curves_repeat_no_colour() {
    let Some(browser) = browser("many_curves_repeat_no_colour") else {
        return;
    };
    let directory = tempfile::tempdir().unwrap();
    let at = directory.path();
    let many = CAMPAIGN
        .replace(
            "friction = [0.0, 0.3]",
            "friction = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]",
        )
        .replace("seeds = 2", "seeds = 1")
        .replace("spheres = 30", "spheres = 20")
        .replace("strain = 0.4", "strain = 0.2");
    std::fs::write(at.join("c.toml"), many).unwrap();
    sweep(at, &["run", "c.toml", "--store", "s.sqlite", "-q"]);
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]);
    let user = r"
document.title = 'SEEN' + JSON.stringify([...document.querySelectorAll('#legend line')].map(line => line.style.stroke)) + 'END';";
    for dark in [false, true] {
        let seen = seen_by(browser, at, user, Window(960, dark));
        let mut colours: Vec<String> = seen
            .as_array()
            .unwrap()
            .iter()
            .map(ToString::to_string)
            .collect();
        assert_eq!(colours.len(), 11);
        colours.sort();
        colours.dedup();
        assert_eq!(colours.len(), 11, "{colours:?}");
    }
}

#[test]
fn hostile_text_is_shown_and_not_obeyed() {
    let Some(browser) = browser("hostile_text_is_shown_and_not_obeyed") else {
        return;
    };
    let directory = directory();
    let at = directory.path();
    let store = rusqlite::Connection::open(at.join("s.sqlite")).unwrap();
    store
        .execute_batch(
            "DELETE FROM results; UPDATE cases SET state = 'failed';
             INSERT INTO failures (case_id, attempt, error, step, strain, process, failed_at)
                 SELECT id, 1, '</script><script>document.title = 1</script>', 3, 0.015, 1, 0 FROM cases;
             UPDATE campaign SET name = '<b onclick=x>bold</b>'",
        )
        .unwrap();
    drop(store);
    sweep::store::accept_changes(&at.join("s.sqlite")).unwrap();
    sweep(at, &["report", "s.sqlite", "--page", "p.html"]);
    let address = format!("file://{}", at.join("p.html").display());
    let (document, console) = visit(browser, at, &address, USUAL);
    assert_eq!(console, "");
    assert!(document.contains("&lt;b onclick=x&gt;bold&lt;/b&gt; · sweep</title>"));
    assert!(document.contains("no results to draw yet"));
    assert!(document.contains("&lt;/script&gt;&lt;script&gt;document.title = 1"));
}

/// A server that ends with the test.
struct Served(std::process::Child, String);

impl Served {
    fn start(directory: &Path) -> Self {
        let mut child = Command::new(cargo_bin("sweep"))
            .current_dir(directory)
            .args(["serve", "s.sqlite", "--listen", "127.0.0.1:0", "--json"])
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let said: serde_json::Value = serde_json::from_str(&line).unwrap();
        Self(child, said["address"].as_str().unwrap().to_owned())
    }

    /// The answer to a request, head and all.
    fn ask(&self, method: &str, path: &str, host: &str) -> String {
        let mut stream = TcpStream::connect(&self.1).unwrap();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        answer
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn server_reads_only_and_answers_to_this_machine_only() {
    let directory = directory();
    let server = Served::start(directory.path());
    let status = |answer: &str| answer.split(' ').nth(1).unwrap().to_owned();
    let page = server.ask("GET", "/", &server.1);
    assert_eq!(status(&page), "200");
    assert!(page.contains("cache-control: no-store") && page.contains("connect-src 'self'"));
    for host in [
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.nip.io:80",
    ] {
        assert_eq!(
            status(&server.ask("GET", "/data.json", host)),
            "421",
            "{host}"
        );
    }
    for method in ["POST", "PUT", "DELETE", "PATCH"] {
        for path in ["/", "/data.json"] {
            assert_eq!(
                status(&server.ask(method, path, &server.1)),
                "405",
                "{method} {path}"
            );
        }
    }
    assert_eq!(status(&server.ask("GET", "/../s.sqlite", &server.1)), "404");
    assert_eq!(status(&server.ask("GET", "/movie/x", &server.1)), "404");
    let pid = rustix::process::Pid::from_child(&server.0);
    rustix::process::kill_process(pid, rustix::process::Signal::TERM).unwrap();
    let mut server = server;
    assert_eq!(server.0.wait().unwrap().code(), Some(0));
}

#[test]
fn live_page_draws_what_the_server_has() {
    let Some(browser) = browser("live_page_draws_what_the_server_has") else {
        return;
    };
    let directory = directory();
    let server = Served::start(directory.path());
    let (document, console) = visit(
        browser,
        directory.path(),
        &format!("http://{}/", server.1),
        USUAL,
    );
    assert_eq!(console, "");
    assert_eq!(document.matches("class=\"curve\"").count(), 2);
    assert!(
        document.contains("12 of 12 runs done"),
        "also after asking for news"
    );
}
