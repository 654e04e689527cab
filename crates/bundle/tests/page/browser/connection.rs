//! The DevTools protocol over a pipe: commands with answers, events, sessions of pages and their workers.
//!
//! A pipe needs no port, and a browser ends by itself when it closes, however this process ends.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Write};
use std::process::{ChildStdin, ChildStdout};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// How long a browser may take for an answer.
const PATIENCE: Duration = Duration::from_secs(120);

/// Shared by all pages of a browser.
#[derive(Clone)]
pub struct Connection(Arc<Shared>);

struct Shared {
    pipe: Mutex<ChildStdin>,
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    last: u64,
    answers: HashMap<u64, Value>,
    events: Vec<Event>,
    children: HashMap<String, Child>,
    ended: bool,
}

/// Something that happened in a page or one of its workers.
#[derive(Clone, Debug)]
pub struct Event {
    /// Of the page, also where a worker is meant.
    pub page: String,
    /// Of the page or the worker.
    pub session: String,
    pub method: String,
    pub parameters: Value,
}

/// A worker.
#[derive(Clone, Debug)]
pub struct Child {
    page: String,
    pub session: String,
    /// "worker", "iframe".
    pub kind: String,
    pub url: String,
}

impl Connection {
    pub fn new(pipe: ChildStdin, output: ChildStdout) -> Self {
        let state = Mutex::default();
        let shared = Shared { pipe: Mutex::new(pipe), state, changed: Condvar::new() };
        let connection = Self(Arc::new(shared));
        let reader = connection.clone();
        std::thread::spawn(move || reader.read(output));
        connection
    }

    /// A command to the browser (no session), a page or a worker; its result, or why there is none.
    pub fn ask(&self, session: &str, method: &str, parameters: Value) -> Result<Value, String> {
        let id = self.send(session, method, parameters);
        let begun = Instant::now();
        let mut state = self.state();
        loop {
            if let Some(mut answer) = state.answers.remove(&id) {
                return match answer["error"]["message"].as_str() {
                    Some(message) => Err(format!("{method}: {message}")),
                    None => Ok(answer["result"].take()),
                };
            }
            let rest = PATIENCE.saturating_sub(begun.elapsed());
            if state.ended || rest.is_zero() {
                let why = if state.ended { "the browser has ended" } else { "no answer came" };
                return Err(format!("{method}: {why}"));
            }
            state = wait(&self.0.changed, state, rest);
        }
    }

    /// Events of a page and its workers so far.
    pub fn events(&self, page: &str) -> Vec<Event> {
        self.state().events.iter().filter(|event| event.page == page).cloned().collect()
    }

    /// Workers of a page that have begun and not ended.
    pub fn children(&self, page: &str) -> Vec<Child> {
        self.state().children.values().filter(|child| child.page == page).cloned().collect()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The number that the answer will have.
    fn send(&self, session: &str, method: &str, parameters: Value) -> u64 {
        let id = {
            let mut state = self.state();
            state.last += 1;
            state.last
        };
        let mut message = json!({ "id": id, "method": method, "params": parameters });
        if !session.is_empty() {
            message["sessionId"] = session.into();
        }
        let mut text = message.to_string().into_bytes();
        text.push(0);
        let mut pipe = self.0.pipe.lock().unwrap_or_else(PoisonError::into_inner);
        // Where the browser has ended, every open question gets an error.
        let _ = pipe.write_all(&text).and_then(|()| pipe.flush());
        id
    }

    fn read(&self, output: ChildStdout) {
        for message in BufReader::new(output).split(0) {
            let Ok(bytes) = message else { break };
            let Ok(message) = serde_json::from_slice::<Value>(&bytes) else { continue };
            self.take(message);
        }
        self.state().ended = true;
        self.0.changed.notify_all();
    }

    fn take(&self, mut message: Value) {
        if let Some(id) = message["id"].as_u64() {
            self.state().answers.insert(id, message);
            self.0.changed.notify_all();
            return;
        }
        let session = message["sessionId"].as_str().unwrap_or_default().to_owned();
        let method = message["method"].as_str().unwrap_or_default().to_owned();
        let parameters = message["params"].take();
        let page = {
            let state = self.state();
            state.children.get(&session).map_or_else(|| session.clone(), |c| c.page.clone())
        };
        match method.as_str() {
            "Target.attachedToTarget" if !session.is_empty() => self.attach(&page, &parameters),
            "Target.detachedFromTarget" => {
                let ended = parameters["sessionId"].as_str().unwrap_or_default();
                self.state().children.remove(ended);
            }
            _ => self.state().events.push(Event { page, session, method, parameters }),
        }
        self.0.changed.notify_all();
    }

    /// A worker waits until its errors are listened to. Nobody waits for these answers.
    fn attach(&self, page: &str, parameters: &Value) {
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let session = text(&parameters["sessionId"]);
        let target = &parameters["targetInfo"];
        let (kind, url) = (text(&target["type"]), text(&target["url"]));
        let child = Child { page: page.into(), session: session.clone(), kind, url };
        self.state().children.insert(session.clone(), child);
        for (method, parameters) in LISTEN {
            let parameters = serde_json::from_str(parameters).unwrap_or_default();
            self.send(&session, method, parameters);
        }
    }
}

/// What makes a page or a worker tell of its errors, and its workers be attached to as well.
pub const LISTEN: [(&str, &str); 4] = [
    ("Runtime.enable", "{}"),
    ("Log.enable", "{}"),
    (
        "Target.setAutoAttach",
        // Not service workers: they come and go, and one that waits for each tab's leave can wait for ever.
        r#"{"autoAttach": true, "waitForDebuggerOnStart": true, "flatten": true,
            "filter": [{"type": "service_worker", "exclude": true}, {}]}"#,
    ),
    ("Runtime.runIfWaitingForDebugger", "{}"),
];

fn wait<'a>(
    changed: &Condvar,
    state: MutexGuard<'a, State>,
    rest: Duration,
) -> MutexGuard<'a, State> {
    changed.wait_timeout(state, rest).unwrap_or_else(PoisonError::into_inner).0
}
