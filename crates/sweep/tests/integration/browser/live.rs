//! The live page: a server that only reads, and what a browser sees of it.

use super::COMPUTED;
use super::chromium::{Browser, DEFAULT};
use super::views::{look_at_everything, seen_by};
use crate::harness::{Served, command, ended, json, send, spoil, sweep};
use rustix::process::Signal;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;

/// The live page of the store of a folder.
fn serve(at: &Path) -> Served {
    Served::start(&mut command(
        at,
        &["serve", "s.sqlite", "--listen", "127.0.0.1:0", "--json"],
    ))
}

/// The answer to a request, head and all.
fn ask(server: &Served, method: &str, path: &str, host: &str) -> String {
    let mut stream = TcpStream::connect(&server.address).unwrap();
    write!(
        stream,
        "{method} {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn server_reads_only_and_answers_to_this_machine_only() {
    let folder = COMPUTED.folder();
    let mut server = serve(folder.path());
    let status = |answer: &str| answer.split(' ').nth(1).unwrap().to_owned();
    let page = ask(&server, "GET", "/", &server.address);
    assert_eq!(status(&page), "200");
    assert!(page.contains("cache-control: no-store") && page.contains("connect-src 'self'"));
    for host in [
        "evil.example",
        "localhost.evil.example",
        "127.0.0.1.nip.io:80",
    ] {
        assert_eq!(
            status(&ask(&server, "GET", "/data.json", host)),
            "421",
            "{host}"
        );
    }
    for method in ["POST", "PUT", "DELETE", "PATCH"] {
        for path in ["/", "/data.json"] {
            assert_eq!(
                status(&ask(&server, method, path, &server.address)),
                "405",
                "{method} {path}"
            );
        }
    }
    assert_eq!(
        status(&ask(&server, "GET", "/../s.sqlite", &server.address)),
        "404"
    );
    assert_eq!(
        status(&ask(&server, "GET", "/movie/x", &server.address)),
        "404"
    );
    let figure = ask(
        &server,
        "GET",
        "/figure.svg?name=n2&along=friction",
        &server.address,
    );
    assert!(figure.contains("image/svg+xml") && figure.contains("N₂"));
    let refused = ask(
        &server,
        "GET",
        "/figure.svg?name=n2&where=frction%3D1",
        &server.address,
    );
    assert_eq!(status(&refused), "400");
    assert!(refused.contains("did you mean friction?"), "{refused}");
    send(&server.child, Signal::TERM);
    assert_eq!(ended(&mut server.child).code(), Some(0));
}

#[test]
fn everything_on_the_live_page_comes_from_its_own_server() {
    let test = "everything_on_the_live_page_comes_from_its_own_server";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let report = json(at, &["report", "s.sqlite"]);
    sweep(at, &["report", "s.sqlite", "--figure", "f.svg"]);
    let figure = std::fs::read_to_string(at.join("f.svg")).unwrap();
    let server = serve(at);
    let address = format!("http://{}/", server.address);
    look_at_everything(&mut browser, &address, &report, &figure, &|asked| {
        let path = asked.strip_prefix(&address);
        path.is_some_and(|path| {
            let known = ["movie/", "figure.svg?", "runs.svg?"];
            path.is_empty() || path == "data.json" || known.iter().any(|of| path.starts_with(of))
        })
    });
}

#[test]
fn the_live_page_follows_its_store() {
    let Some(mut browser) = Browser::start("the_live_page_follows_its_store") else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let server = serve(at);
    let mut page = browser.open(&format!("http://{}/", server.address), DEFAULT);
    let said = page.value("document.getElementById('summary').textContent");
    assert!(
        said.as_str().unwrap().starts_with("12 of 12 runs done"),
        "{said}"
    );
    spoil(at, "UPDATE cases SET state = 'jammed' WHERE id = 1");
    // Until the next poll.
    let said = page.value(
        "(async () => { const words = document.getElementById('summary');
         for (let n = 0; n < 1200 && !words.textContent.startsWith('11 of 12'); n++) await new Promise(done => setTimeout(done, 50));
         return words.textContent; })()",
    );
    assert!(
        said.as_str()
            .unwrap()
            .starts_with("11 of 12 runs done, 1 jammed"),
        "{said}"
    );
}

#[test]
fn the_live_page_shows_the_points_asked_for() {
    let Some(mut browser) = Browser::start("the_live_page_shows_the_points_asked_for") else {
        return;
    };
    let folder = COMPUTED.folder();
    let server = serve(folder.path());
    let mut page = browser.open(&format!("http://{}/", server.address), DEFAULT);
    let user = "await pick('where', 'ν=0.3'); seen.one = words(); await pick('where', 'frction=1'); seen.problem = $('plot-problem').textContent;";
    let seen = seen_by(&mut page, user);
    assert!(!seen["one"].to_string().contains("ν = 0.1"), "{seen}");
    let problem = seen["problem"].as_str().unwrap();
    assert!(problem.contains("did you mean friction?"), "{problem}");
}
