//! Chromium, driven over a pipe by its own protocol: real windows, real keys, real pixels, and
//! every request it makes.

use crate::harness::PATIENCE;
use serde_json::{Value, json};
use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};

/// A window: its width and colour scheme.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window(pub(crate) u32, pub(crate) bool);

/// The window of most tests.
pub(crate) const DEFAULT: Window = Window(1000, false);

/// All windows that the page supports.
pub(crate) const WINDOWS: [Window; 6] = [
    Window(1920, false),
    Window(1920, true),
    Window(960, false),
    Window(960, true),
    Window(390, false),
    Window(390, true),
];

/// A browser that ends with the test.
pub(crate) struct Browser {
    child: Child,
    to: File,
    from: Receiver<Value>,
    calls: u64,
    /// Events of its pages.
    events: Vec<Value>,
    _folder: tempfile::TempDir,
}

impl Browser {
    /// Starts it, if there is one on this machine.
    pub(crate) fn start(test: &str) -> Option<Self> {
        let names = ["chromium", "chromium-browser", "google-chrome"];
        let found = names
            .into_iter()
            .find(|name| Command::new(name).arg("--version").output().is_ok());
        let Some(name) = found else {
            assert!(
                std::env::var_os("CI").is_none(),
                "{test}: no Chromium on this machine"
            );
            eprintln!("SKIPPED {test}: no Chromium on this machine (apt-get install chromium)");
            return None;
        };
        let folder = tempfile::tempdir().unwrap();
        let pipes = ["to", "from"].map(|name| {
            let path = folder.path().join(name);
            rustix::fs::mkfifoat(rustix::fs::CWD, &path, 0o600.into()).unwrap();
            path
        });
        // Open at both ends, so that neither blocks.
        let [to, from] = pipes.each_ref().map(|path| {
            let mut options = OpenOptions::new();
            options.read(true).write(true).open(path).unwrap()
        });
        let child = Command::new("sh")
            .current_dir(folder.path())
            // The browser listens at 3 and answers at 4.
            .args(["-c", "exec \"$0\" \"$@\" 3<to 4>from", name])
            .args([
                "--headless",
                "--no-sandbox",
                "--disable-gpu",
                "--disable-quic",
                "--no-first-run",
                "--disable-background-networking",
                "--disable-component-update",
                "--disable-sync",
                "--remote-debugging-pipe",
            ])
            .arg(format!("--user-data-dir={}", folder.path().display()))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let (sender, receiver) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(from).split(0) {
                let Ok(message) = message else { return };
                let message = serde_json::from_slice(&message).unwrap();
                if sender.send(message).is_err() {
                    return;
                }
            }
        });
        Some(Self {
            child,
            to,
            from: receiver,
            calls: 0,
            events: Vec::new(),
            _folder: folder,
        })
    }

    /// Sends a command; returns the answer.
    fn call(&mut self, session: Option<&str>, method: &str, params: &Value) -> Value {
        self.calls += 1;
        let id = self.calls;
        let mut message = json!({"id": id, "method": method, "params": params});
        if let Some(session) = session {
            message["sessionId"] = session.into();
        }
        let mut bytes = serde_json::to_vec(&message).unwrap();
        bytes.push(0);
        self.to.write_all(&bytes).unwrap();
        loop {
            let answer = self.next(method);
            if answer["id"] == id {
                assert_eq!(answer["error"], Value::Null, "{method}");
                return answer["result"].clone();
            }
            self.events.push(answer);
        }
    }

    fn next(&self, what: &str) -> Value {
        let answer = self.from.recv_timeout(PATIENCE);
        assert!(answer.is_ok(), "the browser does not answer to {what}");
        answer.unwrap()
    }

    /// Opens an address in a window of its own, and waits until it is loaded.
    pub(crate) fn open(&mut self, address: &str, Window(width, dark): Window) -> Page<'_> {
        let made = self.call(None, "Target.createTarget", &json!({"url": "about:blank"}));
        let target = made["targetId"].as_str().unwrap().to_owned();
        let attach = json!({"targetId": target, "flatten": true});
        let attached = self.call(None, "Target.attachToTarget", &attach);
        let session = attached["sessionId"].as_str().unwrap().to_owned();
        let mut page = Page {
            browser: self,
            session,
            target,
        };
        for domain in ["Page", "Runtime", "Network", "Log"] {
            page.call(&format!("{domain}.enable"), &json!({}));
        }
        page.call(
            "Emulation.setDeviceMetricsOverride",
            &json!({"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": false}),
        );
        let scheme = if dark { "dark" } else { "light" };
        let features = json!([{"name": "prefers-color-scheme", "value": scheme}]);
        page.call("Emulation.setEmulatedMedia", &json!({"features": features}));
        page.call(
            "Emulation.setFocusEmulationEnabled",
            &json!({"enabled": true}),
        );
        page.call("Page.navigate", &json!({"url": address}));
        page.wait_for("Page.loadEventFired");
        page
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A page that is open.
pub(crate) struct Page<'b> {
    browser: &'b mut Browser,
    session: String,
    target: String,
}

