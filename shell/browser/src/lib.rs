//! A page in Chromium, driven through the protocol of its developer tools
//! <https://chromedevtools.github.io/devtools-protocol/>.
//!
//! Commands and replies are JSON with a zero byte at the end, on pipes that the browser expects as its files 3 and 4.
//! Whatever goes wrong ends the test.
#![forbid(unsafe_code)]
// All callers are tests: a failure here is the test's.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::missing_panics_doc)]

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use tempfile::TempDir;

/// Longest wait for the browser and for anything on its page: it starts slowly on a busy machine.
const PATIENCE: Duration = Duration::from_mins(2);
/// `modifiers` of a key that is pressed together with Ctrl.
pub const CTRL: u32 = 2;

/// A page in a browser of its own, which ends with it.
pub struct Page {
    browser: Child,
    commands: ChildStdin,
    /// Replies and events, one a message.
    messages: Receiver<Vec<u8>>,
    /// Id of the page's session, empty before there is one.
    session: String,
    last_command: u64,
    _profile: TempDir,
}

impl Page {
    /// Opens a page; `None`, with a visible line, where there is no chromium.
    pub fn open(url: &str) -> Option<Self> {
        if Command::new("chromium").arg("--version").stdout(Stdio::null()).status().is_err() {
            eprintln!("skipped: there is no chromium here (apt-get install chromium)");
            return None;
        }
        let profile = tempfile::tempdir().unwrap();
        let mut browser = Command::new("sh")
            .args(["-c", "exec chromium \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", "sh"])
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"])
            .args(["--disable-background-networking", "--disable-component-update", "--disable-sync"])
            .args(["--disable-dev-shm-usage", "--remote-debugging-pipe"])
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let commands = browser.stdin.take().unwrap();
        let (sender, messages) = channel();
        let mut replies = BufReader::new(browser.stdout.take().unwrap()).split(0);
        // The thread ends with the browser, or with the test.
        thread::spawn(move || while replies.next().is_some_and(|r| sender.send(r.unwrap()).is_ok()) {});
        let (session, last_command) = (String::new(), 0);
        let mut page = Self { browser, commands, messages, session, last_command, _profile: profile };
        let target = page.command("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        page.session = page.command("Target.attachToTarget", &attach)["sessionId"].as_str().unwrap().into();
        page.command("Runtime.enable", &json!({}));
        page.resize(1400, 1000);
        page.command("Page.navigate", &json!({ "url": url }));
        Some(page)
    }

    /// Gives the window a size, in pixels.
    pub fn resize(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        self.command("Emulation.setDeviceMetricsOverride", &size);
    }

    /// Makes the window that of a telephone: fingers point in place of a mouse. The page has to be loaded again.
    pub fn become_telephone(&mut self, width: u32, height: u32) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 2, "mobile": true });
        self.command("Emulation.setDeviceMetricsOverride", &size);
        self.command("Emulation.setTouchEmulationEnabled", &json!({ "enabled": true, "maxTouchPoints": 1 }));
        self.command("Page.reload", &json!({}));
    }

    /// Puts a finger on a place of the window, moves it through the others, and lifts it.
    pub fn touch(&mut self, places: &[[f64; 2]]) {
        let points = |[x, y]: [f64; 2]| json!([{ "x": x, "y": y }]);
        let mut events = vec![("touchStart", points(places[0]))];
        events.extend(places[1..].iter().map(|place| ("touchMove", points(*place))));
        events.push(("touchEnd", json!([])));
        for (kind, points) in events {
            self.command("Input.dispatchTouchEvent", &json!({ "type": kind, "touchPoints": points }));
        }
    }

    /// Writes a picture of the window (PNG) into the folder that `SCREENSHOTS` names, if it is set: for a person to look
    /// at.
    pub fn screenshot(&mut self, name: &str) {
        let Some(folder) = std::env::var_os("SCREENSHOTS") else { return };
        std::fs::write(std::path::Path::new(&folder).join(name), self.picture()).unwrap();
    }

    /// Picture of the window, PNG.
    pub fn picture(&mut self) -> Vec<u8> {
        let reply = self.command("Page.captureScreenshot", &json!({ "format": "png" }));
        STANDARD.decode(reply["data"].as_str().unwrap()).unwrap()
    }

    /// Result of a command, which has to succeed. An exception in the page's scripts ends the test.
    fn command(&mut self, method: &str, parameters: &Value) -> Value {
        let reply = self.reply(method, parameters);
        reply.unwrap_or_else(|e| panic!("{method}: {e:#}"))
    }

    /// Result or error of a command.
    fn reply(&mut self, method: &str, parameters: &Value) -> Result<Value, Value> {
        self.last_command += 1;
        let mut command = json!({ "id": self.last_command, "method": method, "params": parameters });
        if !self.session.is_empty() {
            command["sessionId"] = self.session.clone().into();
        }
        write!(self.commands, "{command}\0").unwrap();
        loop {
            let message = self.messages.recv_timeout(PATIENCE).expect("chromium answers");
            let mut message: Value = serde_json::from_slice(&message).unwrap();
            assert!(message["method"] != "Runtime.exceptionThrown", "{message:#}");
            if message["id"] == self.last_command {
                return match message.get_mut("error") {
                    Some(error) => Err(error.take()),
                    None => Ok(message["result"].take()),
                };
            }
        }
    }

    /// Value of a JavaScript expression.
    pub fn value(&mut self, expression: &str) -> Value {
        let asked = json!({ "expression": expression, "returnByValue": true });
        // A page that is loaded meanwhile is asked again.
        let mut reply = loop {
            match self.reply("Runtime.evaluate", &asked) {
                Err(e) if e["message"].as_str().is_some_and(|line| line.contains("navigated")) => {}
                reply => break reply.unwrap(),
            }
        };
        assert!(reply.get("exceptionDetails").is_none(), "{expression}: {reply:#}");
        reply["result"]["value"].take()
    }

    /// Waits until a JavaScript condition holds. One that cannot be computed, as while the page is loaded, does not hold yet.
    pub fn wait_until(&mut self, condition: &str) {
        let started = Instant::now();
        let holds = format!("(() => {{ try {{ return {condition}; }} catch {{ return false; }} }})()");
        while self.value(&holds) != true {
            let waited = started.elapsed();
            assert!(waited < PATIENCE, "{condition}:\n{}", self.value("document.body.outerHTML"));
            thread::sleep(Duration::from_millis(20));
        }
    }

    /// Moves the mouse to a place of the window, presses the left button, moves through the others, and releases it.
    pub fn drag(&mut self, places: &[[f64; 2]]) {
        let event = |kind: &str, [x, y]: [f64; 2], buttons: u32| {
            let button = if kind == "mouseMoved" { "none" } else { "left" };
            json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 })
        };
        let (first, last) = (places[0], places[places.len() - 1]);
        let mut events = vec![event("mouseMoved", first, 0), event("mousePressed", first, 1)];
        events.extend(places[1..].iter().map(|place| event("mouseMoved", *place, 1)));
        events.push(event("mouseReleased", last, 0));
        for event in events {
            self.command("Input.dispatchMouseEvent", &event);
        }
    }

    /// Clicks the middle of the first element that a CSS selector matches.
    pub fn click(&mut self, selector: &str) {
        let middle = self.middle_of(selector);
        self.drag(&[middle]);
    }

    /// Middle of the first element that a CSS selector matches, in the window.
    pub fn middle_of(&mut self, selector: &str) -> [f64; 2] {
        let selector = json!(selector);
        let middle = self.value(&format!(
            "(({{x, y, width, height}}) => [x + width / 2, y + height / 2])\
             (document.querySelector({selector}).getBoundingClientRect())"
        ));
        serde_json::from_value(middle).unwrap()
    }

    /// Presses and releases a key, named as in a `KeyboardEvent`.
    pub fn press(&mut self, key: &str, modifiers: u32) {
        for kind in ["rawKeyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": key, "modifiers": modifiers });
            self.command("Input.dispatchKeyEvent", &event);
        }
    }

    /// Types a text into the element that has the focus.
    pub fn type_text(&mut self, text: &str) {
        self.command("Input.insertText", &json!({ "text": text }));
    }
}

impl Drop for Page {
    fn drop(&mut self) {
        // A browser that has ended by itself cannot be killed, which is as good.
        let _ = self.browser.kill();
        let _ = self.browser.wait();
    }
}
