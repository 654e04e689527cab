//! A tab: go somewhere, evaluate, press, touch, look.

use std::cell::RefCell;
use std::path::Path;
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::connection::{Child, Connection, Event, LISTEN};
use super::picture::Picture;

/// What a visitor looks through.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// In the page's own pixels.
    pub width: u32,
    pub height: u32,
    /// Pixels of the screen for each of the page's.
    pub scale: f64,
    pub is_touched: bool,
}

impl View {
    pub const DESK: Self = Self { width: 1440, height: 900, scale: 1.0, is_touched: false };
    pub const PHONE: Self = Self { width: 390, height: 844, scale: 2.0, is_touched: true };
    /// The same screen as `DESK` with the browser's own zoom of 300 %.
    pub const ZOOMED: Self = Self { width: 480, height: 300, scale: 3.0, is_touched: false };
}

/// A tab; when it goes, what it complained of unexpectedly fails the test.
pub struct Tab {
    connection: Connection,
    session: String,
    target: String,
    /// The visitor: tabs of one context share storage and service workers.
    pub context: String,
    expected: RefCell<Vec<String>>,
}

impl Tab {
    pub(super) fn new(
        connection: Connection,
        session: String,
        target: String,
        context: String,
    ) -> Self {
        let tab = Self { connection, session, target, context, expected: RefCell::default() };
        for (method, parameters) in LISTEN {
            tab.ask(method, serde_json::from_str(parameters).expect("parameters"));
        }
        tab.ask("Page.enable", json!({}));
        tab.ask("Inspector.enable", json!({}));
        tab.ask("Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        tab.view(View::DESK);
        tab
    }

    /// A command of the protocol.
    pub fn ask(&self, method: &str, parameters: Value) -> Value {
        self.connection.ask(&self.session, method, parameters).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Goes to an address and waits until its document has been read. Where only what follows `#` differs,
    /// the document stays.
    pub fn go(&self, url: &str) {
        let answer = self.ask("Page.navigate", json!({ "url": url }));
        assert!(answer["errorText"].is_null(), "{url}: {}", answer["errorText"]);
        self.wait("document.readyState === 'complete'", 20.0);
    }

    pub fn reload(&self) {
        self.evaluate("window.isBeforeReload = true");
        self.ask("Page.reload", json!({}));
        let is_there = "!window.isBeforeReload && document.readyState === 'complete'";
        self.wait(is_there, 20.0);
    }

    /// The value of an expression; where it is a promise, what comes of it.
    pub fn evaluate(&self, expression: &str) -> Value {
        let told = |e| panic!("`{expression}`: {e}; the page said:\n{}", few(self.said()));
        self.try_evaluate(expression).unwrap_or_else(told)
    }

    /// The same, or what was thrown.
    pub fn try_evaluate(&self, expression: &str) -> Result<Value, String> {
        self.evaluate_in(&self.session, expression)
    }

    /// In a worker whose address contains these words.
    pub fn evaluate_in_worker(&self, words: &str, expression: &str) -> Value {
        let workers = self.workers();
        let worker = workers.iter().find(|worker| worker.url.contains(words));
        let worker = worker.unwrap_or_else(|| panic!("no worker `{words}` among {workers:?}"));
        self.evaluate_in(&worker.session, expression)
            .unwrap_or_else(|e| panic!("`{expression}` in {}: {e}", worker.url))
    }

    fn evaluate_in(&self, session: &str, expression: &str) -> Result<Value, String> {
        let parameters = json!({
            "expression": expression,
            "awaitPromise": true,
            "returnByValue": true,
            "userGesture": true,
        });
        let mut answer = self.connection.ask(session, "Runtime.evaluate", parameters)?;
        match thrown(&answer["exceptionDetails"]) {
            Some(what) => Err(what),
            None => Ok(answer["result"]["value"].take()),
        }
    }

    /// Dedicated workers that run.
    pub fn workers(&self) -> Vec<Child> {
        let mut workers = self.connection.children(&self.session);
        workers.retain(|worker| worker.kind == "worker");
        workers
    }

    /// Waits until an expression is true and returns it; after so many seconds the test fails, with what the
    /// page said.
    pub fn wait(&self, expression: &str, seconds: f64) -> Value {
        let begun = Instant::now();
        loop {
            // While a document is replaced there is nothing to ask.
            let value = self.try_evaluate(expression);
            if let Ok(value) = &value
                && is_true(value)
            {
                return value.clone();
            }
            if begun.elapsed().as_secs_f64() > seconds {
                let (value, said) = (value.unwrap_or_else(Value::from), few(self.said()));
                panic!("after {seconds} s `{expression}` is {value}; the page said:\n{said}");
            }
            pause(0.03);
        }
    }

    /// What the visitor looks through.
    pub fn view(&self, view: View) {
        let size = json!({
            "width": view.width,
            "height": view.height,
            "deviceScaleFactor": view.scale,
            "mobile": view.is_touched,
        });
        self.ask("Emulation.setDeviceMetricsOverride", size);
        let touch = json!({ "enabled": view.is_touched, "maxTouchPoints": 5 });
        self.ask("Emulation.setTouchEmulationEnabled", touch);
    }

    /// Dark or light, reduced motion and the like: `("prefers-color-scheme", "dark")`.
    pub fn prefers(&self, feature: &str, value: &str) {
        let features = json!({ "features": [{ "name": feature, "value": value }] });
        self.ask("Emulation.setEmulatedMedia", features);
    }

    /// "mousePressed", "mouseMoved", "mouseReleased" with "left", "middle", "right" or "none".
    pub fn mouse(&self, kind: &str, at: [f64; 2], button: &str) {
        let held = match (kind, button) {
            ("mouseReleased", _) | (_, "none") => 0,
            (_, "right") => 2,
            (_, "middle") => 4,
            _ => 1,
        };
        let parameters = json!({
            "type": kind, "x": at[0], "y": at[1], "button": button, "buttons": held,
            "clickCount": i32::from(kind != "mouseMoved"), "pointerType": "mouse",
        });
        self.ask("Input.dispatchMouseEvent", parameters);
        self.hear_moves(kind);
    }

    /// Browsers keep moves of a pointer until they draw the next picture: what is asked of the page before that
    /// would overtake them.
    fn hear_moves(&self, kind: &str) {
        if matches!(kind, "mouseMoved" | "touchMove") {
            self.evaluate("new Promise((done) => { requestAnimationFrame(() => done(1)); setTimeout(done, 2000); })");
        }
    }

    pub fn click(&self, at: [f64; 2]) {
        self.mouse("mouseMoved", at, "none");
        self.mouse("mousePressed", at, "left");
        self.mouse("mouseReleased", at, "left");
    }

    /// Clicks the middle of an element.
    pub fn click_on(&self, selector: &str) {
        let [left, top, width, height] = self.area(selector);
        self.click([left + width / 2.0, top + height / 2.0]);
    }

    pub fn wheel(&self, at: [f64; 2], down: f64) {
        let parameters = json!({
            "type": "mouseWheel", "x": at[0], "y": at[1], "deltaX": 0, "deltaY": down,
        });
        self.ask("Input.dispatchMouseEvent", parameters);
    }

    /// "touchStart", "touchMove", "touchEnd" with all fingers that are down.
    pub fn touch(&self, kind: &str, fingers: &[[f64; 2]]) {
        let fingers = fingers.iter().enumerate();
        let points: Vec<Value> =
            fingers.map(|(id, [x, y])| json!({ "x": x, "y": y, "id": id, "force": 1 })).collect();
        self.ask("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": points }));
        self.hear_moves(kind);
    }