impl Page<'_> {
    fn call(&mut self, method: &str, params: &Value) -> Value {
        self.browser.call(Some(&self.session), method, params)
    }

    /// Events of this page, by name.
    fn events(&self, method: &str) -> impl Iterator<Item = &Value> {
        let own = self.browser.events.iter();
        own.filter(move |event| event["sessionId"] == self.session && event["method"] == method)
            .map(|event| &event["params"])
    }

    fn wait_for(&mut self, method: &str) {
        while self.events(method).next().is_none() {
            let event = self.browser.next(method);
            self.browser.events.push(event);
        }
    }

    /// The value of a script, once available.
    pub(crate) fn value(&mut self, script: &str) -> Value {
        let result = self.call(
            "Runtime.evaluate",
            &json!({"expression": script, "awaitPromise": true, "returnByValue": true}),
        );
        assert_eq!(result["exceptionDetails"], Value::Null, "{script}");
        result["result"]["value"].clone()
    }

    /// Presses a key and lets it go.
    pub(crate) fn press(&mut self, key: &str) {
        let (code, number, text) = match key {
            "Tab" => ("Tab", 9, ""),
            "Enter" => ("Enter", 13, "\r"),
            " " => ("Space", 32, " "),
            "End" => ("End", 35, ""),
            "Home" => ("Home", 36, ""),
            "ArrowLeft" => ("ArrowLeft", 37, ""),
            "ArrowUp" => ("ArrowUp", 38, ""),
            "ArrowRight" => ("ArrowRight", 39, ""),
            _ => ("ArrowDown", 40, ""),
        };
        assert!(code == key || key == " ", "no key is called {key:?}");
        let mut event = json!({
            "type": if text.is_empty() { "rawKeyDown" } else { "keyDown" },
            "key": key, "code": code, "windowsVirtualKeyCode": number, "text": text,
        });
        self.call("Input.dispatchKeyEvent", &event);
        event["type"] = "keyUp".into();
        self.call("Input.dispatchKeyEvent", &event);
    }

    /// The addresses it requested, without data URIs.
    pub(crate) fn requests(&self) -> Vec<String> {
        self.events("Network.requestWillBeSent")
            .map(|event| event["request"]["url"].as_str().unwrap().to_owned())
            .filter(|address| !address.starts_with("data:"))
            .collect()
    }

    /// Its errors and console output.
    pub(crate) fn errors(&self) -> Vec<String> {
        let kinds = [
            "Runtime.exceptionThrown",
            "Runtime.consoleAPICalled",
            "Log.entryAdded",
        ];
        kinds
            .iter()
            .flat_map(|kind| self.events(kind))
            .map(Value::to_string)
            .collect()
    }

    /// Closes it.
    pub(crate) fn close(self) {
        let closing = json!({"targetId": self.target});
        self.browser.call(None, "Target.closeTarget", &closing);
        self.browser.events.clear();
    }
}
