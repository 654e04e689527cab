//! Devices of the Haply Inverse Service: its WebSocket carries one state for every command.
//!
//! The service speaks first, and lists its devices; from then on every message, here the force on the cursor, is answered by
//! one with the places of all devices. Positions are in metres, forces in newtons, in a right-handed frame. The orientation
//! and the button are those of a grip, where there is one.

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket, client::client_with_config};
use viscera::haptics::{DeviceError, HapticDevice, Stylus};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Mat3, Vec3, vec3};

/// Where the service listens.
const SERVICE: &str = "ws://localhost:10001";

/// The name by which the service knows this program.
const PROFILE: &str = "viscera:haptics";

/// How long it may take to answer at the beginning.
const CONNECTS: Duration = Duration::from_secs(3);

/// A state that is older than this is none.
const STALE: Duration = Duration::from_millis(20);

/// An Inverse3 of the service.
pub struct Haply {
    socket: WebSocket<TcpStream>,
    id: String,
    stylus: Option<Stylus>,
    heard: Instant,
    has_said_hello: bool,
}

impl Haply {
    /// The first device that the service lists. `name` is its address, or "haply".
    pub fn connect(name: &str) -> Result<Self> {
        let address = if name == "haply" { SERVICE } else { name };
        let host = address.trim_start_matches("ws://").split('/').next().unwrap_or_default();
        let what = || {
            format!(
                "no haptic service answers at {address}; start the Haply Inverse Service, or take `--device virtual`"
            )
        };
        let found = host.to_socket_addrs().with_context(what)?.next().with_context(what)?;
        let stream = TcpStream::connect_timeout(&found, CONNECTS).with_context(what)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(CONNECTS))?;
        let (mut socket, _) = client_with_config(address, stream, None).map_err(|error| {
            anyhow::anyhow!("{address} speaks no WebSocket: {error}; give the address of a Haply Inverse Service")
        })?;
        let first = socket.read().with_context(what)?;
        let listed: Value = serde_json::from_slice(&first.into_data()).with_context(|| {
            format!("{address} is no Haply Inverse Service: its first message is no JSON")
        })?;
        let Some(id) = listed["inverse3"][0]["device_id"].as_str().map(str::to_owned) else {
            bail!("the Haply service lists no inverse3; connect the device and switch it on");
        };
        socket.get_ref().set_nonblocking(true)?;
        let mut device =
            Self { socket, id, stylus: None, heard: Instant::now(), has_said_hello: false };
        device.take(&listed).map_err(|error| anyhow::anyhow!("{error}"))?;
        device.exert(Vec3::ZERO, Vec3::ZERO)?;
        Ok(device)
    }

    fn gone(&self, reason: impl std::fmt::Display) -> DeviceError {
        DeviceError::Gone { device: self.name(), reason: reason.to_string() }
    }

    fn garbled(&self, reason: &str) -> DeviceError {
        DeviceError::Garbled { device: self.name(), reason: reason.to_owned() }
    }

    /// Where a message has the stylus.
    fn take(&mut self, state: &Value) -> Result<(), DeviceError> {
        let all = state["inverse3"].as_array().map_or(&[][..], Vec::as_slice);
        let own = all.iter().find(|device| device["device_id"] == *self.id);
        let Some(own) = own else { return Err(self.gone("the service no longer lists it")) };
        let place = &own["state"]["cursor_position"];
        let [Some(x), Some(y), Some(z)] = ["x", "y", "z"].map(|axis| place[axis].as_f64()) else {
            return Err(self.garbled("its cursor has no position"));
        };
        let grips = ["verse_grip", "wireless_verse_grip"].map(|kind| &state[kind][0]["state"]);
        let grip = grips.into_iter().find(|grip| grip["orientation"].is_object());
        let rotation = match grip.map(|grip| &grip["orientation"]) {
            None => Mat3::IDENTITY,
            Some(at) => rotation(["w", "x", "y", "z"].map(|part| at[part].as_f64()))
                .ok_or_else(|| self.garbled("its grip's orientation is no rotation"))?,
        };
        let button = grip.map_or(&Value::Null, |grip| match &grip["buttons"] {
            Value::Null => &grip["button"],
            all => &all["a"],
        });
        let pose = RigidTransform { rotation, translation: vec3(x, y, z) };
        if !pose.is_finite() || pose.translation.length() > 10.0 {
            return Err(self.garbled("its cursor is not within 10 m"));
        }
        self.stylus = Some(Stylus { pose, is_pressed: button.as_bool().unwrap_or(false) });
        self.heard = Instant::now();
        Ok(())
    }
}