    /// A key by its name ("Tab", "Enter", "Escape", "ArrowUp") or a letter, with what it writes.
    pub fn key(&self, name: &str, modifiers: u32) {
        let code = match name {
            "Tab" => 9,
            "Enter" => 13,
            "Escape" => 27,
            " " => 32,
            "ArrowLeft" => 37,
            "ArrowUp" => 38,
            "ArrowRight" => 39,
            "ArrowDown" => 40,
            letter => letter.to_uppercase().bytes().next().map_or(0, u32::from),
        };
        let text = match name {
            "Enter" => "\r",
            one if one.chars().count() == 1 => one,
            _ => "",
        };
        for kind in ["keyDown", "keyUp"] {
            let text = if kind == "keyDown" { text } else { "" };
            let parameters = json!({
                "type": kind, "key": name, "text": text, "modifiers": modifiers,
                "windowsVirtualKeyCode": code, "nativeVirtualKeyCode": code,
            });
            self.ask("Input.dispatchKeyEvent", parameters);
        }
    }

    /// Lets files fall onto a place of the page.
    pub fn drop_files(&self, at: [f64; 2], files: &[&Path]) {
        let files: Vec<String> = files.iter().map(|file| file.display().to_string()).collect();
        for kind in ["dragEnter", "dragOver", "drop"] {
            let data = json!({ "items": [], "files": files, "dragOperationsMask": 1 });
            let parameters = json!({ "type": kind, "x": at[0], "y": at[1], "data": data });
            self.ask("Input.dispatchDragEvent", parameters);
        }
    }

    /// Left, top, width and height of an element in the page's pixels.
    pub fn area(&self, selector: &str) -> [f64; 4] {
        let selector = Value::from(selector);
        let script = format!(
            "(() => {{ const e = document.querySelector({selector}); if (!e) return null; \
             const r = e.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; }})()"
        );
        let value = self.evaluate(&script);
        let numbers = value.as_array().unwrap_or_else(|| panic!("there is no {selector}"));
        std::array::from_fn(|i| numbers[i].as_f64().expect("a number"))
    }

