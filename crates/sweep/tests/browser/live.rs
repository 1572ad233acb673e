//! The live page: a server that only reads, and what a browser sees of it.

use crate::COMPUTED;
use crate::chromium::{Browser, USUAL};
use crate::program::{json, program, spoil};
use crate::views::look_at_everything;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};

/// A server that ends with the test.
struct Served(Child, String);

impl Served {
    fn start(at: &Path) -> Self {
        let mut child = program(at)
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
    let folder = COMPUTED.folder();
    let server = Served::start(folder.path());
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
fn every_view_of_the_live_page_is_drawn_and_asks_its_own_server_only() {
    let test = "every_view_of_the_live_page_is_drawn_and_asks_its_own_server_only";
    let Some(mut browser) = Browser::start(test) else {
        return;
    };
    let folder = COMPUTED.folder();
    let at = folder.path();
    let report = json(at, &["report", "s.sqlite"]);
    let server = Served::start(at);
    let address = format!("http://{}/", server.1);
    look_at_everything(&mut browser, &address, &report, &|asked| {
        let path = asked.strip_prefix(&address);
        path.is_some_and(|path| {
            path.is_empty() || path == "data.json" || path.starts_with("movie/")
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
    let server = Served::start(at);
    let mut page = browser.open(&format!("http://{}/", server.1), USUAL);
    let said = page.value("document.getElementById('summary').textContent");
    assert!(
        said.as_str().unwrap().starts_with("12 of 12 runs done"),
        "{said}"
    );
    spoil(at, "UPDATE cases SET state = 'jammed' WHERE id = 1");
    // Until it has asked again.
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