/// Of a quaternion.
fn rotation(parts: [Option<f64>; 4]) -> Option<Mat3<f64>> {
    let [w, x, y, z] = parts;
    let (w, x, y, z) = (w?, x?, y?, z?);
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if !(0.5..2.0).contains(&length) {
        return None;
    }
    let [w, x, y, z] = [w, x, y, z].map(|part| part / length);
    let column = |a: [f64; 3]| Vec3::from_f64(a);
    Some(Mat3::from_columns(
        column([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)]),
        column([2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)]),
        column([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)]),
    ))
}

impl HapticDevice for Haply {
    fn name(&self) -> String {
        format!("haply {}", self.id)
    }

    fn read(&mut self) -> Result<Stylus, DeviceError> {
        loop {
            match self.socket.read() {
                Ok(Message::Close(_)) => return Err(self.gone("the service has closed")),
                Ok(message) if message.is_text() || message.is_binary() => {
                    let state = serde_json::from_slice::<Value>(&message.into_data());
                    self.take(&state.map_err(|_| self.garbled("a message is no JSON"))?)?;
                }
                Ok(_) => {}
                Err(tungstenite::Error::Io(error))
                    if error.kind() == std::io::ErrorKind::WouldBlock =>
                {
                    break;
                }
                Err(error) => return Err(self.gone(error)),
            }
        }
        let silent = self.heard.elapsed();
        match self.stylus {
            Some(stylus) if silent < STALE => Ok(stylus),
            _ => Err(DeviceError::Silent { device: self.name(), seconds: silent.as_secs_f64() }),
        }
    }