    /// What is seen.
    pub fn look(&self) -> Picture {
        let answer = self.ask("Page.captureScreenshot", json!({ "format": "png" }));
        let data = answer["data"].as_str().expect("a picture");
        Picture::new(STANDARD.decode(data).expect("base64"))
    }

    /// Memory of page and workers after a clean-up: scripts' objects and buffers, wasm memory included [bytes].
    pub fn memory(&self) -> f64 {
        let workers = self.workers();
        let sessions = std::iter::once(&self.session).chain(workers.iter().map(|w| &w.session));
        let mut sum = 0.0;
        for session in sessions {
            let ask = |method: &str| {
                self.connection.ask(session, method, json!({})).unwrap_or_else(|e| panic!("{e}"))
            };
            ask("HeapProfiler.collectGarbage");
            let usage = ask("Runtime.getHeapUsage");
            let parts = ["usedSize", "backingStorageSize"];
            sum += parts.iter().map(|part| usage[part].as_f64().unwrap_or(0.0)).sum::<f64>();
        }
        sum
    }

    /// This text may appear among errors.
    pub fn expect(&self, words: &str) {
        self.expected.borrow_mut().push(words.to_owned());
    }

    /// Errors so far that nobody expected: exceptions, errors on the console, files that are missing.
    pub fn errors(&self) -> Vec<String> {
        let mut errors: Vec<String> =
            self.connection.events(&self.session).iter().filter_map(error_of).collect();
        let expected = self.expected.borrow();
        errors.retain(|error| !expected.iter().any(|words| error.contains(words)));
        errors
    }

    /// All that was written on the console, and all errors.
    pub fn said(&self) -> Vec<String> {
        let events = self.connection.events(&self.session);
        let lines = events.iter().filter_map(|event| error_of(event).or_else(|| line_of(event)));
        lines.collect()
    }
}

impl Drop for Tab {
    fn drop(&mut self) {
        let errors = self.errors();
        let _ = self.connection.ask("", "Target.closeTarget", json!({ "targetId": self.target }));
        if !std::thread::panicking() {
            assert!(errors.is_empty(), "the page complained:\n{}", few(errors));
        } else if !errors.is_empty() {
            println!("the page complained:\n{}", few(errors));
        }
    }
}

pub fn pause(seconds: f64) {
    std::thread::sleep(Duration::from_secs_f64(seconds));
}

/// Each line once, and not all of a hundred.
fn few(mut lines: Vec<String>) -> String {
    let mut known = std::collections::HashSet::new();
    lines.retain(|line| known.insert(line.clone()));
    lines.truncate(12);
    lines.join("\n")
}

/// As JavaScript takes it.
fn is_true(value: &Value) -> bool {
    match value {
        Value::Null => false,
        Value::Bool(is) => *is,
        Value::Number(number) => number.as_f64() != Some(0.0),
        Value::String(text) => !text.is_empty(),
        Value::Array(_) | Value::Object(_) => true,
    }
}

/// What was thrown, with its place.
fn thrown(details: &Value) -> Option<String> {
    let text = details["text"].as_str()?;
    let more = details["exception"]["description"].as_str();
    let more = more.or(details["exception"]["value"].as_str()).unwrap_or_default();
    Some(format!("{text} {more} ({}:{})", details["url"], details["lineNumber"]))
}

/// An error in words.
fn error_of(event: &Event) -> Option<String> {
    let parameters = &event.parameters;
    match event.method.as_str() {
        "Runtime.exceptionThrown" => thrown(&parameters["exceptionDetails"]),
        // A service worker that is put to sleep sends that too.
        "Inspector.targetCrashed" if event.session == event.page => {
            Some("the tab has crashed".into())
        }
        "Log.entryAdded" if parameters["entry"]["level"] == "error" => {
            let entry = &parameters["entry"];
            Some(format!("{} ({})", entry["text"].as_str().unwrap_or_default(), entry["url"]))
        }
        "Runtime.consoleAPICalled"
            if ["error", "assert"].iter().any(|t| parameters["type"] == *t) =>
        {
            line_of(event)
        }
        _ => None,
    }
}

/// A line of the console.
fn line_of(event: &Event) -> Option<String> {
    if event.method != "Runtime.consoleAPICalled" {
        return None;
    }
    let parts = event.parameters["args"].as_array()?.iter().map(|part| {
        let text = part["value"].as_str().or(part["description"].as_str());
        text.map_or_else(|| part["value"].to_string(), str::to_owned)
    });
    let kind = event.parameters["type"].as_str().unwrap_or_default();
    Some(format!("console.{kind}: {}", parts.collect::<Vec<_>>().join(" ")))
}
