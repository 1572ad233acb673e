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

/// The document of an address once its scripts have run for a while, and what the browser said on its console.
fn visit(browser: &str, directory: &Path, address: &str) -> (String, String) {
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
            "--window-size=1000,900",
            "--virtual-time-budget=4000",
            "--dump-dom",
        ])
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
    let page = std::fs::read_to_string(at.join("p.html")).unwrap();
    let tested = page.replace("</body>", &format!("<script>{USER}</script></body>"));
    std::fs::write(at.join("t.html"), tested).unwrap();
    let address = format!("file://{}", at.join("t.html").display());
    let (document, console) = visit(browser, at, &address);
    assert_eq!(console, "");
    let (_, rest) = document.split_once("SEEN").unwrap();
    let (seen, _) = rest.split_once("END").unwrap();
    let seen: serde_json::Value = serde_json::from_str(seen).unwrap();
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
    let (document, console) = visit(browser, at, &address);
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
    let (document, console) = visit(browser, directory.path(), &format!("http://{}/", server.1));
    assert_eq!(console, "");
    assert_eq!(document.matches("class=\"curve\"").count(), 2);
    assert!(
        document.contains("12 of 12 runs done"),
        "also after asking for news"
    );
}