    fn exert(&mut self, force: Vec3<f64>, _: Vec3<f64>) -> Result<(), DeviceError> {
        let mut command = json!({ "inverse3": [{
            "device_id": self.id,
            "commands": { "set_cursor_force": { "vector": { "x": force.x, "y": force.y, "z": force.z } } },
        }] });
        if !self.has_said_hello {
            command["session"] = json!({ "configure": { "profile": { "name": PROFILE } } });
            self.has_said_hello = true;
        }
        match self.socket.send(Message::text(command.to_string())) {
            // A service that reads slower than a tick gets the next one.
            Err(tungstenite::Error::Io(error))
                if error.kind() == std::io::ErrorKind::WouldBlock =>
            {
                Ok(())
            }
            Err(tungstenite::Error::WriteBufferFull(_)) | Ok(()) => Ok(()),
            Err(error) => Err(self.gone(error)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::TcpListener;
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::thread::{JoinHandle, spawn};

    /// What a fake service does with each message: the cursor's place, or nothing and it is silent.
    type Answers = Box<dyn FnMut(usize, [f64; 3]) -> Option<String> + Send>;

    fn state(z: f64) -> String {
        json!({
            "inverse3": [{ "device_id": "049D", "state": {
                "cursor_position": { "x": 0.01, "y": -0.02, "z": z },
            } }],
            "verse_grip": [{ "device_id": "1", "state": {
                "button": true,
                "orientation": { "w": 0.5f64.sqrt(), "x": 0.0, "y": 0.0, "z": 0.5f64.sqrt() },
            } }],
        })
        .to_string()
    }

    /// Answers each message once, as the service does, and ends where `answers` has no more to say for good.
    fn service(first: String, mut answers: Answers) -> (String, JoinHandle<Vec<Value>>) {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = format!("ws://{}", listener.local_addr().expect("an address"));
        let served = spawn(move || {
            let (stream, _) = listener.accept().expect("a client");
            let mut socket = tungstenite::accept(stream).expect("a WebSocket");
            socket.send(Message::text(first)).expect("there");
            let mut heard = Vec::new();
            while let Ok(message) = socket.read() {
                let Ok(command) = serde_json::from_slice::<Value>(&message.into_data()) else {
                    break;
                };
                let vector = &command["inverse3"][0]["commands"]["set_cursor_force"]["vector"];
                let force = ["x", "y", "z"].map(|axis| vector[axis].as_f64().unwrap_or(f64::NAN));
                heard.push(command.clone());
                match answers(heard.len(), force) {
                    Some(text) if text == "close" => break,
                    Some(text) => socket.send(Message::text(text)).expect("there"),
                    None => {}
                }
            }
            heard
        });
        (address, served)
    }

    fn wait_for(
        device: &mut Haply,
        wanted: impl Fn(&Result<Stylus, DeviceError>) -> bool,
    ) -> Result<Stylus, DeviceError> {
        let begin = Instant::now();
        loop {
            let read = device.read();
            if wanted(&read) || begin.elapsed() > Duration::from_secs(20) {
                return read;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_device_says_where_it_is_and_gets_its_force() {
        let (sender, forces): (Sender<[f64; 3]>, Receiver<[f64; 3]>) = channel();
        let (address, served) = service(
            state(0.1),
            Box::new(move |count, force| {
                sender.send(force).expect("the test waits");
                Some(state(0.1 + 1e-3 * count as f64))
            }),
        );
        let mut device = Haply::connect(&address).expect("a device");
        assert_eq!(device.name(), "haply 049D");
        device.exert(vec3(0.5, -0.25, 2.0), Vec3::ZERO).expect("sent");
        let at = wait_for(&mut device, |read| {
            read.as_ref().is_ok_and(|at| at.pose.translation.z > 0.1015)
        });
        let at = at.expect("a state");
        assert!((at.pose.translation - vec3(0.01, -0.02, 0.102)).length() < 1e-12);
        // A quarter of a turn about z, the other way round than its inverse.
        assert!((at.pose.turn(vec3(1.0, 0.0, 0.0)) - vec3(0.0, 1.0, 0.0)).length() < 1e-12);
        assert!(at.is_pressed);
        drop(device);
        let heard = served.join().expect("no panic");
        assert_eq!(heard[0]["session"]["configure"]["profile"]["name"], PROFILE);
        assert!(heard[1].get("session").is_none());
        assert_eq!(forces.iter().collect::<Vec<_>>(), [[0.0; 3], [0.5, -0.25, 2.0]]);
    }

    #[test]
    fn a_device_that_is_silent_gone_or_garbled_says_so() {
        let silent: Answers = Box::new(|_, _| None);
        let (address, _served) = service(state(0.1), silent);
        let mut device = Haply::connect(&address).expect("a device");
        let read = wait_for(&mut device, Result::is_err);
        assert!(matches!(read, Err(DeviceError::Silent { .. })), "{read:?}");

        for (answer, wanted) in [
            ("close", "is gone"),
            ("{}", "no longer lists it"),
            ("what?", "is no JSON"),
            (
                r#"{"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":0}}}]}"#,
                "no position",
            ),
            (
                r#"{"inverse3":[{"device_id":"049D","state":{"cursor_position":{"x":1e9,"y":0,"z":0}}}]}"#,
                "10 m",
            ),
        ] {
            let answers: Answers = Box::new(move |_, _| Some(answer.to_owned()));
            let (address, _served) = service(state(0.1), answers);
            let mut device = Haply::connect(&address).expect("a device");
            let is_told = |read: &Result<Stylus, DeviceError>| {
                read.as_ref().is_err_and(|error| !matches!(error, DeviceError::Silent { .. }))
            };
            let read = wait_for(&mut device, is_told);
            let error = read.expect_err(answer).to_string();
            assert!(error.contains(wanted), "{answer}: {error}");
        }
    }

    #[test]
    fn what_is_no_service_is_told() {
        let (address, _served) = service("{}".to_owned(), Box::new(|_, _| None));
        let error = |address: &str| match Haply::connect(address) {
            Ok(_) => panic!("{address} is a device"),
            Err(error) => error.to_string(),
        };
        assert!(error(&address).contains("lists no inverse3"));
        assert!(error("ws://127.0.0.1:1").contains("no haptic service answers"));
        assert!(error("ws://").contains("no haptic service answers"));
    }
}
