//! The live page under attack: slow clients, many connections, bad requests, a locked store.

use super::directory;
use crate::harness::{PATIENCE, Served, ended, program, send, until};
use rustix::process::Signal;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// The live page of a system with few file descriptors.
fn serve(directory: &Path) -> Served {
    let mut limited = Command::new("bash");
    limited
        .args(["-c", "ulimit -n 64; exec \"$0\" \"$@\""])
        .arg(program(directory).get_program())
        .args(["serve", "small.toml", "--listen", "127.0.0.1:0", "--json"])
        .current_dir(directory);
    Served::start(&mut limited)
}

fn connect(server: &Served) -> TcpStream {
    let stream = TcpStream::connect(&server.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream
}

/// The answer to a request, head and all.
fn ask(server: &Served, request: &str) -> String {
    let mut stream = connect(server);
    stream.write_all(request.as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

const PAGE: &str = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";

/// The status of an answer.
fn status(answer: &str) -> &str {
    answer.split(' ').nth(1).unwrap_or_default()
}

#[test]
fn slow_clients_do_not_block_others() {
    let directory = directory();
    let server = serve(directory.path());
    let idle: Vec<TcpStream> = (0..40).map(|_| connect(&server)).collect();
    assert_eq!(status(&ask(&server, PAGE)), "200");
    drop(idle);
    // Sending a byte occasionally does not keep a connection.
    let mut slow = connect(&server);
    slow.set_read_timeout(Some(Duration::from_millis(100)))
        .unwrap();
    until("the end of a slow visit", || {
        let is_open = slow.write_all(b"G").is_ok() && !matches!(slow.read(&mut [0; 64]), Ok(0));
        (!is_open).then_some(())
    });
    assert_eq!(status(&ask(&server, PAGE)), "200");
}

#[test]
fn parallel_requests_are_all_answered_in_full() {
    let directory = directory();
    let server = serve(directory.path());
    std::thread::scope(|scope| {
        let asked: Vec<_> = (0..200)
            .map(|_| scope.spawn(|| ask(&server, PAGE)))
            .collect();
        for answer in asked {
            let answer = answer.join().unwrap();
            assert_eq!(status(&answer), "200");
            let (head, body) = answer.split_once("\r\n\r\n").unwrap();
            let length = format!("content-length: {}", body.len());
            assert!(head.contains(&length), "{} of {head}", body.len());
        }
    });
}

#[test]
fn requests_that_name_no_host_or_two_are_refused() {
    let directory = directory();
    let server = serve(directory.path());
    for (request, wanted) in [
        ("GET / HTTP/1.1\r\n\r\n", "400"),
        (
            "GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n",
            "400",
        ),
        (
            "GET http://evil.example/ HTTP/1.1\r\nHost: localhost\r\n\r\n",
            "400",
        ),
        ("GET localhost/ HTTP/1.1\r\nHost: localhost\r\n\r\n", "400"),
    ] {
        assert_eq!(status(&ask(&server, request)), wanted, "{request}");
    }
    // An error about an unreadable store must not reveal its path.
    std::fs::write(directory.path().join("results/small.sqlite"), "no store").unwrap();
    let answer = ask(&server, PAGE);
    assert_eq!(status(&answer), "503");
    let (_, body) = answer.split_once("\r\n\r\n").unwrap();
    assert!(
        !body.contains(['/', '\\']) && !body.contains("small"),
        "{answer}"
    );
}

#[test]
fn server_ends_whatever_its_store_does() {
    for signal in [Signal::TERM, Signal::INT] {
        let directory = directory();
        let mut server = serve(directory.path());
        let lock =
            rusqlite::Connection::open(directory.path().join("results/small.sqlite")).unwrap();
        // Readers wait for as long as this is held.
        lock.execute_batch("PRAGMA locking_mode = EXCLUSIVE; BEGIN EXCLUSIVE")
            .unwrap();
        lock.execute("UPDATE cases SET changed_at = 0", []).unwrap();
        let mut waiting = connect(&server);
        waiting
            .write_all(b"GET /data.json HTTP/1.1\r\nHost: localhost\r\n\r\n")
            .unwrap();
        std::thread::sleep(Duration::from_millis(300));
        send(&server.child, signal);
        ended(&mut server.child);
        drop(lock);
    }
}
