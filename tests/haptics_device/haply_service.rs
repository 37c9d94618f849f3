//! A counterpart of Haply's service: speaks its format over a real socket, and misbehaves on demand.

use serde_json::{Value, json};
use std::collections::VecDeque;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;
use tungstenite::Message;
use tungstenite::protocol::frame::Frame;
use tungstenite::protocol::frame::coding::{Data, OpCode};

/// What the service does now.
#[derive(Default)]
pub struct World {
    /// What it says of its version; an old service does not know the question.
    pub version: Option<&'static str>,
    /// What it answers with.
    pub frame: Value,
    /// What it answers with before that.
    pub raw: VecDeque<Message>,
    /// How long it thinks.
    pub delay: Duration,
    /// Sends each answer in pieces with pauses between them.
    pub in_pieces: bool,
    /// Answers nothing.
    pub is_silent: bool,
    /// Hangs up.
    pub hangs_up: bool,
    /// What it was told.
    pub received: Vec<Value>,
    ended: bool,
}

pub struct Service {
    pub port: u16,
    world: Arc<Mutex<World>>,
    accepting: Option<std::thread::JoinHandle<()>>,
}

impl Service {
    pub fn new(version: Option<&'static str>, frame: Value) -> Self {
        Self::at(0, version, frame)
    }

    /// At a port where it was before.
    pub fn at(port: u16, version: Option<&'static str>, frame: Value) -> Self {
        let listener = super::wait_for("the port", || TcpListener::bind(("127.0.0.1", port)).ok());
        listener.set_nonblocking(true).expect("a listener");
        let port = listener.local_addr().expect("an address").port();
        let world = Arc::new(Mutex::new(World { version, frame, ..World::default() }));
        let shared = world.clone();
        let accepting = std::thread::spawn(move || {
            let mut serving = Vec::new();
            while !shared.lock().expect("unharmed").ended {
                match listener.accept() {
                    Ok((stream, _)) => {
                        let shared = shared.clone();
                        serving.push(std::thread::spawn(move || serve(stream, &shared)));
                    }
                    Err(_) => std::thread::sleep(Duration::from_millis(1)),
                }
            }
            serving.into_iter().for_each(|thread| thread.join().expect("a service that does not fail"));
        });
        Self { port, world, accepting: Some(accepting) }
    }

    pub fn world(&self) -> MutexGuard<'_, World> {
        self.world.lock().expect("unharmed")
    }

    /// The last force that a device was told, with its spelling.
    pub fn last_force(&self, id: &str) -> Option<(String, [f64; 3])> {
        let world = self.world();
        let told = world.received.iter().rev().flat_map(|message| message["inverse3"].as_array().into_iter().flatten());
        let command = &told.into_iter().find(|arm| arm["device_id"] == id)?["commands"]["set_cursor_force"];
        let (spelling, force) = command.as_object()?.iter().find(|(_, value)| value.is_object())?;
        Some((spelling.clone(), ["x", "y", "z"].map(|axis| force[axis].as_f64().expect("a number"))))
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.world.lock().unwrap_or_else(std::sync::PoisonError::into_inner).ended = true;
        if let Some(thread) = self.accepting.take() {
            let _ = thread.join();
        }
    }
}

fn serve(mut stream: TcpStream, world: &Mutex<World>) {
    stream.set_nonblocking(false).expect("a stream");
    stream.set_read_timeout(Some(Duration::from_secs(2))).expect("a stream");
    let mut start = [0; 12];
    while stream.peek(&mut start).is_ok_and(|length| length > 0 && length < start.len()) {}
    let version = world.lock().expect("unharmed").version;
    if &start == b"GET /version" {
        let _ = stream.read(&mut [0; 1024]);
        let answer = match version {
            Some(version) => {
                format!("HTTP/1.1 200 OK\r\nContent-Type: application/json\r\n\r\n{{\"version\":\"{version}\"}}")
            }
            None => "HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n".into(),
        };
        let _ = stream.write_all(answer.as_bytes());
        return;
    }
    let Ok(mut socket) = tungstenite::accept(stream) else { return };
    socket.get_ref().set_read_timeout(Some(Duration::from_millis(5))).expect("a stream");
    // The service speaks first.
    let mut is_asked = true;
    loop {
        if is_asked {
            let (answer, delay, in_pieces) = {
                let mut world = world.lock().expect("unharmed");
                let next = world.raw.pop_front();
                let answer = next.unwrap_or_else(|| Message::text(world.frame.to_string()));
                (Some(answer).filter(|_| !world.is_silent), world.delay, world.in_pieces)
            };
            std::thread::sleep(delay);
            let sent = match answer {
                Some(Message::Text(text)) if in_pieces => in_parts(&mut socket, text.as_str()),
                Some(answer) => socket.send(answer).is_ok(),
                None => true,
            };
            if !sent {
                return;
            }
        }
        is_asked = match socket.read() {
            Ok(Message::Text(text)) => {
                let message = serde_json::from_str(&text).expect("what we send is JSON");
                let mut world = world.lock().expect("unharmed");
                world.received.push(message);
                true
            }
            Ok(_) => false,
            Err(tungstenite::Error::Io(error))
                if matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) =>
            {
                false
            }
            Err(_) => return,
        };
        let world = world.lock().expect("unharmed");
        if world.ended || world.hangs_up {
            return;
        }
    }
}

/// A message as two frames, the second of them in two parts with a pause between them.
fn in_parts(socket: &mut tungstenite::WebSocket<TcpStream>, text: &str) -> bool {
    let (first, second) = text.split_at(text.len() / 2);
    let first = Frame::message(first.as_bytes().to_vec(), OpCode::Data(Data::Text), false);
    if socket.send(Message::Frame(first)).is_err() {
        return false;
    }
    let mut bytes = vec![0x80, 126];
    bytes.extend((second.len() as u16).to_be_bytes());
    bytes.extend(second.as_bytes());
    let stream = socket.get_mut();
    let half = bytes.len() / 2;
    stream.write_all(&bytes[..half]).is_ok() && {
        std::thread::sleep(Duration::from_millis(45));
        stream.write_all(&bytes[half..]).is_ok()
    }
}

/// An arm as the service tells of it; 3.5 gives the kind as a word or a number.
pub fn arm(id: &str, kind: Value, [x, y, z]: [f64; 3]) -> Value {
    json!({
        "device_id": id,
        "config": { "device_info": { "device_type": kind, "unknown": [1, 2] } },
        "state": {
            "cursor_position": { "x": x, "y": y, "z": z },
            "cursor_velocity": { "x": 0.1, "y": 0.2, "z": 0.3 },
            "mode": "idle", "control_mode": "force", "transform": null,
        },
        "status": { "calibrated": true, "in_use": true, "power_supply": true, "ready": true, "started": true },
    })
}
