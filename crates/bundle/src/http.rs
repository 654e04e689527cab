//! As much of HTTP as a server of static files takes: one question on each connection, one answer.
//!
//! Browsers open many connections at once and keep some of them idle; a thread for each is never in another's way.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// The longest head that is read [bytes], and how long one may take.
const LONGEST: u64 = 32_768;
const PATIENCE: Duration = Duration::from_secs(10);

/// What is asked for.
pub struct Question {
    /// "GET", "HEAD" and the like.
    pub method: String,
    /// What follows the server's address.
    pub url: String,
    /// Names in lower case, and values.
    pub headers: Vec<(String, String)>,
}

/// What is sent back.
#[derive(Debug, PartialEq, Eq)]
pub struct Answer {
    /// 200, 301, 403, 404 or 405.
    pub status: u16,
    /// Names and values.
    pub headers: Vec<(&'static str, String)>,
    /// Left out where only the head is asked for.
    pub body: Vec<u8>,
}

/// Answers questions on a port of this machine until it is dropped.
pub struct Listener {
    address: SocketAddr,
    has_ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Listener {
    /// Port 0 is any that is free.
    pub fn start(
        port: u16,
        answer: impl Fn(&Question) -> Answer + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let has_ended = Arc::new(AtomicBool::new(false));
        let (ended, answer) = (has_ended.clone(), Arc::new(answer));
        let thread = std::thread::spawn(move || {
            for stream in listener.incoming() {
                if ended.load(Ordering::SeqCst) {
                    return;
                }
                let answer = answer.clone();
                // Whoever asked may have gone; others come.
                std::thread::spawn(move || stream.and_then(|stream| serve(stream, &*answer)));
            }
        });
        Ok(Self { address, has_ended, thread: Some(thread) })
    }

    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Until the program is ended.
    pub fn wait(mut self) {
        if let Some(thread) = self.thread.take() {
            // It does not end by itself.
            let _ = thread.join();
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        self.has_ended.store(true, Ordering::SeqCst);
        // It waits for a connection: here is one.
        let _ = TcpStream::connect(self.address);
        if let Some(thread) = self.thread.take() {
            // Nothing is left to be done for a thread that panicked.
            let _ = thread.join();
        }
    }
}

fn serve(stream: TcpStream, answer: &dyn Fn(&Question) -> Answer) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let mut reader = BufReader::new(stream.try_clone()?.take(LONGEST));
    let Some(question) = read(&mut reader)? else { return Ok(()) };
    let answer = answer(&question);
    let mut head = format!("HTTP/1.1 {} {}\r\n", answer.status, phrase(answer.status));
    for (name, value) in &answer.headers {
        head.push_str(&format!("{name}: {value}\r\n"));
    }
    head.push_str(&format!("Content-Length: {}\r\nConnection: close\r\n\r\n", answer.body.len()));
    let mut writer = &stream;
    writer.write_all(head.as_bytes())?;
    if question.method != "HEAD" {
        writer.write_all(&answer.body)?;
    }
    // What is still being sent is read, else the answer would be torn up with the connection.
    stream.shutdown(std::net::Shutdown::Write)?;
    io::copy(&mut reader, &mut io::sink())?;
    Ok(())
}

/// The head; nothing where it is none.
fn read(reader: &mut impl BufRead) -> io::Result<Option<Question>> {
    let mut line = String::new();
    reader.read_line(&mut line)?;
    let mut words = line.split_whitespace();
    let (Some(method), Some(url), Some(version)) = (words.next(), words.next(), words.next())
    else {
        return Ok(None);
    };
    if !version.starts_with("HTTP/1.") {
        return Ok(None);
    }
    let (method, url) = (method.to_owned(), url.to_owned());
    let mut headers = Vec::new();
    loop {
        let mut line = String::new();
        if reader.read_line(&mut line)? == 0 {
            return Ok(None);
        }
        let line = line.trim_end();
        if line.is_empty() {
            return Ok(Some(Question { method, url, headers }));
        }
        if let Some((name, value)) = line.split_once(':') {
            headers.push((name.trim().to_ascii_lowercase(), value.trim().to_owned()));
        }
    }
}

fn phrase(status: u16) -> &'static str {
    match status {
        200 => "OK",
        301 => "Moved Permanently",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        _ => "",
    }
}
